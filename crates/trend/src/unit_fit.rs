//! Measured state and wear laws of one unit at a date.

use crate::data::bins::Segment;
use crate::data::series::{Flight, Series, UnitData};
use crate::error::Error;
use crate::inference::consistency::agrees;
use crate::inference::posterior::{Posterior, posterior};
use crate::measured::rise::Rise;
use crate::measured::{Jump, Measured};
use crate::prior::FleetPrior;
use crate::settings::Settings;
use crate::statement::history::{History, RECORD_FLIGHTS};
use crate::statement::level;
use crate::statement::types::{ChangePoint, ChangePointKind, ForecastMethod, MIN_ESTIMATES};

/// Wear laws that agree with the last records.
pub(crate) struct Fit {
    pub(crate) posterior: Posterior,
    pub(crate) prior: FleetPrior,
    pub(crate) method: ForecastMethod,
}

/// Measured state, history and wear laws of a unit.
pub(crate) struct UnitFit<'a> {
    pub(crate) prior: FleetPrior,
    pub(crate) measured: Measured,
    pub(crate) history: History<'a>,
    /// All changes, by departure.
    pub(crate) changes: Vec<ChangePoint>,
    pub(crate) fit: Option<Fit>,
    /// Posteriors of the segments before the last one.
    pub(crate) ended: Vec<Option<Posterior>>,
}

impl<'a> UnitFit<'a> {
    /// Reads the flights until a date, with a prior learned from nothing later.
    pub(crate) fn new(
        series: &'a Series,
        as_of_us: i64,
        settings: &Settings,
        prior: Option<&FleetPrior>,
    ) -> Result<Self, Error> {
        settings.check()?;
        let prior = prior.cloned().unwrap_or_else(|| FleetPrior::uninformative(settings.limit_m));
        let data = series.until(as_of_us);
        let measured = Measured::new(data, settings);
        let history = History::read(data, series.unit_hours_at_start, &prior);
        let mut changes = history.changes.clone();
        let is_known = |fall: &ChangePoint| {
            near(fall.departure_us, &history.changes, data).any(|change| change.kind.is_unexplained())
                || data.maintenance_near(data.flight_at(fall.departure_us)).next().is_some()
        };
        let is_new = |event: &&ChangePoint| event.kind != ChangePointKind::Reset || !is_known(event);
        changes.extend(measured.events.iter().filter(is_new));
        changes.extend(measured.jump.and_then(|jump| jump_event(&jump, &history.changes, data)));
        let segments: Vec<Segment<'_>> = history.segments().collect();
        let ended: Vec<Option<Posterior>> =
            segments[..segments.len() - 1].iter().map(|segment| posterior(segment, &prior)).collect();
        let fit = consistent_fit(&measured, &history, &prior);
        let by_fleet = fit.as_ref().filter(|fit| fit.method == ForecastMethod::Fleet);
        let fitted = ended.iter().map(Option::as_ref).chain([by_fleet.map(|fit| &fit.posterior)]);
        changes.extend(
            segments.iter().zip(fitted).filter_map(|(s, fitted)| onset(fitted?, s, data.flights, &prior)),
        );
        changes.sort_by_key(|change| change.departure_us);
        Ok(Self { prior, measured, history, changes, fit, ended })
    }

    /// Departures of the outliers, without those that the present level rests on.
    pub(crate) fn outliers_us(&self) -> Vec<i64> {
        let level = self.measured.level.map_or(0, |level| level.records.min(2));
        let kept = self.measured.sound.iter().rev().take(level).map(|r| r.flight).min().unwrap_or(usize::MAX);
        let outliers = self.history.outliers.iter().filter(|flight| **flight < kept);
        outliers.map(|flight| self.history.data.flights[*flight].departure_us).collect()
    }

    /// The rise of the last records, with its hours counted from the last flight instead of the last sound record.
    pub(crate) fn rise_now(&self) -> Option<Rise> {
        let (rise, record) = (self.measured.rise?, self.measured.sound.last()?);
        let flown = self.history.data.flights.last()?.hours - record.hours;
        let left = |hours: f64| (hours - flown).max(0.0);
        Some(Rise {
            p05_hours: left(rise.p05_hours),
            p50_hours: left(rise.p50_hours),
            p95_hours: left(rise.p95_hours),
            ..rise
        })
    }
}

/// Wear laws of the last segment that agree with the last records, by the fleet prior or by a prior without the fleet.
///
/// The prior without the fleet is tried first if the records rise fast, else second.
fn consistent_fit(measured: &Measured, history: &History<'_>, fleet: &FleetPrior) -> Option<Fit> {
    if history.estimates.len() < MIN_ESTIMATES {
        return None;
    }
    let fitted = |history: &History<'_>, prior: FleetPrior, method: ForecastMethod| {
        let posterior = posterior(&history.segments().last()?, &prior)?;
        agrees(&posterior, measured, history, &prior).then_some(Fit { posterior, prior, method })
    };
    let by_fleet = || fitted(history, fleet.clone(), ForecastMethod::Fleet);
    let by_unit = || {
        let own = match measured.rise {
            Some(rise) => {
                fleet.of_fast_wear(rise.m_per_hour, history.segments().last()?.estimates.first()?.gap_m)
            }
            None => fleet.single_unit(),
        };
        fitted(&history.clone().on_axis(&own), own, ForecastMethod::SingleUnit)
    };
    match measured.rise {
        Some(rise) if fleet.is_fast(rise.m_per_hour) => by_unit().or_else(by_fleet),
        _ => by_fleet().or_else(by_unit),
    }
}

/// The jump of the level as a change point; `None` if the history has a change near it.
fn jump_event(jump: &Jump, known: &[ChangePoint], data: UnitData<'_>) -> Option<ChangePoint> {
    if near(jump.departure_us, known, data).next().is_some() {
        return None;
    }
    let step_m = jump.after_m - jump.before_m;
    let kind = match data.is_recorded(data.flight_at(jump.departure_us)) {
        true => ChangePointKind::Recorded,
        false if step_m < 0.0 => ChangePointKind::Reset,
        false => ChangePointKind::Step,
    };
    Some(ChangePoint { departure_us: jump.departure_us, kind, step_m, se_m: jump.error_m, certainty: 1.0 })
}

/// The changes within a few flights of a departure.
fn near<'a>(
    departure_us: i64,
    changes: &'a [ChangePoint],
    data: UnitData<'_>,
) -> impl Iterator<Item = &'a ChangePoint> {
    let at = data.flight_at(departure_us);
    let (from, to) = (at.saturating_sub(RECORD_FLIGHTS), (at + RECORD_FLIGHTS).min(data.flights.len() - 1));
    let dates_us = data.flights[from].departure_us..=data.flights[to].departure_us;
    changes.iter().filter(move |change| dates_us.contains(&change.departure_us))
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
