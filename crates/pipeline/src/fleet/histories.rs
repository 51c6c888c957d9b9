//! Every unit's flights as statements need them.
//!
//! A fleet's store holds tens of millions of records of some fifty columns; of each flight this keeps what a
//! trend is made from, and names once for each unit.

use std::cmp::Ordering;
use std::collections::{BTreeMap, HashSet};

use jiff::Timestamp;
use records::Installation;
use store::ColumnScan;

use crate::fleet::flight_row::{FlightExtras, FlightRow, StoredFlight, is_day};
use crate::fleet::unit_rows::{SettingsCounts, UnitRows};

pub use crate::fleet::flight_row::{TailPosition, UnitKey};

/// A unit's flights, by departure.
#[derive(Debug, Clone, Default)]
pub struct History {
    places: Vec<TailPosition>,
    flights: Vec<FlightRow>,
    /// Their secondary columns; empty once their usage is added up.
    pub(crate) extras: Vec<FlightExtras>,
    /// The flights' names, one after the other.
    names: String,
    /// Departures of the flights whose estimators disagree, µs since 1970 UTC, in order.
    disputed_us: Vec<i64>,
    pub(crate) settings: SettingsCounts,
}

impl History {
    /// The flights, by departure.
    pub fn flights(&self) -> &[FlightRow] {
        &self.flights
    }

    /// The tails it was flown on.
    pub(crate) fn tails(&self) -> impl Iterator<Item = &str> {
        self.places.iter().filter_map(|place| place.tail_number.as_deref())
    }

    /// The flights that departed at or before a time.
    pub(crate) fn until(&self, as_of: Timestamp) -> &[FlightRow] {
        &self.flights[..self.flights.partition_point(|f| f.departure_utc() <= as_of)]
    }

    /// Of the latest gaps at a time, how many have estimators that disagree, and how many there are.
    pub(crate) fn disputed(&self, as_of: Timestamp, latest: usize) -> (usize, usize) {
        let gaps = self.until(as_of).iter().rev().filter(|flown| flown.gap_m().is_some()).take(latest);
        gaps.fold((0, 0), |(disputed, count), flown| {
            let is_disputed = self.disputed_us.binary_search(&flown.departure_us()).is_ok();
            (disputed + usize::from(is_disputed), count + 1)
        })
    }

    /// The flight that departed at this time.
    pub(crate) fn at(&self, departure_utc: Timestamp) -> Option<&FlightRow> {
        let first = self.flights.partition_point(|f| f.departure_utc() < departure_utc);
        self.flights.get(first).filter(|f| f.departure_utc() == departure_utc)
    }

    pub(crate) fn flight_id(&self, flown: &FlightRow) -> Option<&str> {
        flown.name_in(&self.names)
    }

    pub(crate) fn place(&self, flown: &FlightRow) -> &TailPosition {
        &self.places[flown.place as usize]
    }

    /// Rank by name of each place.
    pub(crate) fn place_ranks(&self) -> Vec<usize> {
        self.places.iter().map(|place| self.places.iter().filter(|other| *other < place).count()).collect()
    }

    /// The index of the installation, of those of the unit, that a flight belongs to.
    pub(crate) fn installation(&self, flown: &FlightRow, installations: &[&Installation]) -> Option<usize> {
        let TailPosition { tail_number, position } = self.place(flown);
        let is_here = |installation: &&Installation| {
            tail_number.as_deref() == Some(installation.tail_number.as_str())
                && position.as_deref() == Some(installation.position.as_str())
                && installation.covers(flown.departure_utc())
        };
        installations.iter().position(is_here)
    }

    /// Keeps one record of each flight: a unit is in one position at a time, but has a record under each name of a position that
    /// was renamed. The record in an installation counts, then one with a gap.
    pub(crate) fn keep_one_record_a_flight(&mut self, installations: &[&Installation]) {
        let flight_id = |flown: &FlightRow| self.flight_id(flown).filter(|_| is_day(flown.departure_us()));
        let flight = |flown: &FlightRow| (flown.departure_us(), flight_id(flown));
        let order = |flown: &&FlightRow| {
            let is_elsewhere = self.installation(flown, installations).is_none();
            (is_elsewhere, flown.gap_m().is_none(), self.place(flown))
        };
        let of_flight = self.flights.chunk_by(|a, b| flight(a) == flight(b)).filter(|all| all.len() > 1);
        let repeated = of_flight.flat_map(|all| {
            let kept = all.iter().min_by_key(order).map(|kept| kept.row);
            all.iter().map(|flown| flown.row).filter(move |row| Some(*row) != kept)
        });
        let repeated: HashSet<u32> = repeated.collect();
        let mut flights = self.flights.iter();
        self.extras.retain(|_| flights.next().is_some_and(|flown| !repeated.contains(&flown.row)));
        self.flights.retain(|flown| !repeated.contains(&flown.row));
    }

    /// The history of a unit's rows; sorted, so that it does not depend on the order of arrival.
    pub(crate) fn of_rows(rows: UnitRows) -> Self {
        let UnitRows { places, names, settings, mut rows, .. } = rows;
        let place = |flown: &FlightRow| &places[flown.place as usize];
        let order = |(a, _): &StoredFlight, (b, _): &StoredFlight| {
            let rest = || place(a).cmp(place(b)).then_with(|| a.name_in(&names).cmp(&b.name_in(&names)));
            a.departure_us().cmp(&b.departure_us()).then_with(rest)
        };
        if !rows.is_sorted_by(|a, b| order(a, b) != Ordering::Greater) {
            rows.sort_by(order);
        }
        let disputed = rows.iter().filter(|(_, extras)| extras.is_disputed());
        let disputed_us = disputed.map(|(flown, _)| flown.departure_us()).collect();
        let (flights, extras) = rows.into_iter().unzip();
        Self { places, flights, extras, names, disputed_us, settings }
    }
}

/// All units' flights.
#[derive(Debug, Clone, Default)]
pub struct Histories {
    /// Each unit's flights.
    pub units: BTreeMap<UnitKey, History>,
    /// Of the store's own, the rows that they were made from: their flights belong to rows of the installations table. Those
    /// of a table made elsewhere may be of other aircraft under the same names.
    pub(crate) stored: Option<Box<ColumnScan>>,
}

impl Histories {
    /// The tails of all flights; a tail may come several times.
    pub fn tails(&self) -> impl Iterator<Item = &str> {
        self.units.values().flat_map(History::tails)
    }

    /// The last departure of all, but no later than now: a record dated ahead must not make all others stale.
    pub fn newest_utc(&self) -> Option<Timestamp> {
        let last = self.units.values().filter_map(|history| history.flights.last());
        Some(last.map(FlightRow::departure_utc).max()?.min(Timestamp::now()))
    }

    /// The first departure of all.
    pub fn oldest_utc(&self) -> Option<Timestamp> {
        let first = self.units.values().filter_map(|history| history.flights.first());
        first.map(FlightRow::departure_utc).min()
    }
}
