//! Flights of the flights table that left no record: an actuator wears in them all the same.

use std::collections::{BTreeMap, BTreeSet};

use fleet::{Flight, Installation};
use ingest::flights::Flights;
use jiff::{SignedDuration, Timestamp};

use crate::trends::Flown;

/// A flight of one name within so long of a record's departure is the record's: names come back.
const SAME_FLIGHT: SignedDuration = SignedDuration::from_hours(12);

/// The flights table, tail by tail.
pub(crate) struct Unlogged<'a> {
    by_tail: BTreeMap<&'a str, Vec<&'a Flight>>,
}

impl<'a> Unlogged<'a> {
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

    /// The flights of a unit's stays for which it has no row, as rows without a gap.
    ///
    /// Histories made elsewhere, whose rows know no stay, are taken as they are.
    pub(crate) fn of_unit<'s>(
        &self,
        stays: impl Iterator<Item = &'s Installation>,
        flown: &[&Flown],
    ) -> Vec<Flown> {
        if self.by_tail.is_empty() || flown.iter().all(|f| f.installed_utc.is_none()) {
            return Vec::new();
        }
        let known = Known::of(flown);
        let missing = stays.flat_map(|stay| {
            let flights = self.by_tail.get(stay.tail_number.as_str()).map_or(&[][..], Vec::as_slice);
            let known = &known;
            let missing = flights.iter().filter(|f| stay.covers(f.departure_utc) && !known.holds(f));
            missing.map(move |flight| row(stay, flight))
        });
        missing.collect()
    }
}

/// The flights that a unit's rows speak for.
struct Known<'a> {
    departures: BTreeSet<(&'a str, Timestamp)>,
    names: BTreeSet<(&'a str, &'a str, Timestamp)>,
}

impl<'a> Known<'a> {
    fn of(flown: &[&'a Flown]) -> Self {
        let departure = |f: &&'a Flown| Some((f.tail_number.as_deref()?, f.departure_utc));
        let name =
            |f: &&'a Flown| Some((f.tail_number.as_deref()?, f.flight_id.as_deref()?, f.departure_utc));
        Self {
            departures: flown.iter().filter_map(departure).collect(),
            names: flown.iter().filter_map(name).collect(),
        }
    }

    fn holds(&self, flight: &Flight) -> bool {
        let (tail, id, at) = (flight.tail_number.as_str(), flight.flight_id.as_str(), flight.departure_utc);
        let near = (tail, id, at - SAME_FLIGHT)..=(tail, id, at + SAME_FLIGHT);
        self.departures.contains(&(tail, at)) || self.names.range(near).next().is_some()
    }
}

fn row(stay: &Installation, flight: &Flight) -> Flown {
    Flown {
        part_number: Some(stay.part_number.to_string()),
        serial_number: stay.serial_number.to_string(),
        tail_number: Some(stay.tail_number.to_string()),
        position: Some(stay.position.to_string()),
        flight_id: Some(flight.flight_id.to_string()),
        departure_utc: flight.departure_utc,
        installed_utc: Some(stay.installed_utc),
        flight_hours: flight.flight_hours,
        tail_hours_end: flight.tail_hours_end,
        load_reversals: None,
        gap_m: None,
        gap_se_m: None,
    }
}
