//! A unit's estimates made ready: outliers marked, and how large the scatter really is.

use crate::data::series::{Flight, Gap};
use crate::math::median::{SD_OVER_MAD, median};

/// Residuals beyond this many standard deviations are outliers.
const OUTLIER_SIGMA: f64 = 4.0;

/// Flights of the running median.
const WINDOW: usize = 11;

/// Flights on one side of a gap that vouch for it.
const SIDE: usize = WINDOW / 2;

/// Standard errors are taken to lie between these, shares of the limit: their squares must be numbers to
/// reckon with.
const LEAST_ERROR: f64 = 1e-5;
const LARGEST_ERROR: f64 = 1e4;

/// The error of gaps that state none, a share of the limit, which the noise factor corrects.
const UNSTATED_ERROR: f64 = 0.01;

/// One estimate that takes part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct WeightedGap {
    /// Index of its flight.
    pub(crate) flight: usize,
    pub(crate) installation: u32,
    pub(crate) departure_us: i64,
    /// Usage at its end: hours flown, until an axis is chosen.
    pub(crate) usage: f64,
    pub(crate) gap_m: f64,
    /// 1/σ², with the scatter that was found and not the one that was stated.
    pub(crate) weight: f64,
}

/// The estimates that take part, those that do not, and the noise found.
#[derive(Debug, Clone)]
pub(crate) struct CleanedSeries {
    pub(crate) estimates: Vec<WeightedGap>,
    /// Flights whose gap is an outlier.
    pub(crate) outliers: Vec<usize>,
    /// Variance found over variance stated.
    pub(crate) noise_factor: f64,
}

/// Marks outliers against the median of their neighbours and rescales the stated standard errors.
///
/// The factor is the variance factor from successive differences,
/// (1.4826 · median |y(k+1) − y(k)| / √(se(k)² + se(k+1)²))². Errors that are missing, or far too small for their
/// neighbours, count as the unit's median one.
pub(crate) fn mark_outliers(flights: &[Flight], limit_m: f64) -> CleanedSeries {
    let stated: Vec<(usize, Gap)> =
        flights.iter().enumerate().filter_map(|(i, f)| Some((i, f.gap?))).collect();
    let gaps: Vec<f64> = stated.iter().map(|(_, gap)| gap.gap_m).collect();
    let (errors, noise_factor) = errors(&stated.iter().map(|(_, gap)| *gap).collect::<Vec<_>>(), limit_m);
    let mut cleaned =
        CleanedSeries { estimates: Vec::with_capacity(gaps.len()), outliers: Vec::new(), noise_factor };
    for (k, &(flight, _)) in stated.iter().enumerate() {
        let variance = errors[k] * errors[k];
        if is_outlier(&gaps, k, variance) {
            cleaned.outliers.push(flight);
        } else {
            cleaned.estimates.push(estimate(flights, flight, gaps[k], variance));
        }
    }
    cleaned
}

/// Standard errors of some gaps in order, with the scatter that was found, m, and the factor of their variances.
pub(crate) fn errors(gaps: &[Gap], limit_m: f64) -> (Vec<f64>, f64) {
    let typical_m = typical_error(gaps, limit_m);
    let mut errors: Vec<f64> = gaps.iter().map(|gap| error(*gap, typical_m, limit_m)).collect();
    let values: Vec<f64> = gaps.iter().map(|gap| gap.gap_m).collect();
    let factor = noise_factor(&values, &errors);
    for error in &mut errors {
        *error = (factor.sqrt() * *error).max(LEAST_ERROR * limit_m);
    }
    (errors, factor)
}

/// Whether a gap is far from the level of its neighbours, with or without wear.
fn is_outlier(gaps: &[f64], at: usize, variance: f64) -> bool {
    let reach_m = OUTLIER_SIGMA * variance.sqrt();
    is_far_from_median(gaps, at, reach_m)
        && (gaps[at] - on_local_line(gaps, at)).abs() > reach_m
        && !continues_one_side(gaps, at, reach_m)
}

