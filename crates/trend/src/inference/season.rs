//! Seasonal component of the measurement: one phase for a part number's fleet, an amplitude for each unit.
//!
//! Grease stiffens in winter and the gap reads differently. Against a growth of a few micrometres a
//! year an amplitude of one is an error of tens of per cent in the rate, so it is fitted with the wear and
//! not left to the noise.

use std::f64::consts::TAU;

use crate::data::bins::{self, Bin, Segment};
use crate::inference::level_filter::Pass;
use crate::inference::posterior::Posterior;
use crate::inference::segment_fit::{SegmentFit, linear_growth};
use crate::prior::{FleetPrior, PSEUDO_SD, SeasonParams, YEAR_US};

/// Weight of the assumption of no seasonal component, in units.
const PSEUDO_UNITS: f64 = 4.0;

/// Spread of the units' amplitudes while their mean is sought, a share of the limit.
const UNIT_SPREAD: f64 = 0.005;

/// Standard errors (root mean square of both components) from which the mean amplitude of a fleet is used.
const BELIEVED: f64 = 3.0;

/// One unit's cosine and sine amplitudes, and their covariance (xx, xy, yy).
#[derive(Debug, Clone, Copy)]
pub(crate) struct SeasonalFit {
    pub(crate) amplitude_m: [f64; 2],
    pub(crate) covariance_m2: [f64; 3],
}

pub(crate) fn waves(departure_us: f64) -> [f64; 2] {
    let (sin, cos) = (TAU * departure_us / YEAR_US).sin_cos();
    [cos, sin]
}

/// Learns phase and amplitude from the fits of the units, each weighted by its error and the spread among units.
pub(crate) fn learn_season(seasonal_fits: &[SeasonalFit], limit_m: f64) -> SeasonParams {
    let spread_m2 = (UNIT_SPREAD * limit_m).powi(2);
    let mean = |component: usize, variance: usize| {
        let weights = seasonal_fits
            .iter()
            .map(|s| (s.amplitude_m[component], 1.0 / (s.covariance_m2[variance] + spread_m2)));
        let (sum, total) = weights.fold((0.0, 0.0), |(sum, total), (x, w)| (sum + w * x, total + w));
        if total > 0.0 { (sum / total, 1.0 / total) } else { (0.0, f64::INFINITY) }
    };
    let ((x, x_m2), (y, y_m2)) = (mean(0, 0), mean(1, 2));
    // The mean amplitude is zero unless the seasonal component is significant.
    let believed = x * x / x_m2 + y * y / y_m2 > 2.0 * BELIEVED * BELIEVED;
    let phase = if believed { y.atan2(x) } else { 0.0 };
    let (c, s) = (phase.cos(), phase.sin());
    let along: Vec<(f64, f64)> = seasonal_fits
        .iter()
        .map(|w| {
            let [xx, xy, yy] = w.covariance_m2;
            (c * w.amplitude_m[0] + s * w.amplitude_m[1], c * c * xx + 2.0 * c * s * xy + s * s * yy)
        })
        .collect();
    // Mean and spread by expectation–maximisation.
    let pseudo_m = PSEUDO_SD * limit_m;
    let (mut mean_m, mut sd_m) = (0.0, pseudo_m);
    for _ in 0..30 {
        let (mut sum, mut squares, mut count) = (0.0, PSEUDO_UNITS * pseudo_m.powi(2), PSEUDO_UNITS);
        for &(amplitude_m, error_m2) in &along {
            let share = sd_m * sd_m / (sd_m * sd_m + error_m2);
            let own = mean_m + share * (amplitude_m - mean_m);
            sum += own;
            squares += (own - mean_m).powi(2) + share * error_m2;
            count += 1.0;
        }
        mean_m = if believed { sum / count } else { 0.0 };
        sd_m = (squares / count).sqrt();
    }
    SeasonParams { phase, mean_m, sd_m }
}

/// The seasonal amplitude in one segment, fitted with wear of the most probable form; nothing where the two are
/// not separable, as in less than half a year.
pub(crate) fn seasonal_fit(
    segment: &Segment<'_>,
    prior: &FleetPrior,
    posterior: &Posterior,
) -> Option<SeasonalFit> {
    let seen_us =
        segment.estimates.last()?.departure_us.saturating_sub(segment.estimates.first()?.departure_us);
    if (seen_us as f64) < 0.5 * YEAR_US {
        return None;
    }
    let best = posterior.components.iter().max_by(|a, b| a.weight.total_cmp(&b.weight))?;
    let bins = bins::bin(segment.estimates, bins::BINS);
    let value = |b: &Bin| best.law.value(best.age_begin + b.usage - segment.begin);
    let sequences: [Vec<f64>; 3] = [
        bins.iter().map(value).collect(),
        bins.iter().map(|b| waves(b.departure_us)[0]).collect(),
        bins.iter().map(|b| waves(b.departure_us)[1]).collect(),
    ];
    let span = segment.now - segment.begin;
    let grown_m = linear_growth(&bins);
    let SegmentFit { filter, gaps, .. } =
        SegmentFit::new(segment, prior, bins, |usage| grown_m * usage / span);
    let [wear, cos, sin] = sequences.each_ref().map(|s| filter.pass(s.iter().copied()));
    let against = |other: &Pass, own: &[f64]| filter.regress(&gaps, other, own);
    let (w, c, s) =
        (against(&cos, &sequences[0]), against(&sin, &sequences[1]), against(&wear, &sequences[2]));
    let free = if w.sff > 0.0 { 1.0 / w.sff } else { 0.0 };
    let (xx, xy, yy) =
        (c.sff - free * w.sfs * w.sfs, c.sfs - free * w.sfs * s.sfs, s.sff - free * s.sfs * s.sfs);
    let (x, y) = (c.sfy - free * w.sfs * w.sfy, s.sfy - free * s.sfs * w.sfy);
    let determinant = xx * yy - xy * xy;
    (determinant > 1e-9 * xx * yy && xx > 0.0).then(|| SeasonalFit {
        amplitude_m: [(yy * x - xy * y) / determinant, (xx * y - xy * x) / determinant],
        covariance_m2: [yy / determinant, -xy / determinant, xx / determinant],
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Quarters of a year from 1970-01-01: cosine and sine of 0, π/2, π and 3π/2.
    #[test]
    fn the_waves_have_a_period_of_one_year() {
        for (quarter, [cos, sin]) in
            [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0], [1.0, 0.0]].iter().enumerate()
        {
            let found = waves(quarter as f64 * 365.25 / 4.0 * 86_400e6);
            assert!((found[0] - cos).abs() < 1e-3 && (found[1] - sin).abs() < 1e-3, "{quarter}: {found:?}");
        }
    }
}
