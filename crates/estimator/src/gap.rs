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
    let (min, max) = range(s_m);
    if min > max {
        return Err(Error::NothingMeasured);
    }
    let mid_range_m = f64::midpoint(max, min);
    let (mut upper_sum, mut upper, mut lower_sum, mut lower) = (0.0, 0_usize, 0.0, 0_usize);
    for &s in s_m {
        // Both sums at every sample, of which at least one is of nothing: no branch to guess, and NaN is in neither.
        let (is_upper, is_lower) = (s >= mid_range_m, s < mid_range_m);
        upper_sum += if is_upper { s - mid_range_m } else { 0.0 };
        lower_sum += if is_lower { s - mid_range_m } else { 0.0 };
        upper += usize::from(is_upper);
        lower += usize::from(is_lower);
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

/// Least and greatest, in eight chains side by side; the wrong way round where there is no sample.
fn range(s_m: &[f64]) -> (f64, f64) {
    let (mut least, mut greatest) = ([f64::INFINITY; 8], [f64::NEG_INFINITY; 8]);
    let (eights, rest) = s_m.as_chunks::<8>();
    let mut note = |lane: usize, s: f64| {
        least[lane] = if s < least[lane] { s } else { least[lane] };
        greatest[lane] = if s > greatest[lane] { s } else { greatest[lane] };
    };
    for eight in eights {
        for (lane, s) in eight.iter().enumerate() {
            note(lane, *s);
        }
    }
    rest.iter().for_each(|s| note(0, *s));
    (least.into_iter().fold(f64::INFINITY, f64::min), greatest.into_iter().fold(f64::NEG_INFINITY, f64::max))
}
