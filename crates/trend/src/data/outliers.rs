//! A unit's estimates made ready: outliers marked, and weights with the scatter that was found.

use crate::data::noise::{Assumed, Noise, certain_inflation};
use crate::data::series::{Flight, Gap};

/// Least and largest standard error, shares of the limit: their squares must neither vanish nor overflow.
const LEAST_ERROR: f64 = 1e-5;
const LARGEST_ERROR: f64 = 1e4;

/// The error of gaps that state none, a share of the limit, which the noise factor corrects.
const UNSTATED_ERROR: f64 = 0.01;

/// Standard deviations by which two gaps that agree differ at most.
const AGREEMENT_SDS: f64 = 2.4;

/// Differences of successive gaps that the stated errors count for.
const STATED_COUNT: f64 = 4.0;

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct WeightedGap {
    pub(crate) flight: usize,
    pub(crate) installation: u32,
    pub(crate) departure_us: i64,
    /// Usage at its end: hours flown, until an axis is chosen.
    pub(crate) usage: f64,
    pub(crate) gap_m: f64,
    /// 1/σ², with the scatter that was found and not the one that was stated, and with what neighbours share.
    pub(crate) weight: f64,
}

/// The estimates that agree with their neighbours, the flights whose gap does not, and variance found over stated.
///
/// The weights follow from the standard errors with the scatter that was found.
pub(crate) fn mark_outliers(flights: &[Flight], limit_m: f64) -> (Vec<WeightedGap>, Vec<usize>, f64) {
    let measured = flights.iter().enumerate().filter_map(|(i, f)| Some((i, f.gap?)));
    let (measured, gaps): (Vec<usize>, Vec<Gap>) = measured.unzip();
    let noise = noise(&gaps, limit_m);
    let gaps_m: Vec<f64> = gaps.iter().map(|gap| gap.gap_m).collect();
    let are_sound = noise.are_sound(&gaps_m, AGREEMENT_SDS);
    let (sound, outliers): (Vec<usize>, Vec<usize>) = (0..gaps.len()).partition(|k| are_sound[*k]);
    let estimate = |k: &usize| {
        let (flight, gap_m, weight) = (measured[*k], gaps_m[*k], noise.errors[*k].powi(-2));
        let Flight { installation, departure_us, hours: usage, .. } = flights[flight];
        WeightedGap { flight, installation, departure_us, usage, gap_m, weight }
    };
    let mut estimates: Vec<WeightedGap> = sound.iter().map(estimate).collect();
    let outliers = outliers.into_iter().map(|k| measured[k]).collect();
    let (sound, errors): (Vec<f64>, Vec<f64>) = sound.iter().map(|k| (gaps_m[*k], noise.errors[*k])).unzip();
    let inflation = certain_inflation(&sound, &errors);
    estimates.iter_mut().for_each(|estimate| estimate.weight /= inflation);
    (estimates, outliers, noise.factor)
}

/// Standard errors of some gaps in order, with the scatter that was found, m.
pub(crate) fn noise(gaps: &[Gap], limit_m: f64) -> Noise {
    let values: Vec<f64> = gaps.iter().map(|gap| gap.gap_m).collect();
    let stated: Vec<f64> = gaps.iter().map(|gap| gap.se_m).collect();
    let assumed = Assumed {
        least: LEAST_ERROR * limit_m,
        largest: LARGEST_ERROR * limit_m,
        unstated: UNSTATED_ERROR * limit_m,
        differences: STATED_COUNT,
    };
    Noise::of(&values, &stated, &assumed)
}
