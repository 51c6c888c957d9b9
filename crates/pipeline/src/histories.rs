//! Every unit's flights as statements need them, gathered from tables of any length.
//!
//! A fleet's store holds tens of millions of records of some fifty columns; of each flight this keeps what a
//! trend is made from, and names once for each unit.

use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet, HashMap};

use arrow::array::{Array, Float64Array};
use fleet::{GapRecord, Installation};
use ingest::tables::Chunk;
use jiff::Timestamp;

/// Part number where known, and serial number.
pub type HistoryName = (Option<String>, String);

/// One flight of one unit, wherever its gap was estimated.
#[derive(Debug, Clone, PartialEq)]
#[expect(missing_docs, reason = "each field is named for the contract's column, with its unit")]
pub struct Flown {
    /// Which of its unit's places it was flown in.
    pub place: u32,
    /// How many of its unit's rows came before it, in the order of arrival.
    pub row: u32,
    pub flight_id: Option<Box<str>>,
    pub departure_utc: Timestamp,
    pub flight_hours: Option<f64>,
    pub tail_hours_end: Option<f64>,
    pub load_reversals: Option<u64>,
    pub gap_m: Option<f64>,
    pub gap_se_m: Option<f64>,
}

/// Where a unit sat, as far as its rows say.
#[derive(Debug, Clone, Default, PartialEq, Eq, PartialOrd, Ord)]
#[expect(missing_docs, reason = "each field is named for the contract's column")]
pub struct Place {
    pub tail_number: Option<String>,
    pub position: Option<String>,
}

impl Place {
    /// Where a stay is.
    pub(crate) fn of(stay: &Installation) -> Self {
        Self { tail_number: Some(stay.tail_number.to_string()), position: Some(stay.position.to_string()) }
    }

    fn is(&self, tail_number: Option<&str>, position: Option<&str>) -> bool {
        self.tail_number.as_deref() == tail_number && self.position.as_deref() == position
    }
}

/// A unit's flights, by departure.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct History {
    places: Vec<Place>,
    flights: Vec<Flown>,
}

impl History {
    /// The flights, by departure.
    pub fn flights(&self) -> &[Flown] {
        &self.flights
    }

    /// The tails it was flown on.
    pub(crate) fn tails(&self) -> impl Iterator<Item = &str> {
        self.places.iter().filter_map(|place| place.tail_number.as_deref())
    }

    /// Those that departed at or before a time.
    pub(crate) fn until(&self, as_of: Timestamp) -> &[Flown] {
        &self.flights[..self.flights.partition_point(|f| f.departure_utc <= as_of)]
    }

    /// The one that departed then.
    pub(crate) fn at(&self, departure_utc: Timestamp) -> Option<&Flown> {
        let first = self.flights.partition_point(|f| f.departure_utc < departure_utc);
        self.flights.get(first).filter(|f| f.departure_utc == departure_utc)
    }

    /// Where one of them was flown.
    pub fn place(&self, flown: &Flown) -> &Place {
        &self.places[flown.place as usize]
    }

    /// The stay among some of the unit's that a flight belongs to.
    pub(crate) fn stay<'a>(&self, flown: &Flown, stays: &[&'a Installation]) -> Option<&'a Installation> {
        let Place { tail_number, position } = self.place(flown);
        let is_here = |stay: &&&Installation| {
            tail_number.as_deref() == Some(stay.tail_number.as_str())
                && position.as_deref() == Some(stay.position.as_str())
                && stay.covers(flown.departure_utc)
        };
        stays.iter().find(is_here).copied()
    }

    fn key<'a>(&'a self, flown: &'a Flown) -> Key<'a> {
        (flown.departure_utc, self.place(flown), flown.flight_id.as_deref())
    }

    fn place_of(&mut self, tail_number: Option<&str>, position: Option<&str>) -> u32 {
        // A unit sits where it sat in the row before, or in one of a handful of places.
        let known = self.places.iter().rposition(|place| place.is(tail_number, position));
        let at = known.unwrap_or_else(|| {
            let owned = |name: Option<&str>| name.map(str::to_owned);
            self.places.push(Place { tail_number: owned(tail_number), position: owned(position) });
            self.places.len() - 1
        });
        at as u32
    }

    /// The same whatever order the rows came in.
    fn sort(&mut self) {
        let places = &self.places;
        let place = |flown: &Flown| &places[flown.place as usize];
        let order = |a: &Flown, b: &Flown| {
            let names = || place(a).cmp(place(b)).then_with(|| a.flight_id.cmp(&b.flight_id));
            a.departure_utc.cmp(&b.departure_utc).then_with(names)
        };
        if !self.flights.is_sorted_by(|a, b| order(a, b) != Ordering::Greater) {
            self.flights.sort_by(order);
        }
    }
}

