//! Flights of the last months, by position: their rejections, and what shows that two flights have the same samples.

use std::collections::BTreeMap;

use jiff::{SignedDuration, Timestamp};
use records::Quantity;

use crate::assess::quantities::values::{FlightValues, FollowedUnits, READ};
use crate::fleet::flight_row::FlightRow;

/// Maximum age of the flights: some months.
const LOOKED_BACK: SignedDuration = SignedDuration::from_hours(24 * 120);

#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct RecentFlight<'a> {
    pub(crate) departure_utc: Timestamp,
    pub(crate) flight_id: &'a str,
    /// Code of a rejection that may point to a fault of the mapping.
    pub(crate) rejection: Option<&'static str>,
    /// Stiffness fitted in the flight, N/m; none of a flight without a gap.
    pub(crate) stiffness_n_per_m: Option<f64>,
    /// Bits of all quantities, of a flight with normalised innovations and a stiffness.
    pub(crate) quantities: Option<[u32; READ.len()]>,
}

/// Where which unit sits; empty where its records have none.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct PositionKey<'a> {
    pub(crate) tail_number: &'a str,
    pub(crate) position: &'a str,
    pub(crate) part_number: &'a str,
    pub(crate) serial_number: &'a str,
}

/// Flights of a unit at one position, by departure.
pub(crate) type RecentFlights<'a> = BTreeMap<PositionKey<'a>, Vec<RecentFlight<'a>>>;

/// The flights of the last months before a time.
pub(crate) fn recent_flights<'a>(units: &FollowedUnits<'a>, until: Timestamp) -> RecentFlights<'a> {
    let since_utc = until.checked_sub(LOOKED_BACK).unwrap_or(Timestamp::MIN);
    let mut found = RecentFlights::new();
    for ((part_number, serial_number), unit) in units {
        let first = unit.flights.partition_point(|(flown, _)| flown.departure_utc() < since_utc);
        for (flown, values) in &unit.flights[first..] {
            let place = unit.place(flown);
            let key = PositionKey {
                tail_number: place.tail_number.as_deref().unwrap_or_default(),
                position: place.position.as_deref().unwrap_or_default(),
                part_number: part_number.as_deref().unwrap_or_default(),
                serial_number,
            };
            let flight_id = unit.history.flight_id(flown).unwrap_or_default();
            found.entry(key).or_default().push(recent_flight(flown, flight_id, values));
        }
    }
    found
}

fn recent_flight<'a>(flown: &FlightRow, flight_id: &'a str, values: &FlightValues) -> RecentFlight<'a> {
    let (stiffness_n_per_m, is_refused) = (values.of(Quantity::StiffnessNPerM), flown.gap_m().is_none());
    let has_both = stiffness_n_per_m.and(values.of(Quantity::Nis)).is_some();
    RecentFlight {
        departure_utc: flown.departure_utc(),
        flight_id,
        rejection: values.fault_code().filter(|_| is_refused),
        stiffness_n_per_m: stiffness_n_per_m.filter(|_| !is_refused),
        quantities: has_both.then(|| values.values.map(|(value, _)| value.to_bits())),
    }
}
