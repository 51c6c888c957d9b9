//! Flights of the flights table that left no record: an actuator wears in them all the same.

use std::collections::{BTreeMap, BTreeSet};

use ingest::tables::flights::Flights;
use jiff::{SignedDuration, Timestamp};
use records::{Flight, Installation};

use crate::fleet::histories::History;

/// Longest distance between the departures of a flight and a record of the same name: names are reused.
const SAME_FLIGHT: SignedDuration = SignedDuration::from_hours(12);

/// The flights table, tail by tail.
pub(crate) struct UnloggedFlights<'a> {
    by_tail: BTreeMap<&'a str, Vec<&'a Flight>>,
}

impl<'a> UnloggedFlights<'a> {
    pub(crate) fn of_table(table: &'a Flights) -> Self {
        let mut by_tail: BTreeMap<&str, Vec<&Flight>> = BTreeMap::new();
        for flight in table.iter() {
            by_tail.entry(flight.tail_number.as_str()).or_default().push(flight);
        }
        for flights in by_tail.values_mut() {
            flights.sort_by_key(|flight| flight.departure_utc);
        }
        Self { by_tail }
    }

    /// Whether the flights table has flights of an aircraft.
    pub(crate) fn has_tail(&self, tail: &str) -> bool {
        self.by_tail.contains_key(tail)
    }

    /// Flights of a unit's installations for which it has no row, each with the index of its installation. None if none of
    /// the unit's rows lies in an installation: the table does not describe such a history.
    pub(crate) fn of_unit(
        &self,
        history: &History,
        installations: &[&Installation],
    ) -> Vec<(usize, &'a Flight)> {
        if self.by_tail.is_empty()
            || history.flights().iter().all(|f| history.installation(f, installations).is_none())
        {
            return Vec::new();
        }
        let known = &Known::of(history);
        let missing = installations.iter().enumerate().flat_map(|(index, installation)| {
            let flights = self.by_tail.get(installation.tail_number.as_str()).map_or(&[][..], Vec::as_slice);
            let missing = flights.iter().filter(|f| installation.covers(f.departure_utc) && !known.holds(f));
            missing.map(move |&flight| (index, flight))
        });
        missing.collect()
    }
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
