//! Flights of the last months, by position: their rejections, and what shows that two flights have the same samples.

use std::collections::BTreeMap;

use jiff::{SignedDuration, Timestamp};
use records::Quantity;

use crate::assess::quantities::values::{Covariates, FollowedUnits, READ};

/// Maximum age of the flights: some months.
const LOOKED_BACK: SignedDuration = SignedDuration::from_hours(24 * 120);

#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct RecentFlight<'a> {
    pub(crate) departure_utc: Timestamp,
    pub(crate) flight_id: &'a str,
    /// Code of a rejection that may point to a fault of the mapping.
    pub(crate) rejection: Option<&'static str>,
    pub(crate) has_gap: bool,
    /// Row of its further columns.
    pub(crate) row: u32,
    /// Values in the order of [`READ`]; NaN for none.
    pub(crate) values: [f32; READ.len()],
}

impl RecentFlight<'_> {
    fn value(&self, quantity: Quantity) -> Option<f64> {
        let index = READ.iter().position(|(read, _)| *read == quantity)?;
        Some(f64::from(self.values[index])).filter(|value| value.is_finite())
    }

    /// Stiffness fitted in the flight, N/m; none of a flight without a gap.
    pub(crate) fn stiffness_n_per_m(&self) -> Option<f64> {
        self.value(Quantity::StiffnessNPerM).filter(|_| self.has_gap)
    }

    /// Bits of all quantities, of a flight with normalised innovations and a stiffness.
    pub(crate) fn quantities(&self) -> Option<[u32; READ.len()]> {
        let has_both = self.value(Quantity::StiffnessNPerM).and(self.value(Quantity::Nis)).is_some();
        has_both.then(|| self.values.map(f32::to_bits))
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct PositionKey<'a> {
    pub(crate) tail_number: &'a str,
    pub(crate) position: &'a str,
    pub(crate) part_number: &'a str,
    pub(crate) serial_number: &'a str,
}

pub(crate) type RecentFlights<'a> = BTreeMap<PositionKey<'a>, Vec<RecentFlight<'a>>>;

/// The flights of the last months before a time, without their values.
pub(crate) fn recent_flights<'a>(
    units: &FollowedUnits<'a>,
    covariates: &[Covariates],
    until: Timestamp,
) -> RecentFlights<'a> {
    let since_utc = until.checked_sub(LOOKED_BACK).unwrap_or(Timestamp::MIN);
    let mut found = RecentFlights::new();
    for ((part_number, serial_number), unit) in units {
        let first = unit.flights.partition_point(|flown| flown.departure_utc() < since_utc);
        for flown in &unit.flights[first..] {
            let place = unit.place(flown);
            let key = PositionKey {
                tail_number: place.tail_number.as_deref().unwrap_or_default(),
                position: place.position.as_deref().unwrap_or_default(),
                part_number: part_number.as_deref().unwrap_or_default(),
                serial_number,
            };
            found.entry(key).or_default().push(RecentFlight {
                departure_utc: flown.departure_utc(),
                flight_id: unit.history.flight_id(flown).unwrap_or_default(),
                rejection: covariates[flown.row as usize].fault_code().filter(|_| flown.gap_m().is_none()),
                has_gap: flown.gap_m().is_some(),
                row: flown.row,
                values: [f32::NAN; READ.len()],
            });
        }
    }
    found
}
