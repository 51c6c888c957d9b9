//! Backtest: each history is cut at several dates, assessed with the data known then, and its crossing forecast is
//! compared with the later data.
//!
//! For a unit that reached its limit the target is the limit; otherwise it is its current level,
//! so that a fleet can be calibrated before its first failure.

use jiff::Timestamp;
use job::Config;
use rayon::prelude::*;
use records::Installations;
use trend::{ChangePointKind, Series};

use crate::assess::trends::FleetContext;
use crate::error::Error;
use crate::fleet::flight_row::FlightRow;
use crate::fleet::histories::{Histories, History, UnitKey};

/// Shares of a unit's estimates at which a backtest cuts its history.
const CUTS: [f64; 3] = [0.3, 0.5, 0.75];

/// Estimates below which a history is not cut.
const FEWEST: usize = 40;

/// Number of flights of the running median that decides whether a limit counts as met.
const WINDOW: usize = 21;

records::row! {
    /// A past forecast and its outcome.
    #[derive(Debug, Clone, PartialEq)]
    pub struct BacktestRow {
        /// Part number of the unit.
        pub part_number: Option<String>,
        /// Serial number of the unit.
        pub serial_number: String,
        /// Date of the forecast.
        pub as_of_utc: Timestamp,
        /// `limit` where the act limit was reached, `level` where the target is the last level.
        pub target: &'static str,
        /// Gap of the target, m.
        pub target_m: f64,
        /// Share of the hours to the target that had passed at the date of the forecast.
        pub used_share: f64,
        /// Hours from the forecast to the target.
        pub true_hours: f64,
        /// Forecast hours to the target, earliest (5 %).
        pub hours_p05: f64,
        /// Forecast hours to the target, median.
        pub hours_p50: f64,
        /// Forecast hours to the target, latest (95 %).
        pub hours_p95: f64,
        /// |median ÷ true − 1|.
        pub relative_error: f64,
        /// `held`, `late` (the target was reached sooner than forecast) or `early` (later than forecast).
        pub interval: &'static str,
    }
}

/// Past forecasts of the units that have worn since, by part number, serial number and date.
///
/// A forecast is left out if a step or a reset came between it and its target, or if the unit has not clearly worn since.
/// A unit that seemed steady at the date of its forecast counts as well.
///
/// # Errors
/// When a history or a part's limits are invalid.
pub fn of_histories(
    config: &Config,
    installations: &Installations,
    mut histories: Histories,
) -> Result<Vec<BacktestRow>, Error> {
    let of_unit =
        |(name, history): (&UnitKey, _)| cuts(history).map(|day| (name.clone(), day)).collect::<Vec<_>>();
    let cuts: Vec<(UnitKey, Timestamp)> = histories.units.iter().flat_map(of_unit).collect();
    let days: Vec<Timestamp> = cuts.iter().map(|(_, day)| *day).collect();
    let fleet = FleetContext::new(config, installations, &mut histories, &days)?;
    let pasts = cuts.par_iter().map(|(name, day)| past(&fleet, name, *day));
    Ok(pasts.collect::<Result<Vec<_>, Error>>()?.into_iter().flatten().collect())
}

fn cuts(history: &History) -> impl Iterator<Item = Timestamp> {
    let estimated = history.flights().iter().filter(|f| f.gap_m().is_some());
    let days: Vec<Timestamp> = estimated.map(FlightRow::departure_utc).collect();
    let asked = if days.len() < FEWEST { &CUTS[..0] } else { &CUTS[..] };
    asked.iter().map(move |share| days[(share * days.len() as f64) as usize])
}

/// Past forecast of a unit at a date, compared with the outcome; nothing where no comparison is possible.
fn past(fleet: &FleetContext<'_>, name: &UnitKey, day: Timestamp) -> Result<Option<BacktestRow>, Error> {
    let Some(series) = fleet.series(name) else { return Ok(None) };
    let settings = fleet.settings(name);
    let prior = fleet.prior(name, day);
    let as_of_us = day.as_microsecond();
    let last_us = series.flights().last().map_or(as_of_us, |f| f.departure_us);
    let then = trend::assess(series, as_of_us, &settings, prior)?;
    let now = trend::assess(series, last_us, &settings, prior)?;
    let disturbed = |c: &trend::ChangePoint| {
        c.departure_us > as_of_us && matches!(c.kind, ChangePointKind::Step | ChangePointKind::Reset)
    };
    let (Some(before), Some(after)) = (then.level, now.level) else { return Ok(None) };
    let moved = after.gap_m - before.gap_m > 2.0 * before.se_m.hypot(after.se_m);
    if !moved || now.changes.iter().any(disturbed) {
        return Ok(None);
    }
    let then_hours = series.flights_until(as_of_us).last().map_or(0.0, |f| f.hours);
    let end_hours = series.flights().last().map_or(then_hours, |f| f.hours);
    let (target, target_m, at_hours) = match hours_to_limit(series, settings.limit_m) {
        Some(hours) => ("limit", settings.limit_m, hours),
        None => ("level", after.gap_m, end_hours),
    };
    let true_hours = at_hours - then_hours;
    let asked = trend::Settings { limit_m: target_m, watch_m: settings.watch_m.min(target_m), ..settings };
    let said = trend::assess(series, as_of_us, &asked, prior)?;
    let Some(crossing) = said.crossing.filter(|_| true_hours > 10.0) else { return Ok(None) };
    let [low, likely, high] = [crossing.p05_hours, crossing.p50_hours, crossing.p95_hours]
        .map(|hours| hours.unwrap_or(settings.horizon_hours));
    Ok(Some(BacktestRow {
        part_number: name.0.clone(),
        serial_number: name.1.clone(),
        as_of_utc: day,
        target,
        target_m,
        used_share: then_hours / at_hours,
        true_hours,
        hours_p05: low,
        hours_p50: likely,
        hours_p95: high,
        relative_error: (likely / true_hours - 1.0).abs(),
        interval: match true_hours {
            hours if hours < low => "late",
            hours if hours > high => "early",
            _ => "held",
        },
    }))
}

/// The unit's hours when the running median of its gaps first met a limit.
fn hours_to_limit(series: &Series, limit_m: f64) -> Option<f64> {
    let gaps: Vec<(f64, f64)> =
        series.flights().iter().filter_map(|f| Some((f.hours, f.gap?.gap_m))).collect();
    let over = |window: &&[(f64, f64)]| 2 * window.iter().filter(|(_, gap)| *gap >= limit_m).count() > WINDOW;
    gaps.windows(WINDOW).find(over).map(|window| window[WINDOW / 2].0)
}