/// All units' flights.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Histories {
    units: BTreeMap<HistoryName, History>,
    is_booked: bool,
}

impl Histories {
    /// Whether these are the store's own, whose flights belong to stays of the installations table.
    ///
    /// Those of a table made elsewhere may be of other aircraft under the same names.
    pub(crate) fn is_booked(&self) -> bool {
        self.is_booked
    }

    /// Every unit and its flights, by name.
    pub fn iter(&self) -> impl Iterator<Item = (&HistoryName, &History)> {
        self.units.iter()
    }

    /// Every unit.
    pub fn names(&self) -> impl Iterator<Item = &HistoryName> {
        self.units.keys()
    }

    /// A unit's flights.
    pub fn get(&self, name: &HistoryName) -> Option<&History> {
        self.units.get(name)
    }

    /// The last departure of all.
    pub fn newest_utc(&self) -> Option<Timestamp> {
        self.units.values().filter_map(|history| history.flights.last()).map(|f| f.departure_utc).max()
    }

    /// The last departure of all but the flights that others hold.
    pub(crate) fn newest_without_utc(&self, others: &Self) -> Option<Timestamp> {
        let last = |(name, history): (&HistoryName, &History)| {
            let held = others.held(name);
            history.flights.iter().rev().find(|f| !held.contains(&history.key(f))).map(|f| f.departure_utc)
        };
        self.units.iter().filter_map(last).max()
    }

    /// The histories of some units without the flights that others hold; a unit left with none goes.
    pub(crate) fn without(&self, names: &BTreeSet<HistoryName>, others: &Self) -> Self {
        let left = |name: &HistoryName| {
            let (history, held) = (self.get(name)?, others.held(name));
            let flights = history.flights.iter().filter(|f| !held.contains(&history.key(f)));
            let left = History { places: history.places.clone(), flights: flights.cloned().collect() };
            (!left.flights.is_empty()).then(|| (name.clone(), left))
        };
        Self { units: names.iter().filter_map(left).collect(), is_booked: self.is_booked }
    }

    fn held(&self, name: &HistoryName) -> BTreeSet<Key<'_>> {
        let Some(history) = self.get(name) else { return BTreeSet::new() };
        history.flights.iter().map(|f| history.key(f)).collect()
    }
}

/// By what a unit's flight is known.
type Key<'a> = (Timestamp, &'a Place, Option<&'a str>);

/// Who flew, and where.
#[derive(Debug, Clone, Copy)]
#[expect(missing_docs, reason = "each field is named for the contract's column")]
pub struct Who<'a> {
    pub part_number: Option<&'a str>,
    pub serial_number: &'a str,
    pub tail_number: Option<&'a str>,
    pub position: Option<&'a str>,
}

/// Histories while their rows come in.
#[derive(Debug, Default)]
pub struct Gathering {
    /// Units by serial number; a serial number is unique only with its part number.
    by_serial: HashMap<String, Vec<usize>>,
    units: Vec<(HistoryName, History)>,
    last: usize,
}

impl Gathering {
    /// The columns a chunk may bring; `serial_number`, `departure_utc` and `gap_m` it must.
    pub const COLUMNS: [&'static str; 13] = [
        "serial_number",
        "serial",
        "part_number",
        "tail_number",
        "tail",
        "position",
        "flight_id",
        "departure_utc",
        "flight_hours",
        "tail_hours_end",
        "load_reversals",
        "gap_m",
        "gap_se_m",
    ];

