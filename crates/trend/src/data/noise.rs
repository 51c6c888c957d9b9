//! Scatter of a unit's values from flight to flight, without steps and wear, and the outliers among the values.
//!
//! One estimator for gaps and for all other quantities.

use crate::math::{SD_OVER_MAD, median};

/// Flights of a batch whose means show a scatter that neighbours share.
const BATCH: usize = 8;

/// Number of batches that the assumed inflation counts for, and the largest inflation: beyond it, what neighbours share
/// is a change, not scatter.
const PRIOR_BATCHES: f64 = 5.0;
const MAX_INFLATION: f64 = 8.0;

/// Two standard errors, 2 · 1.17 · √2, of a variance that the median of one normal deviate gives; of n deviates, as many
/// over √n.
pub(crate) const CERTAIN: f64 = 3.3;

/// With at most this many values, a jump may pass for noise: the factor of stated variances is then limited.
const FEW: usize = 9;
const MOST_OF_FEW: f64 = 4.0;

/// If second differences give less than this share of the variance by first ones, the rate changes, and they count.
const CHANGING_RATE: f64 = 0.7;

/// Found over stated variance up to which values count as repeating.
const REPEATING: f64 = 1e-6;

/// Neighbours on each side by which an outlier is judged, and how many of them must agree with it.
const NEIGHBOURS: usize = 3;
const AGREEING: usize = 2;

/// Neighbours on each side that show the rate of fast wear.
const RATE_NEIGHBOURS: usize = 5;

/// Bounds of standard errors, and their value where none is stated.
pub(crate) struct Assumed {
    pub(crate) least: f64,
    pub(crate) largest: f64,
    /// The error where none is stated.
    pub(crate) unstated: f64,
    /// Number of differences that the stated errors count for.
    pub(crate) differences: f64,
}

/// Standard errors of some values in order.
#[derive(Debug, Clone)]
pub(crate) struct Noise {
    /// Standard errors with the scatter that was found.
    pub(crate) errors: Vec<f64>,
    /// Variance found over variance stated.
    pub(crate) factor: f64,
}

impl Noise {
    /// Rescales stated standard errors by the variance factor from successive differences (von Neumann 1941, with
    /// medians), (1.4826 · median |y(k+1) − y(k)| / √(se(k)² + se(k+1)²))².
    ///
    /// Where no error is stated (not a number, or zero), it is the median one. No error is less than half the median
    /// one: an unknown scatter between flights bounds the weight of a single flight.
    pub(crate) fn of(values: &[f64], stated: &[f64], assumed: &Assumed) -> Self {
        let is_stated = |error: &f64| error.is_finite() && *error > 0.0;
        let known: Vec<f64> = stated.iter().copied().filter(is_stated).collect();
        let typical = median(known).unwrap_or(assumed.unstated);
        let error = |stated: &f64| {
            let error = if is_stated(stated) { stated.max(0.5 * typical) } else { typical };
            // Not `clamp`, which panics if an implausible limit makes the least error the larger one.
            error.min(assumed.largest).max(assumed.least)
        };
        let mut errors: Vec<f64> = stated.iter().map(error).collect();
        let factor = factor(values, &errors, assumed.differences);
        let rounding = rounding(values);
        for error in &mut errors {
            *error = (factor.sqrt() * *error).max(rounding.min(*error)).max(assumed.least);
        }
        Self { errors, factor }
    }

    /// Whether each value agrees with at least two of its nearest neighbours, as it is or along the rate around it: it
    /// differs by at most `sds` standard deviations.
    ///
    /// The flights after a step agree with each other from the third on.
    pub(crate) fn are_sound(&self, values: &[f64], sds: f64) -> Vec<bool> {
        let is_agreeing = |at: usize, rate: f64| {
            let near = at.saturating_sub(NEIGHBOURS)..(at + 1 + NEIGHBOURS).min(values.len());
            let agrees = |other: &usize| {
                let moved = values[at] - values[*other] - rate * (at as f64 - *other as f64);
                let variance = self.errors[at].powi(2) + self.errors[*other].powi(2);
                moved * moved <= sds * sds * variance
            };
            near.filter(|other| *other != at && agrees(other)).nth(AGREEING - 1).is_some()
        };
        let is_sound = |at: usize| {
            values.len() <= AGREEING || is_agreeing(at, 0.0) || is_agreeing(at, local_rate(values, at))
        };
        (0..values.len()).map(is_sound).collect()
    }
}

/// Factor of the variance of a mean of many values, because neighbouring flights share errors; at least one. Of
/// values without outliers.
///
/// `usual` is assumed before any batch is seen.
pub(crate) fn inflation(values: &[f64], errors: &[f64], usual: f64) -> f64 {
    let (means, errors, seen) = batches(values, errors);
    let found = first_differences(&means, &errors, false).unwrap_or(0.0);
    ((seen * found + PRIOR_BATCHES * usual) / (seen + PRIOR_BATCHES)).clamp(1.0, MAX_INFLATION)
}

