//! A state that remembers: held by what the unit's own last flights said, and by nothing that is kept.

use crate::error::Error;
use crate::prior::FleetPrior;
use crate::series::{Flight, Series};
use crate::settings::Settings;
use crate::state::{Evidence, State, judge};
use crate::trend::{Trend, trend};

/// Flights with a gap that are asked what their state was.
const RECALLED: usize = 8;

/// States what is known of a unit on a day as [`trend()`] does, its previous state being the most urgent
/// one of its last eight flights before.
///
/// The state of a night so follows from the flights alone: the same flights give the same state whether
/// or not a statement was made every night, and a unit at its limit does not change its state from night
/// to night. Earlier flights are judged by the same prior, and only where a memory could matter.
///
/// # Errors
/// As [`trend()`].
pub fn remembered(
    series: &Series,
    as_of_us: i64,
    settings: &Settings,
    prior: Option<&FleetPrior>,
) -> Result<Trend, Error> {
    let mut said = trend(series, as_of_us, settings, prior, None)?;
    let flights = series.until(as_of_us);
    if judge(&evidence(&said, flights), settings, Some(State::Act)).0 == said.state {
        return Ok(said);
    }
    let mut previous = None;
    for flight in flights.iter().rev().filter(|f| f.gap.is_some()).skip(1).take(RECALLED) {
        previous = previous.max(trend(series, flight.departure_us, settings, prior, None)?.state);
    }
    (said.state, said.reason) = judge(&evidence(&said, flights), settings, previous);
    Ok(said)
}

/// What a statement's state was judged by.
fn evidence<'a>(said: &'a Trend, flights: &[Flight]) -> Evidence<'a> {
    Evidence {
        last_gap_us: flights.iter().rev().find(|f| f.gap.is_some()).map(|f| f.departure_us),
        estimates: said.estimates,
        as_of_us: said.as_of_us,
        level: said.level,
        crossing: said.crossing,
        changes: &said.changes,
        unsupported: None,
    }
}
