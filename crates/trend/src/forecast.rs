//! Plotted forecast of an assessment: smoothed past levels, and quantiles of the future gap.

use crate::data::bins::{self, BINS, Bin};
use crate::data::segment::Segment;
use crate::data::series::Series;
use crate::error::Error;
use crate::incremental::snapshot::UnitSnapshot;
use crate::inference::consistency::fit_consistent;
use crate::inference::posterior::{Posterior, mean_growth};
use crate::inference::segment_fit::process_variance;
use crate::learning::calibrate::forecast_quantiles;
use crate::math::distributions::NORMAL_95;
use crate::prior::calibration_params::CalibrationParams;
use crate::prior::fleet_prior::FleetPrior;
use crate::settings::Settings;
use crate::statement::history;
use crate::statement::types::MIN_ESTIMATES;

/// A gap and its 90 % interval, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interval {
    /// 5 % bound.
    pub p05_m: f64,
    /// The middle.
    pub m: f64,
    /// 95 % bound.
    pub p95_m: f64,
}

/// Past levels and forecast of an assessment, for plots. Offsets of the measurement are removed, as
/// they are in the assessed gap.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Forecast {
    /// The smoothed level at mean departures of neighbouring flights, microseconds since 1970 UTC.
    pub past: Vec<(i64, Interval)>,
    /// Gap after a number of further flight hours.
    pub ahead: Vec<(f64, Interval)>,
}

/// Past levels and forecast of an assessment: the level through each segment's flights by a fixed-interval smoother
/// (Rauch, Tung and Striebel 1965, <https://doi.org/10.2514/3.3166>), m, and the 5, 50 and 95 % quantiles of the gap, m,
/// after more `hours`, flight hours, from the same mixture and calibration as the crossing.
///
/// Empty for a unit with too few estimates for an assessment.
///
/// # Errors
/// As [`crate::assess()`].
pub fn forecast(
    series: &Series,
    as_of_us: i64,
    settings: &Settings,
    prior: Option<&FleetPrior>,
    hours: impl IntoIterator<Item = f64>,
) -> Result<Forecast, Error> {
    settings.check()?;
    let uninformative = FleetPrior::uninformative(settings.limit_m);
    let prior = prior.unwrap_or(&uninformative);
    let flights = series.flights_until(as_of_us);
    let history = history::read_history(
        flights,
        series.maintenance_until(as_of_us),
        series.unit_hours_at_start(),
        prior,
    );
    if history.estimates.len() < MIN_ESTIMATES {
        return Ok(Forecast::default());
    }
    let single_unit = prior.single_unit();
    let (snapshot, current) = UnitSnapshot::current(series, as_of_us, prior);
    let mut past = Vec::new();
    let mut segments = history.segments().peekable();
    while let Some(segment) = segments.next() {
        // The last one as it was stated.
        let fitted = if segments.peek().is_none() {
            current.fitted().map(|(posterior, is_single_unit)| (posterior.clone(), is_single_unit))
        } else {
            let fitted = fit_consistent(&segment, prior, &single_unit, history.offset_m2).ok();
            fitted.map(|fitted| (fitted.posterior, fitted.is_single_unit))
        };
        let prior = |is_single_unit: bool| if is_single_unit { &single_unit } else { prior };
        past.extend(
            fitted.iter().flat_map(|(on, is_single_unit)| levels(&segment, on, prior(*is_single_unit))),
        );
    }
    let Some((fitted, is_single_unit)) = current.fitted() else {
        return Ok(Forecast { past, ahead: Vec::new() });
    };
    let prior = if is_single_unit { &single_unit } else { prior };
    let ratio = snapshot.hours_per_usage(prior);
    let variance_m2 = history.offset_m2 + history.kind_m2 + prior.bias_sd_m.powi(2);
    let after = |hours: f64| {
        let [p05_m, m, p95_m] = forecast_quantiles(fitted, hours / ratio, variance_m2, prior);
        let band = Interval { p05_m, m, p95_m };
        (hours, if hours > 0.0 { band.calibrated(prior.calibration) } else { band })
    };
    Ok(Forecast { past, ahead: hours.into_iter().map(after).collect() })
}

impl Interval {
    /// The band in the widths that the fleet's past was found to need.
    fn calibrated(self, CalibrationParams { low, middle, high }: CalibrationParams) -> Self {
        let at =
            |width: f64| self.m + width * if width > 0.0 { self.p95_m - self.m } else { self.m - self.p05_m };
        let interval = Self { p05_m: at(low), m: at(middle), p95_m: at(high) };
        debug_assert!([interval.p05_m, interval.m, interval.p95_m].is_sorted(), "{interval:?}");
        interval
    }
}

/// The level at each bin of a segment: the mean curve plus a smoothed random walk.
fn levels(segment: &Segment<'_>, fitted: &Posterior, prior: &FleetPrior) -> Vec<(i64, Interval)> {
    let bins = bins::bin(segment.estimates, BINS);
    let grown_m = |usage: f64| mean_growth(&fitted.components, usage);
    let curve_m: Vec<f64> = bins.iter().map(|b| grown_m(b.usage - segment.begin)).collect();
    let residual_m = bins
        .iter()
        .zip(&curve_m)
        .map(|(b, curve_m)| b.gap_m - prior.season.mean_m * prior.season.wave(b.departure_us) - curve_m);
    let smooth = smoothed(&bins, residual_m, &process_variance(&bins, segment.begin, prior, grown_m));
    let level = |((bin, curve_m), (residual_m, variance_m2)): ((&Bin, &f64), (f64, f64))| {
        let (m, half_m) = (curve_m + residual_m, NORMAL_95 * (variance_m2 + prior.bias_sd_m.powi(2)).sqrt());
        (bin.departure_us as i64, Interval { p05_m: m - half_m, m, p95_m: m + half_m })
    };
    bins.iter().zip(&curve_m).zip(smooth).map(level).collect()
}

/// A walking level measured with noise: mean and variance at each bin, all bins known
/// (Rauch, Tung and Striebel 1965).
fn smoothed(bins: &[Bin], values_m: impl Iterator<Item = f64>, walk_m2: &[f64]) -> Vec<(f64, f64)> {
    let mut filtered: Vec<(f64, f64)> = Vec::with_capacity(bins.len());
    for ((bin, value_m), walk_m2) in bins.iter().zip(values_m).zip(walk_m2) {
        let next = filtered.last().map_or((value_m, bin.variance_m2), |(mean_m, variance_m2)| {
            let before_m2 = variance_m2 + walk_m2;
            let gain = before_m2 / (before_m2 + bin.variance_m2);
            (mean_m + gain * (value_m - mean_m), (1.0 - gain) * before_m2)
        });
        filtered.push(next);
    }
    for i in (1..filtered.len()).rev() {
        let ((later_m, later_m2), (mean_m, variance_m2)) = (filtered[i], filtered[i - 1]);
        let before_m2 = variance_m2 + walk_m2[i];
        let share = variance_m2 / before_m2;
        filtered[i - 1] =
            (mean_m + share * (later_m - mean_m), variance_m2 + share * share * (later_m2 - before_m2));
    }
    filtered
}