/// The inflation as far as chance in a few batches does not explain it.
pub(crate) fn certain_inflation(values: &[f64], errors: &[f64]) -> f64 {
    let (means, errors, seen) = batches(values, errors);
    let found = successive(&means, &errors).unwrap_or(0.0);
    (found / (1.0 + CERTAIN / seen.sqrt())).clamp(1.0, MAX_INFLATION)
}

/// Means of successive batches, with the errors that independent flights would give, and the number of their differences.
fn batches(values: &[f64], errors: &[f64]) -> (Vec<f64>, Vec<f64>, f64) {
    let mean = |(values, errors): (&[f64], &[f64])| {
        let weight: f64 = errors.iter().map(|error| error.powi(-2)).sum();
        let sum: f64 = values.iter().zip(errors).map(|(value, error)| value * error.powi(-2)).sum();
        (sum / weight, weight.recip().sqrt())
    };
    let (means, errors): (Vec<f64>, Vec<f64>) =
        values.chunks_exact(BATCH).zip(errors.chunks_exact(BATCH)).map(mean).unzip();
    let differences = means.len().saturating_sub(1) as f64;
    (means, errors, differences)
}

/// Standard error of values that are read in steps, the least step over √12; zero unless most values repeat the one before.
/// Their differences then show less scatter than the reading hides.
fn rounding(values: &[f64]) -> f64 {
    let steps = || values.array_windows().map(|[a, b]| (b - a).abs()).filter(|step| *step > 0.0);
    if 2 * steps().count() >= values.len() {
        0.0
    } else {
        steps().reduce(f64::min).unwrap_or(0.0) / 12_f64.sqrt()
    }
}

/// Found over stated variance from successive differences, drawn to one while they are few.
fn factor(values: &[f64], errors: &[f64], prior: f64) -> f64 {
    // Values without trusted errors hold no wear whose rate could change: the larger estimate is the safer one.
    let found =
        if prior > 0.0 { successive(values, errors) } else { first_differences(values, errors, false) };
    let Some(mut found) = found else { return 1.0 };
    let count = values.len() as f64 - 1.0;
    if values.len() <= FEW && prior > 0.0 {
        found = found.min(MOST_OF_FEW);
    }
    // A common factor of the stated errors is limited; values that repeat, but for rounding, carry no information about it.
    let stated = if found > REPEATING { (100.0 * found).min(1.0) } else { 1.0 };
    ((found * count + prior * stated) / (count + prior)).max(0.05 * stated)
}

/// Found over stated variance from successive differences, or from second ones where the rate changes; none of a single
/// value.
fn successive(values: &[f64], errors: &[f64]) -> Option<f64> {
    let found = first_differences(values, errors, true)?;
    let windows = values.array_windows().zip(errors.array_windows());
    let bend = |([a, b, c], [ea, eb, ec]): (&[f64; 3], &[f64; 3])| {
        (a - 2.0 * b + c).abs() / (ea * ea + 4.0 * eb * eb + ec * ec).sqrt()
    };
    let bent = median(windows.map(bend).collect()).map(|middle| (SD_OVER_MAD * middle).powi(2));
    Some(bent.filter(|bent| *bent < CHANGING_RATE * found).unwrap_or(found))
}

/// The same from first differences, less their median where they are centred: wear moves all differences equally, and is
/// no noise.
fn first_differences(values: &[f64], errors: &[f64], is_centred: bool) -> Option<f64> {
    let windows = values.array_windows().zip(errors.array_windows());
    let mut ratios: Vec<f64> = windows.map(|([a, b], [ea, eb])| (b - a) / ea.hypot(*eb)).collect();
    let middle = if is_centred { median(ratios.clone())? } else { 0.0 };
    ratios.iter_mut().for_each(|ratio| *ratio = (*ratio - middle).abs());
    Some((SD_OVER_MAD * median(ratios)?).powi(2))
}

/// Change from one flight to the next around a value: the median of pairwise slopes (Theil 1950) of near flights, few of
/// which lie on both sides of a step.
fn local_rate(values: &[f64], at: usize) -> f64 {
    let near = &values[at.saturating_sub(RATE_NEIGHBOURS)..(at + 1 + RATE_NEIGHBOURS).min(values.len())];
    let apart = |k: usize| near.iter().zip(&near[k..]).map(move |(a, b)| (b - a) / k as f64);
    let slopes: Vec<f64> = (1..=NEIGHBOURS.min(near.len() - 1)).flat_map(apart).collect();
    median(slopes).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Eight neighbours share one normal error of the stated size: a batch mean varies by 1, not by 1/8.
    #[test]
    fn errors_that_neighbours_share_inflate_the_variance_of_means() {
        let mut state = 1_u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        let errors: Vec<f64> = (0..8000).map(|_| (0..12).map(|_| uniform()).sum::<f64>() - 6.0).collect();
        let shared: Vec<f64> = (0..8000).map(|k| errors[k / BATCH]).collect();
        let found = |values: &[f64]| certain_inflation(values, &vec![1.0; values.len()]);
        assert!(found(&shared) > 4.0 && found(&errors) < 1.1, "{} {}", found(&shared), found(&errors));
    }
}
