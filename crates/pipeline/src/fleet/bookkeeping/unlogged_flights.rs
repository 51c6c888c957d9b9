//! Flights of the flights table that left no record: an actuator wears in them all the same.

use std::collections::BTreeSet;

use ingest::tables::flights::Flights;
use jiff::{SignedDuration, Timestamp};
use records::{Flight, Installation};

use crate::fleet::flight_row::FlightRow;
use crate::fleet::histories::History;

/// Longest time between the departures of a flight and of its record: names are reused.
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
    let missing = installations.iter().enumerate().flat_map(|(index, installation)| {
        let tail = installation.tail_number.as_str();
        let flights = table.of_tail(tail).filter(|f| installation.covers(f.departure_utc));
        let rows = flights.map(|flight| (flight, row_of(flight, history)));
        let (logged, missing): (Vec<_>, Vec<_>) = rows.partition(|(_, row)| row.is_some());
        let mut missing: Vec<&Flight> = missing.into_iter().map(|(flight, _)| flight).collect();
        let period = table.of_tail(tail).next().zip(table.of_tail(tail).last());
        let is_in_period = |at: Timestamp| {
            period.is_some_and(|(first, last)| (first.departure_utc..=last.departure_utc).contains(&at))
        };
        let records = history.flights().iter().filter(|flown| {
            let (place, at) = (history.place(flown).tail_number.as_deref(), flown.departure_utc());
            place == Some(tail) && installation.covers(at) && is_in_period(at)
        });
        let records: Vec<Timestamp> = records.map(FlightRow::departure_utc).collect();
        // By other names, or in another time zone, a table would count most flights twice.
        if 2 * logged.len() < records.len() {
            let matched: BTreeSet<Timestamp> =
                logged.iter().filter_map(|(_, row)| Some((*row)?.departure_utc())).collect();
            let unmatched = records.into_iter().filter(|departure_utc| !matched.contains(departure_utc));
            leave_out_nearest(&mut missing, unmatched);
        }
        missing.into_iter().map(move |flight| (index, flight)).collect::<Vec<_>>()
    });
    missing.collect()
}

/// Removes, for each record, the nearest flight within 12 hours; the flights are by departure.
fn leave_out_nearest(flights: &mut Vec<&Flight>, records: impl Iterator<Item = Timestamp>) {
    for departure_utc in records {
        let apart = |at: &usize| flights[*at].departure_utc.duration_since(departure_utc).abs();
        let next = flights.partition_point(|flight| flight.departure_utc < departure_utc);
        let near = next.saturating_sub(1)..flights.len().min(next + 1);
        let nearest = near.min_by_key(apart).filter(|at| apart(at) <= SAME_FLIGHT);
        nearest.map(|at| flights.remove(at));
    }
}

/// A unit's row of a flight: one of its tail with its departure, or with its name and a departure within 12 hours of it.
fn row_of<'h>(flight: &Flight, history: &'h History) -> Option<&'h FlightRow> {
    let at = flight.departure_utc;
    let since = |flown: &FlightRow| flown.departure_utc().duration_since(at);
    let first = history.flights().partition_point(|flown| since(flown) < -SAME_FLIGHT);
    let mut near = history.flights()[first..].iter().take_while(|flown| since(flown) <= SAME_FLIGHT);
    let is_same = |flown: &FlightRow| {
        flown.departure_utc() == at || history.flight_id(flown) == Some(flight.flight_id.as_str())
    };
    let is_on_tail =
        |flown: &FlightRow| history.place(flown).tail_number.as_deref() == Some(flight.tail_number.as_str());
    near.find(|flown| is_same(flown) && is_on_tail(flown))
}
