//! The gap statistic (equations 29–31).

use crate::error::Error;

/// ΔS and what it is made of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gap {
    /// ΔS = mean of the upper set less mean of the lower (29), m.
    pub gap_m: f64,
    /// Mean of S at or above its mid-range (30), m.
    pub upper_m: f64,
    /// Mean of S below it (31), m.
    pub lower_m: f64,
    /// Mid-range (max S + min S)/2, m.
    pub mid_range_m: f64,
    /// Samples in the upper set.
    pub upper: usize,
    /// Samples in the lower set.
    pub lower: usize,
}

/// ΔS of a track; NaN samples are passed over, and samples equal to the mid-range go to the upper set.
///
/// # Errors
/// [`Error::Constant`] when S does not move, so that the lower set is empty; [`Error::NothingMeasured`]
/// when there is no sample.
pub fn mid_range(s_m: &[f64]) -> Result<Gap, Error> {
    let present = || s_m.iter().copied().filter(|s| !s.is_nan());
    let (min, max) = present().fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), s| (lo.min(s), hi.max(s)));
    if min > max {
        return Err(Error::NothingMeasured);
    }
    let mid_range_m = f64::midpoint(max, min);
    let (mut upper_sum, mut upper, mut lower_sum, mut lower) = (0.0, 0_usize, 0.0, 0_usize);
    for s in present() {
        if s >= mid_range_m {
            upper_sum += s - mid_range_m;
            upper += 1;
        } else {
            lower_sum += s - mid_range_m;
            lower += 1;
        }
    }
    if lower == 0 {
        return Err(Error::Constant { samples: upper, s_m: max });
    }
    let (upper_m, lower_m) = (upper_sum / upper as f64, lower_sum / lower as f64);
    Ok(Gap {
        gap_m: upper_m - lower_m,
        upper_m: upper_m + mid_range_m,
        lower_m: lower_m + mid_range_m,
        mid_range_m,
        upper,
        lower,
    })
}
