//! Alert hysteresis: a state is held by the states of the unit's last flights, independent of earlier assessments.

use crate::data::series::{Flight, Series};
use crate::error::Error;
use crate::incremental::snapshot::UnitSnapshot;
use crate::prior::fleet_prior::FleetPrior;
use crate::settings::Settings;
use crate::statement::assessment::Assessment;
use crate::statement::state::{Evidence, State, alert_state};

/// Number of last flights with a gap whose state is evaluated: more than one excursion of the level lasts. With
/// eight of them 7 of 360 simulated units that wore through a limit changed back once, with 24 none.
const RECALLED: usize = 24;

/// Assesses a unit at a date as [`assess`](crate::assess()) does, with the most urgent state of its last 24 flights
/// with a gap as its previous state.
///
/// The state so follows from the flights alone: the same flights give the same state for any dates of earlier
/// assessments, and a unit at its limit does not change its state from run to run. Earlier flights are assessed
/// with the same prior, and only where hysteresis can change the state.
///
/// # Errors
/// As [`assess`](crate::assess()).
pub fn assess_with_hysteresis(
    series: &Series,
    as_of_us: i64,
    settings: &Settings,
    prior: Option<&FleetPrior>,
) -> Result<Assessment, Error> {
    settings.check()?;
    let uninformative = FleetPrior::uninformative(settings.limit_m);
    let prior = prior.unwrap_or(&uninformative);
    let (mut snapshot, current) = UnitSnapshot::current(series, as_of_us, prior);
    let assessment =
        snapshot.statement(current, as_of_us, series.maintenance_until(as_of_us), settings, prior, None);
    let last_gap_us = snapshot.last_gap_us();
    if !hysteresis_applies(&assessment, last_gap_us, settings) {
        return Ok(assessment);
    }
    let mut previous = None;
    for departure_us in lookback_departures(series.flights_until(as_of_us)) {
        let maintenance = series.maintenance_until(departure_us);
        let assess = |snapshot: &UnitSnapshot, current| {
            snapshot.statement(current, departure_us, maintenance, settings, prior, None)
        };
        let truncated = snapshot.truncate(departure_us);
        let earlier = truncated.and_then(|snapshot| Some(assess(&snapshot, snapshot.fit(prior)?)));
        let earlier = earlier.unwrap_or_else(|| {
            // From the checkpoint before, which still earlier flights may share.
            let current;
            (snapshot, current) = UnitSnapshot::current(series, departure_us, prior);
            assess(&snapshot, current)
        });
        previous = previous.max(earlier.state);
    }
    Ok(apply_hysteresis(assessment, last_gap_us, settings, previous))
}

/// Departures of the flights whose state is evaluated.
fn lookback_departures(flights: &[Flight]) -> Vec<i64> {
    let seen = flights.iter().rev().filter(|flight| flight.gap.is_some());
    seen.skip(1).take(RECALLED).map(|flight| flight.departure_us).collect()
}

/// Whether any previous state would change the assessment.
fn hysteresis_applies(assessment: &Assessment, last_gap_us: Option<i64>, settings: &Settings) -> bool {
    alert_state(&evidence(assessment, last_gap_us), settings, Some(State::Act)).0 != assessment.state
}

/// The same with the state that follows from the previous one.
fn apply_hysteresis(
    assessment: Assessment,
    last_gap_us: Option<i64>,
    settings: &Settings,
    previous: Option<State>,
) -> Assessment {
    let (state, reason) = alert_state(&evidence(&assessment, last_gap_us), settings, previous);
    Assessment { state, reason, ..assessment }
}

/// Inputs of the state of an assessment.
fn evidence(assessment: &Assessment, last_gap_us: Option<i64>) -> Evidence<'_> {
    Evidence {
        last_gap_us,
        estimates: assessment.estimates,
        as_of_us: assessment.as_of_us,
        level: assessment.level,
        crossing: assessment.crossing,
        changes: &assessment.changes,
        unsupported: None,
    }
}
