//! Measured state and wear laws of one unit at a date.

use std::borrow::Cow;

use crate::data::bins::Segment;
use crate::data::series::{Flight, MaintenanceEvent, Series};
use crate::inference::consistency::agrees;
use crate::inference::posterior::{Posterior, posterior};
use crate::measured::rise::Rise;
use crate::measured::{Jump, Measured};
use crate::prior::fleet_prior::FleetPrior;
use crate::settings::Settings;
use crate::statement::history::{self, History};
use crate::statement::level;
use crate::statement::types::{ChangePoint, ChangePointKind, ForecastMethod, MIN_ESTIMATES};

/// Wear laws that agree with the last records.
pub(crate) struct Fit<'a> {
    pub(crate) posterior: Posterior,
    pub(crate) prior: Cow<'a, FleetPrior>,
    pub(crate) method: ForecastMethod,
}

/// What the flights of a unit show.
pub(crate) struct UnitFit<'a> {
    pub(crate) measured: Measured,
    pub(crate) history: History,
    /// All changes, by departure.
    pub(crate) changes: Vec<ChangePoint>,
    pub(crate) fit: Option<Fit<'a>>,
    /// Posteriors of the segments before the last one.
    pub(crate) ended: Vec<Option<Posterior>>,
}

impl<'a> UnitFit<'a> {
    /// Reads the flights until a date, with a prior learned from nothing later.
    pub(crate) fn new(series: &Series, as_of_us: i64, settings: &Settings, prior: &'a FleetPrior) -> Self {
        let flights = series.flights_until(as_of_us);
        let maintenance = series.maintenance_until(as_of_us);
        let measured = Measured::new(flights, maintenance, settings);
        let history = history::read_history(flights, maintenance, series.usage.unit_hours_at_start, prior);
        let mut changes = history.changes.clone();
        changes.extend(&measured.events);
        changes
            .extend(measured.jump.and_then(|jump| jump_event(&jump, &history.changes, flights, maintenance)));
        let segments: Vec<Segment<'_>> = history.segments().collect();
        let (mut ended, mut fit) = (Vec::new(), None);
        if let Some((last, before)) = segments.split_last() {
            for segment in before {
                let fitted = posterior(segment, prior);
                changes.extend(fitted.as_ref().and_then(|p| onset(p, segment, flights, prior)));
                ended.push(fitted);
            }
            fit = consistent_fit(&measured, &history, last, flights, prior);
            let onset_of = |fit: &Fit<'_>| onset(&fit.posterior, last, flights, &fit.prior);
            let is_on_axis = |fit: &&Fit<'_>| fit.method == ForecastMethod::Fleet;
            changes.extend(fit.as_ref().filter(is_on_axis).and_then(onset_of));
        }
        changes.sort_by_key(|change| change.departure_us);
        Self { measured, history, changes, fit, ended }
    }

    /// Departures of the outliers: records that later ones did not confirm.
    pub(crate) fn outliers_us(&self, flights: &[Flight]) -> Vec<i64> {
        let level = self.measured.level.map_or(0, |level| level.records.min(2));
        let kept = self.measured.sound.iter().rev().take(level).map(|r| r.flight).min().unwrap_or(usize::MAX);
        let outliers = self.history.outliers.iter().filter(|flight| **flight < kept);
        outliers.map(|flight| flights[*flight].departure_us).collect()
    }

    /// The rise of the last records, its hours counted from the last flight.
    pub(crate) fn rise_now(&self, flights: &[Flight]) -> Option<Rise> {
        let (rise, record) = (self.measured.rise?, self.measured.sound.last()?);
        let flown = flights.last()?.hours - record.hours;
        let left = |hours: f64| (hours - flown).max(0.0);
        Some(Rise {
            p05_hours: left(rise.p05_hours),
            p50_hours: left(rise.p50_hours),
            p95_hours: left(rise.p95_hours),
            ..rise
        })
    }
}

/// The wear laws of the last segment by the fleet's prior, or else by the unit's own, as the last records allow.
fn consistent_fit<'a>(
    measured: &Measured,
    history: &History,
    last: &Segment<'_>,
    flights: &[Flight],
    prior: &'a FleetPrior,
) -> Option<Fit<'a>> {
    if history.estimates.len() < MIN_ESTIMATES {
        return None;
    }
    let fitted = |segment: &Segment<'_>, prior: &FleetPrior| {
        let posterior = posterior(segment, prior)?;
        agrees(&posterior, segment.now, measured, history, flights, prior).then_some(posterior)
    };
    let by_fleet = || {
        let posterior = fitted(last, prior)?;
        Some(Fit { posterior, prior: Cow::Borrowed(prior), method: ForecastMethod::Fleet })
    };
    let by_unit = || {
        let own = match measured.rise {
            Some(rise) => prior.of_fast_wear(rise.m_per_hour, last.estimates.first()?.gap_m),
            None => prior.single_unit(),
        };
        let history = history.on_axis(flights, &own);
        let posterior = fitted(&history.segments().last()?, &own)?;
        Some(Fit { posterior, prior: Cow::Owned(own), method: ForecastMethod::SingleUnit })
    };
    match measured.rise {
        Some(rise) if prior.is_fast(rise.m_per_hour) => by_unit().or_else(by_fleet),
        _ => by_fleet().or_else(by_unit),
    }
}

/// The jump of the level as a change point, unless the history has it already.
fn jump_event(
    jump: &Jump,
    known: &[ChangePoint],
    flights: &[Flight],
    maintenance: &[MaintenanceEvent],
) -> Option<ChangePoint> {
    let at = flights.partition_point(|flight| flight.departure_us < jump.departure_us);
    let near = flights.get(at.saturating_sub(history::RECORD_FLIGHTS))?.departure_us
        ..=flights[(at + history::RECORD_FLIGHTS).min(flights.len() - 1)].departure_us;
    if known.iter().any(|change| near.contains(&change.departure_us)) {
        return None;
    }
    let is_recorded = history::is_recorded(flights, maintenance, at);
    let step_m = jump.after_m - jump.before_m;
    let kind = match is_recorded {
        true => ChangePointKind::Recorded,
        false if step_m < 0.0 => ChangePointKind::Reset,
        false => ChangePointKind::Step,
    };
    Some(ChangePoint { departure_us: jump.departure_us, kind, step_m, se_m: jump.error_m, certainty: 1.0 })
}

/// The onset of wear that a posterior found in a segment, as a change point.
fn onset(
    posterior: &Posterior,
    segment: &Segment<'_>,
    flights: &[Flight],
    prior: &FleetPrior,
) -> Option<ChangePoint> {
    let (start, certainty) = level::onset(posterior)?;
    let first = flights.partition_point(|flight| prior.usage(flight) < segment.begin + start);
    let departure_us = flights.get(first)?.departure_us;
    Some(ChangePoint { departure_us, kind: ChangePointKind::Onset, step_m: 0.0, se_m: 0.0, certainty })
}
