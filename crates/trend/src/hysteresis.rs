//! Alert hysteresis: a state is held by the states of the unit's last flights, independent of earlier assessments.

use crate::data::series::{Flight, MaintenanceEvent, Series};
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
        let earlier = snapshot.truncate(departure_us);
        let earlier = earlier
            .map(|snapshot| snapshot.assess(departure_us, series.maintenance(), settings, prior, None));
        let earlier = earlier.transpose()?.flatten().unwrap_or_else(|| {
            // From the checkpoint before, on which still earlier flights may stand, too.
            let current;
            (snapshot, current) = UnitSnapshot::current(series, departure_us, prior);
            snapshot.statement(
                current,
                departure_us,
                series.maintenance_until(departure_us),
                settings,
                prior,
                None,
            )
        });
        previous = previous.max(earlier.state);
    }
    Ok(apply_hysteresis(assessment, last_gap_us, settings, previous))
}

impl UnitSnapshot {
    /// States what is known of the unit on a day as [`assess_with_hysteresis`] does from its whole history.
    ///
    /// Nothing as [`UnitSnapshot::assess`], and where a memory could matter that goes back beyond the last checkpoint.
    ///
    /// # Errors
    /// As [`assess`](crate::assess()).
    pub fn assess_with_hysteresis(
        &self,
        as_of_us: i64,
        maintenance: &[MaintenanceEvent],
        settings: &Settings,
        prior: &FleetPrior,
    ) -> Result<Option<Assessment>, Error> {
        let Some(assessment) = self.assess(as_of_us, maintenance, settings, prior, None)? else {
            return Ok(None);
        };
        if !hysteresis_applies(&assessment, self.last_gap_us(), settings) {
            return Ok(Some(assessment));
        }
        let asked = lookback_departures(&self.tail);
        if asked.len() < RECALLED {
            return Ok(None);
        }
        let mut previous = None;
        for departure_us in asked {
            let Some(snapshot) = self.truncate(departure_us) else { return Ok(None) };
            let Some(earlier) = snapshot.assess(departure_us, maintenance, settings, prior, None)? else {
                return Ok(None);
            };
            previous = previous.max(earlier.state);
        }
        Ok(Some(apply_hysteresis(assessment, self.last_gap_us(), settings, previous)))
    }
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

/// What a statement's state was judged by.
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
