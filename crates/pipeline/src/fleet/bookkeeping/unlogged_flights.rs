//! Flights of the flights table that left no record: an actuator wears in them all the same.

use std::collections::BTreeSet;

use ingest::tables::flights::Flights;
use jiff::{SignedDuration, Timestamp};
use records::{Flight, Installation};

use crate::fleet::histories::History;

/// Longest distance between the departures of a flight and a record of the same name: names are reused.
const SAME_FLIGHT: SignedDuration = SignedDuration::from_hours(12);

/// Flights of a unit's installations for which it has no row, each with the index of its installation. None if none of
/// the unit's rows lies in an installation: the table does not describe such a history.
pub(crate) fn unlogged_flights<'a>(
    table: &'a Flights,
    history: &History,
    installations: &[&Installation],
) -> Vec<(usize, &'a Flight)> {
    let is_elsewhere = |flown| history.installation(flown, installations).is_none();
    if table.is_empty() || history.flights().iter().all(is_elsewhere) {
        return Vec::new();
    }
    let known = &Known::of(history);
    let missing = installations.iter().enumerate().flat_map(|(index, installation)| {
        let flights = table.of_tail(installation.tail_number.as_str());
        let missing = flights.filter(|f| installation.covers(f.departure_utc) && !known.holds(f));
        missing.map(move |flight| (index, flight))
    });
    missing.collect()
}

/// Flights covered by a unit's rows.
struct Known<'a> {
    departures: BTreeSet<(&'a str, Timestamp)>,
    names: BTreeSet<(&'a str, &'a str, Timestamp)>,
}

impl<'a> Known<'a> {
    fn of(history: &'a History) -> Self {
        let mut known = Self { departures: BTreeSet::new(), names: BTreeSet::new() };
        for f in history.flights() {
            let Some(tail) = history.place(f).tail_number.as_deref() else { continue };
            known.departures.insert((tail, f.departure_utc()));
            known.names.extend(history.flight_id(f).map(|id| (tail, id, f.departure_utc())));
        }
        known
    }

    fn holds(&self, flight: &Flight) -> bool {
        let (tail, id, at) = (flight.tail_number.as_str(), flight.flight_id.as_str(), flight.departure_utc);
        let near = (tail, id, at - SAME_FLIGHT)..=(tail, id, at + SAME_FLIGHT);
        self.departures.contains(&(tail, at)) || self.names.range(near).next().is_some()
    }
}
