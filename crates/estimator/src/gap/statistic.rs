//! The gap statistic (equations 29–31).
//!
//! `multiversion` compiles its loops for each kind of vectors and chooses one when the program runs. Vectors change no
//! result: each lane runs the same operations in the same order as scalar code, and no product is fused with a sum. So
//! results are bitwise identical on every machine, and records do not hold the instruction set.

#[cfg(feature = "std")]
use multiversion::multiversion;

use crate::error::Error;

/// ΔS and what it is made of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GapStatistic {
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

/// Gap statistic ΔS = mean{S ≥ m} − mean{S < m}, m = (max S + min S)/2 (29–31).
///
/// `s_m` is S at each sample, m; NaN is skipped, and samples equal to the mid-range belong to the upper set.
///
/// ```
/// let gap = estimator::gap::mid_range(&[0.0, 100e-6, 2e-6, 98e-6])?;
/// assert!((gap.gap_m - 98e-6).abs() < 1e-12);
/// # Ok::<(), estimator::Error>(())
/// ```
///
/// # Errors
/// [`Error::Constant`] when S does not move, so that the lower set is empty; [`Error::NothingMeasured`]
/// when there is no sample.
pub fn mid_range(s_m: &[f64]) -> Result<GapStatistic, Error> {
    let (min, max) = range(s_m);
    if min > max {
        return Err(Error::NothingMeasured);
    }
    let mid_range_m = f64::midpoint(max, min);
    let (sums_m, counts) = halves(s_m, mid_range_m);
    let [upper_sum, lower_sum] = sums_m.map(|chains| chains.iter().sum::<f64>());
    let [upper, lower] = counts.map(|chains| chains.iter().sum::<u64>() as usize);
    if lower == 0 {
        return Err(Error::Constant { samples: upper, s_m: max });
    }
    let (upper_m, lower_m) = (upper_sum / upper as f64, lower_sum / lower as f64);
    debug_assert!(
        upper_m >= lower_m || upper_m.is_nan() || lower_m.is_nan(),
        "means {upper_m} m above and {lower_m} m below the mid-range"
    );
    Ok(GapStatistic {
        gap_m: upper_m - lower_m,
        upper_m: upper_m + mid_range_m,
        lower_m: lower_m + mid_range_m,
        mid_range_m,
        upper,
        lower,
    })
}

/// Chains side by side: a sum waits for the addition before it, and eight wait at once. The order of additions is
/// part of the number: sample k belongs to chain k mod 8, and the chains are added up in their order.
const CHAINS: usize = 8;

/// Samples at or above a level and below it, by chains: the sums of what they differ from it, m, and how many
/// they are. NaN is neither.
#[cfg_attr(feature = "std", multiversion(targets("x86_64+avx512f+avx512vl+avx512dq", "x86_64+avx2")))]
fn halves(s_m: &[f64], level_m: f64) -> ([[f64; CHAINS]; 2], [[u64; CHAINS]; 2]) {
    let ([mut upper_m, mut lower_m], mut counts) = ([[0.0; CHAINS]; 2], [[0; CHAINS]; 2]);
    let (eights, rest) = s_m.as_chunks::<CHAINS>();
    for eight in eights.iter().chain([&pad_with_nan(rest)]) {
        for (chain, &s) in eight.iter().enumerate() {
            // Both sums at every sample, of which at least one is of nothing: no branch to guess.
            let (is_upper, is_lower) = (s >= level_m, s < level_m);
            upper_m[chain] += if is_upper { s - level_m } else { 0.0 };
            lower_m[chain] += if is_lower { s - level_m } else { 0.0 };
            counts[0][chain] += u64::from(is_upper);
            counts[1][chain] += u64::from(is_lower);
        }
    }
    ([upper_m, lower_m], counts)
}

/// Least and greatest; the wrong way round where there is no sample.
pub(crate) fn range(s_m: &[f64]) -> (f64, f64) {
    let (least, greatest) = extremes(s_m);
    (least.into_iter().fold(f64::INFINITY, f64::min), greatest.into_iter().fold(f64::NEG_INFINITY, f64::max))
}

/// Least and greatest of each chain.
#[cfg_attr(feature = "std", multiversion(targets("x86_64+avx512f+avx512vl+avx512dq", "x86_64+avx2")))]
fn extremes(s_m: &[f64]) -> ([f64; CHAINS], [f64; CHAINS]) {
    let (mut least, mut greatest) = ([f64::INFINITY; CHAINS], [f64::NEG_INFINITY; CHAINS]);
    let (eights, rest) = s_m.as_chunks::<CHAINS>();
    for eight in eights.iter().chain([&pad_with_nan(rest)]) {
        for (chain, &s) in eight.iter().enumerate() {
            least[chain] = if s < least[chain] { s } else { least[chain] };
            greatest[chain] = if s > greatest[chain] { s } else { greatest[chain] };
        }
    }
    (least, greatest)
}

/// Up to eight samples, filled up with NaN, which no sum, count or extreme takes in.
#[inline(always)]
#[allow(clippy::inline_always, reason = "compiled within each version of its caller")]
fn pad_with_nan(s_m: &[f64]) -> [f64; CHAINS] {
    let mut all = [f64::NAN; CHAINS];
    all[..s_m.len()].copy_from_slice(s_m);
    all
}
