//! Interval calibration: errors of past forecasts, compared with later measurements.
//!
//! No unit needs to have failed for this. Each history is cut, assessed with the data before the cut,
//! and its gap is forecast at the end. The error is counted in widths of the forecast, so the calibration
//! applies to time as well as to growth: where the true law is not in the bank, intervals widen to the
//! observed errors, and shift to the side of the errors.

use crate::data::bins::{self, BINS};
use crate::data::segment::Segment;
use crate::executor::Executor;
use crate::inference::posterior::{Component, Posterior, posterior};
use crate::math::quadrature::{GAUSS_HERMITE_5, WAIT_QUANTILES};
use crate::math::weighted::WeightedSamples;
use crate::prior::calibration_params::{CalibrationParams, USUAL_WIDTH};
use crate::prior::fleet_prior::FleetPrior;

/// Shares of a history that are taken for all there is.
const CUTS: [f64; 3] = [0.3, 0.5, 0.7];

/// Estimates below which a history is not cut.
const MIN_ESTIMATES: usize = 60;

/// Forecast growth below which a cut carries no information on wear, a share of the limit.
const VISIBLE: f64 = 0.03;

/// Cuts that the usual miss is worth: enough that thirty units may outvote it.
const PSEUDO_CUTS: f64 = 20.0;

/// Learns the interval widths from every cut of some segments.
pub(crate) fn learn_calibration(
    segments: &[Segment<'_>],
    prior: &FleetPrior,
    executor: &impl Executor,
) -> CalibrationParams {
    let usual = CalibrationParams::USUAL;
    let errors = executor.map(segments, |segment| CUTS.map(|share| normalised_error(segment, share, prior)));
    let errors: Vec<(f64, f64)> = errors.into_iter().flatten().flatten().map(|error| (error, 1.0)).collect();
    let scored = errors.len();
    let pseudo = LONG_QUANTILES.map(|z| (USUAL_WIDTH * z, PSEUDO_CUTS / LONG_QUANTILES.len() as f64));
    let errors = WeightedSamples::new(errors.into_iter().chain(pseudo));
    let [low, middle, high] = [0.05, 0.5, 0.95].map(|share| errors.quantile(share));
    debug_assert!(low <= middle && middle <= high, "quantiles {low}, {middle}, {high}");
    CalibrationParams { low: low.min(usual.low), middle, high: high.max(usual.high), scored }
}

/// Quantiles at 2.5 %, 7.5 % … 97.5 % of a normal distribution whose 95 % bound is at one.
const LONG_QUANTILES: [f64; 20] = [
    -1.192, -0.875, -0.699, -0.568, -0.459, -0.363, -0.276, -0.194, -0.115, -0.038, 0.038, 0.115, 0.194,
    0.276, 0.363, 0.459, 0.568, 0.699, 0.875, 1.192,
];

/// Normalised forecast error: the gap at a segment's end minus its forecast from the first estimates, in widths.
fn normalised_error(segment: &Segment<'_>, share: f64, prior: &FleetPrior) -> Option<f64> {
    let count = segment.estimates.len();
    if count < MIN_ESTIMATES {
        return None;
    }
    let seen = &segment.estimates[..(share * count as f64) as usize];
    let now = seen.last()?.usage;
    let fitted = posterior(&Segment { estimates: seen, now, ..*segment }, prior)?;
    let end = bins::bin(segment.estimates, BINS).pop()?;
    let moved = f64::from(u8::from(seen.last()?.installation != end.installation));
    let variance_m2 = end.variance_m2 + 2.0 * moved * prior.bias_sd_m.powi(2);
    let [low_m, middle_m, high_m] = forecast_quantiles(&fitted, end.usage - now, variance_m2, prior);
    let level_m: f64 = fitted.components.iter().map(|n| n.weight * n.level_m).sum();
    let off_m = end.gap_m - middle_m;
    let width_m = if off_m > 0.0 { high_m - middle_m } else { middle_m - low_m };
    (middle_m - level_m > VISIBLE * prior.limit_m() && width_m > 0.0).then(|| off_m / width_m)
}

/// 5 %, 50 % and 95 % bounds of the gap after more usage, as measured with some variance.
pub(crate) fn forecast_quantiles(
    fitted: &Posterior,
    usage: f64,
    variance_m2: f64,
    prior: &FleetPrior,
) -> [f64; 3] {
    let mut points = Vec::with_capacity(GAUSS_HERMITE_5.len() * fitted.components.len() / 2);
    let mut add = |component: &Component, grown_m: f64, share: f64| {
        let sd_m = (fitted.level_m2 + variance_m2 + prior.wear_noise_m * grown_m).sqrt();
        let point = |(z, weight): (f64, f64)| {
            (component.level_m + grown_m + z * sd_m, component.weight * share * weight)
        };
        points.extend(GAUSS_HERMITE_5.map(point));
    };
    for component in fitted.significant_components() {
        if component.onset_pending {
            let rate = prior.span_m / component.ln_life.exp();
            for wait in prior.onset_wait_quantiles() {
                add(component, rate * (usage - wait).max(0.0), 1.0 / WAIT_QUANTILES as f64);
            }
        } else {
            let grown =
                component.law.value(component.age_now + usage) - component.law.value(component.age_now);
            add(component, component.amplitude_m * grown, 1.0);
        }
    }
    let points = WeightedSamples::new(points.into_iter());
    [0.05, 0.5, 0.95].map(|share| points.quantile(share))
}
