//! Plotted forecast of an assessment: smoothed past levels, and quantiles of the future gap.

use crate::data::bins::{self, BINS, Bin, Segment};
use crate::data::series::Series;
use crate::error::Error;
use crate::inference::posterior::{Posterior, mean_growth};
use crate::inference::segment_fit::process_variance;
use crate::math::NORMAL_95;
use crate::measured::record::Record;
use crate::prior::FleetPrior;
use crate::settings::Settings;
use crate::statement::crossing::GapsAhead;
use crate::unit_fit::{Fit, UnitFit};

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
/// after more `hours`, flight hours, from the same mixture and widened as the crossing is.
///
/// Empty ahead for a unit whose records neither a wear law nor a line explains.
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
    let unit = UnitFit::new(series, as_of_us, settings, prior)?;
    let mut past = Vec::new();
    for (segment, fitted) in unit.history.segments().zip(&unit.ended) {
        past.extend(fitted.iter().flat_map(|posterior| levels(&segment, posterior, &unit.prior)));
    }
    let Some(Fit { posterior, prior, .. }) = &unit.fit else {
        return Ok(Forecast { past, ahead: line_ahead(&unit, hours) });
    };
    let on_axis = unit.history.clone().on_axis(prior);
    past.extend(on_axis.segments().last().iter().flat_map(|segment| levels(segment, posterior, prior)));
    let ratio = prior.hours_per_usage(unit.history.data.flights);
    let variance_m2 = unit.history.offset_m2 + prior.bias_sd_m.powi(2);
    let steepest = unit.rise_now().zip(unit.measured.level);
    let after = |hours: f64| {
        let quantiles_m = GapsAhead::after(posterior, hours / ratio, variance_m2, prior).quantiles();
        let [p05_m, m, p95_m] = quantiles_m.map(|gap_m| gap_m + unit.history.undone_m.max(0.0));
        // The interval is widened as that of a crossing is.
        let widened =
            |bound_m: f64| if hours > 0.0 { m + prior.interval_width * (bound_m - m) } else { bound_m };
        // The upper edge meets the limit no later than the line through the last records.
        let line_m =
            steepest.filter(|(rise, _)| rise.p05_hours > 0.0).map_or(f64::NEG_INFINITY, |(rise, level)| {
                level.gap_m + (settings.limit_m - level.gap_m) * hours / rise.p05_hours
            });
        (hours, Interval { p05_m: widened(p05_m), m, p95_m: widened(p95_m).max(line_m) })
    };
    Ok(Forecast { past, ahead: hours.into_iter().map(after).collect() })
}

/// The line through the last records, with the bounds of its slope; empty where they do not rise.
fn line_ahead(unit: &UnitFit<'_>, hours: impl IntoIterator<Item = f64>) -> Vec<(f64, Interval)> {
    let (Some(rise), Some(level)) = (unit.measured.rise, unit.measured.level) else { return Vec::new() };
    let since =
        |record: &Record| unit.history.data.flights.last().map_or(0.0, |last| last.hours - record.hours);
    let flown = unit.measured.sound.last().map_or(0.0, since);
    let after = |hours: f64| {
        let at =
            |rate: f64, errors: f64| level.gap_m + rate * (hours + flown) + errors * NORMAL_95 * level.se_m;
        let slope = |errors: f64| (rise.m_per_hour + errors * NORMAL_95 * rise.m_per_hour_se).max(0.0);
        (hours, Interval { p05_m: at(slope(-1.0), -1.0), m: at(slope(0.0), 0.0), p95_m: at(slope(1.0), 1.0) })
    };
    hours.into_iter().map(after).collect()
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