/// Whether a gap continues the line of the five before it, or of the five after it: next to a step a line through
/// both sides is no guide, and the flights next to the step are not outliers.
fn continues_one_side(gaps: &[f64], at: usize, reach_m: f64) -> bool {
    let before = at.checked_sub(SIDE).map(|from| on_line(&gaps[from..at], SIDE as f64));
    let after = gaps.get(at + 1..=at + SIDE).map(|window| on_line(window, -1.0));
    [before, after].into_iter().flatten().any(|line_m| (gaps[at] - line_m).abs() <= reach_m)
}

/// Whether a value lies further than this from the median of the eleven around it, of the nearest eleven at
/// the ends: most of them lie further below it, or above. To count them costs less than to order them.
fn is_far_from_median(values: &[f64], at: usize, reach: f64) -> bool {
    let (_, window) = window(values, at);
    let (low, high) = (values[at] - reach, values[at] + reach);
    let (mut below, mut above) = (0, 0);
    for value in window {
        below += usize::from(*value < low);
        above += usize::from(*value > high);
    }
    below > window.len() / 2 || above >= window.len().div_ceil(2)
}

/// The eleven values around one, the nearest eleven at the ends, and the place of their first.
fn window(values: &[f64], at: usize) -> (usize, &[f64]) {
    let width = WINDOW.min(values.len());
    let first = at.saturating_sub(width / 2).min(values.len() - width);
    (first, &values[first..first + width])
}

fn estimate(flights: &[Flight], flight: usize, gap_m: f64, variance: f64) -> WeightedGap {
    let Flight { installation, departure_us, hours: usage, .. } = flights[flight];
    WeightedGap { flight, installation, departure_us, usage, gap_m, weight: variance.recip() }
}

/// The median stated error; where nothing is stated, a share of the limit.
fn typical_error(stated: &[Gap], limit_m: f64) -> f64 {
    let mut errors: Vec<f64> = stated.iter().map(|gap| gap.se_m).filter(|se| se.is_finite()).collect();
    median(&mut errors).unwrap_or(UNSTATED_ERROR * limit_m)
}

/// Standard error of a gap, at least half the typical one: an unknown between-flight scatter
/// bounds the weight of a single flight.
fn error(gap: Gap, typical_m: f64, limit_m: f64) -> f64 {
    let stated_m = if gap.se_m.is_finite() { gap.se_m.max(0.5 * typical_m) } else { typical_m };
    stated_m.clamp(LEAST_ERROR * limit_m, LARGEST_ERROR * limit_m)
}

/// Found over stated variance from successive differences, drawn to one while they are few.
fn noise_factor(gaps: &[f64], errors: &[f64]) -> f64 {
    const PRIOR_COUNT: f64 = 4.0;
    /// Differences below which a jump among them may pass for noise, and the most that they are believed.
    const FEW: usize = 9;
    const MOST_OF_FEW: f64 = 4.0;
    /// Second differences are taken for the noise where they show so much less of it: the rate changes.
    const CHANGING_RATE: f64 = 0.7;
    let first = gaps.array_windows().zip(errors.array_windows());
    let mut ratios: Vec<f64> = first.map(|([a, b], [ea, eb])| (b - a) / ea.hypot(*eb)).collect();
    let count = ratios.len() as f64;
    // Wear that shows from one flight to the next is no noise: it moves all differences equally.
    let Some(wear) = median(&mut ratios) else { return 1.0 };
    ratios.iter_mut().for_each(|ratio| *ratio = (*ratio - wear).abs());
    let mut found = scatter(ratios);
    let second = gaps.array_windows().zip(errors.array_windows());
    let bends: Vec<f64> = second
        .map(|([a, b, c], [ea, eb, ec])| (a - 2.0 * b + c).abs() / (ea * ea + 4.0 * eb * eb + ec * ec).sqrt())
        .collect();
    if !bends.is_empty() {
        let bent = scatter(bends);
        found = if bent < CHANGING_RATE * found { bent } else { found };
    }
    if gaps.len() <= FEW {
        found = found.min(MOST_OF_FEW);
    }
    // A common factor of the stated errors is limited; exactly repeating gaps carry no information about it.
    let stated = if found > 0.0 { (100.0 * found).min(1.0) } else { 1.0 };
    ((found * count + PRIOR_COUNT * stated) / (count + PRIOR_COUNT)).max(0.05 * stated)
}