    /// Puts down the rows of a chunk.
    ///
    /// # Errors
    /// When a column that must be there is not, and the first cell that cannot be read.
    pub fn add(&mut self, chunk: &Chunk) -> Result<(), ingest::Error> {
        let column = |names: &[&str]| chunk.column(names).map(Some);
        let (serial, departure) = (column(&["serial_number", "serial"])?, column(&["departure_utc"])?);
        let gaps_m = chunk.numbers(column(&["gap_m"])?)?;
        let (serials, departures) = (chunk.texts(serial)?, chunk.instants(departure)?);
        let text = |names: &[&str]| chunk.texts(chunk.find(names));
        let [parts, tails, positions, flights] =
            [&["part_number"][..], &["tail_number", "tail"], &["position"], &["flight_id"]].map(text);
        let (parts, tails, positions, flights) = (parts?, tails?, positions?, flights?);
        let [hours, meters, reversals, errors_m] =
            ["flight_hours", "tail_hours_end", "load_reversals", "gap_se_m"]
                .map(|name| chunk.numbers(chunk.find(&[name])));
        let (hours, meters, reversals, errors_m) = (hours?, meters?, reversals?, errors_m?);
        for row in 0..chunk.len() {
            let empty = |column| chunk.error(row, column, "it is empty".into());
            let serial_number = serials.get(row).ok_or_else(|| empty(serial))?;
            let departure_us = departures.is_valid(row).then(|| departures.value(row));
            let departure_utc = departure_us.ok_or_else(|| empty(departure))?;
            let departure_utc = Timestamp::from_microsecond(departure_utc)
                .map_err(|e| chunk.error(row, departure, e.to_string()))?;
            let who = Who {
                part_number: parts.get(row),
                serial_number,
                tail_number: tails.get(row),
                position: positions.get(row),
            };
            let flown = Flown {
                place: 0,
                row: 0,
                flight_id: flights.get(row).map(Box::from),
                departure_utc,
                flight_hours: at(&hours, row),
                tail_hours_end: at(&meters, row),
                load_reversals: at(&reversals, row).map(|n| n as u64),
                gap_m: at(&gaps_m, row),
                gap_se_m: at(&errors_m, row),
            };
            self.put(who, flown);
        }
        Ok(())
    }

    /// Puts down a flight, whose place and row are found here.
    pub fn put(&mut self, who: Who<'_>, flown: Flown) {
        let unit = self.unit(who.part_number, who.serial_number);
        let history = &mut self.units[unit].1;
        let (place, row) = (history.place_of(who.tail_number, who.position), history.flights.len() as u32);
        history.flights.push(Flown { place, row, ..flown });
    }

    /// Puts down what a record says.
    pub(crate) fn record(&mut self, record: &GapRecord) {
        let GapRecord { flight, estimate, .. } = record;
        let who = Who {
            part_number: Some(record.part_number.as_str()),
            serial_number: record.serial_number.as_str(),
            tail_number: Some(flight.tail_number.as_str()),
            position: Some(record.position.as_str()),
        };
        let flown = Flown {
            place: 0,
            row: 0,
            flight_id: Some(flight.flight_id.as_str().into()),
            departure_utc: flight.departure_utc,
            flight_hours: flight.flight_hours,
            tail_hours_end: flight.tail_hours_end,
            load_reversals: u64::try_from(estimate.load_reversals).ok(),
            gap_m: estimate.gap_m,
            gap_se_m: estimate.gap_se_m,
        };
        self.put(who, flown);
    }

    /// Where a unit is kept. Most tables have one unit's rows together, or one flight's.
    fn unit(&mut self, part_number: Option<&str>, serial_number: &str) -> usize {
        let is = |(part, serial): &HistoryName| serial == serial_number && part.as_deref() == part_number;
        if self.units.get(self.last).is_some_and(|(name, _)| is(name)) {
            return self.last;
        }
        let units = &self.units;
        let known = self.by_serial.get(serial_number);
        let known = known.and_then(|all| all.iter().copied().find(|&unit| is(&units[unit].0)));
        self.last = known.unwrap_or_else(|| {
            let name = (part_number.map(str::to_owned), serial_number.to_owned());
            self.by_serial.entry(name.1.clone()).or_default().push(self.units.len());
            self.units.push((name, History::default()));
            self.units.len() - 1
        });
        self.last
    }

    /// The histories of a table made elsewhere.
    pub fn foreign(self) -> Histories {
        self.finish(false)
    }

    /// The histories of the store, whose flights belong to stays of the installations table.
    pub fn booked(self) -> Histories {
        self.finish(true)
    }

    fn finish(self, is_booked: bool) -> Histories {
        let sorted = |(name, mut history): (HistoryName, History)| {
            // Room to grow is half as much again, and nothing grows any more.
            history.flights.shrink_to_fit();
            history.sort();
            (name, history)
        };
        Histories { units: self.units.into_iter().map(sorted).collect(), is_booked }
    }
}

/// The number of a row.
pub(crate) fn at(numbers: &Float64Array, row: usize) -> Option<f64> {
    numbers.is_valid(row).then(|| numbers.value(row))
}