/// Variance of normal deviates by the median of their amounts.
fn scatter(mut amounts: Vec<f64>) -> f64 {
    median(&mut amounts).map_or(0.0, |middle| (SD_OVER_MAD * middle).powi(2))
}

/// Level of a flight from its neighbours under even wear: the median of their pairwise
/// slopes through the median of their levels (Theil 1950).
///
/// A running median lags behind a unit that wears fast, most of all at the ends of its history, and
/// would mark its wear as outliers. This line is computed only there.
fn on_local_line(gaps: &[f64], at: usize) -> f64 {
    let (first, window) = window(gaps, at);
    on_line(window, (at - first) as f64)
}

/// The median of pairwise slopes through the median of the levels of eleven values at most, at a place counted
/// from their first.
fn on_line(window: &[f64], at: f64) -> f64 {
    let width = window.len();
    if width < 2 {
        return window[0];
    }
    let mut slopes = [0.0; WINDOW * (WINDOW - 1) / 2];
    let mut count = 0;
    for apart in 1..width {
        let per_flight = (apart as f64).recip();
        for (earlier, later) in window.iter().zip(&window[apart..]) {
            slopes[count] = (later - earlier) * per_flight;
            count += 1;
        }
    }
    let slope = median(&mut slopes[..count]).unwrap_or_default();
    let mut levels = [0.0; WINDOW];
    for (k, (level, gap)) in levels.iter_mut().zip(window).enumerate() {
        *level = gap - slope * k as f64;
    }
    median(&mut levels[..width]).unwrap_or_default() + slope * at
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flights(gaps_um: &[f64]) -> Vec<Flight> {
        let flight = |(k, um): (usize, &f64)| Flight {
            departure_us: k as i64,
            installation: 0,
            hours: k as f64,
            flights: k as f64,
            reversals: 0.0,
            gap: Some(Gap { gap_m: um * 1e-6, se_m: 0.3e-6, is_doubtful: false }),
        };
        gaps_um.iter().enumerate().map(flight).collect()
    }

    const WIGGLE_UM: [f64; 10] = [0.2, -0.3, 0.1, 0.3, -0.2, 0.0, -0.1, 0.3, -0.3, 0.1];

    fn wearing(flights: usize, um_per_flight: f64) -> Vec<f64> {
        (0..flights).map(|k| 60.0 + um_per_flight * k as f64 + WIGGLE_UM[k * 7 % 10]).collect()
    }

    /// Three micrometres a flight at a third of one of noise: wear, all of it.
    #[test]
    fn a_unit_that_wears_fast_is_no_row_of_outliers() {
        let found = mark_outliers(&flights(&wearing(10, 3.0)), 1e-4);
        assert!(found.outliers.is_empty(), "{:?}", found.outliers);
        assert!(found.noise_factor < 3.0, "{}", found.noise_factor);
    }

    /// Against the definition: every window sorted.
    #[test]
    fn a_value_is_far_from_the_median_as_the_sorted_window_has_it() {
        for length in [1, 2, 7, 10, 11, 200] {
            let values: Vec<f64> = (0..length).map(|k| f64::from(k * k * 37 % 101) - 50.0).collect();
            for at in 0..values.len() {
                let width = WINDOW.min(values.len());
                let first = at.saturating_sub(width / 2).min(values.len() - width);
                let mut window = values[first..first + width].to_vec();
                window.sort_by(f64::total_cmp);
                let apart = (values[at] - window[width / 2]).abs();
                for reach in [5.5, 20.5, 45.5] {
                    assert_eq!(is_far_from_median(&values, at, reach), apart > reach, "{at} of {length}");
                }
            }
        }
    }
}
