//! Histories while their rows come in, from tables of any length.

use std::collections::HashMap;
use std::path::Path;

use arrow::array::{Array, ArrayRef, AsArray, DictionaryArray, Float64Array, RecordBatch, StringArray};
use arrow::datatypes::Int32Type;
use fleet::GapRecord;
use ingest::tables::{Chunk, Texts};
use jiff::Timestamp;

use crate::flown::Row;
use crate::histories::{Histories, History, HistoryName};

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
        chunk.column(&["serial_number", "serial"])?;
        let columns: [&[&str]; 5] = [
            &["serial_number", "serial"],
            &["part_number"],
            &["tail_number", "tail"],
            &["position"],
            &["flight_id"],
        ];
        let [serials, parts, tails, positions, flights] =
            columns.map(|names| chunk.texts(chunk.find(names)).map(Names::Plain));
        self.rows(
            chunk,
            &Seats { serials: serials?, parts: parts?, tails: tails?, positions: positions? },
            &flights?,
        )
    }

    /// Puts down rows of the store, whose texts are dictionaries.
    ///
    /// # Errors
    /// The first cell that cannot be read.
    pub(crate) fn add_stored(&mut self, batch: &RecordBatch) -> Result<(), ingest::Error> {
        let chunk = Chunk::new(Path::new("results"), batch.clone(), 0);
        let names = |name: &str| {
            let coded = batch.column_by_name(name).and_then(Names::coded);
            coded.map_or_else(|| Ok(Names::Plain(chunk.texts(chunk.find(&[name]))?)), Ok)
        };
        let [serials, parts, tails, positions, flights] =
            ["serial_number", "part_number", "tail_number", "position", "flight_id"].map(names);
        self.rows(
            &chunk,
            &Seats { serials: serials?, parts: parts?, tails: tails?, positions: positions? },
            &flights?,
        )
    }

    fn rows(&mut self, chunk: &Chunk, seats: &Seats, flights: &Names) -> Result<(), ingest::Error> {
        let column = |names: &[&str]| chunk.column(names).map(Some);
        let (serial, departure) = (chunk.find(&["serial_number", "serial"]), column(&["departure_utc"])?);
        let gaps_m = chunk.numbers(column(&["gap_m"])?)?;
        let departures = chunk.instants(departure)?;
        let [hours, meters, reversals, errors_m] =
            ["flight_hours", "tail_hours_end", "load_reversals", "gap_se_m"]
                .map(|name| chunk.numbers(chunk.find(&[name])));
        let (hours, meters, reversals, errors_m) = (hours?, meters?, reversals?, errors_m?);
        let mut seen = Seen::default();
        for row in 0..chunk.len() {
            let empty = |column| chunk.error(row, column, "it is empty".into());
            let serial_number = seats.serials.get(row).ok_or_else(|| empty(serial))?;
            let departure_us = departures.is_valid(row).then(|| departures.value(row));
            let departure_utc = departure_us.ok_or_else(|| empty(departure))?;
            let departure_utc = Timestamp::from_microsecond(departure_utc)
                .map_err(|e| chunk.error(row, departure, e.to_string()))?;
            let seat = seen.seat(seats, row).unwrap_or_else(|| {
                let seat = self.seat(seats.who(row, serial_number));
                seen.put(seats, row, seat);
                seat
            });
            let said = Row {
                flight_id: flights.get(row),
                departure_utc,
                flight_hours: at(&hours, row),
                tail_hours_end: at(&meters, row),
                load_reversals: at(&reversals, row).map(|n| n as u64),
                gap_m: at(&gaps_m, row),
                gap_se_m: at(&errors_m, row),
            };
            self.units[seat.unit].1.put(seat.place, &said);
        }
        Ok(())
    }

    /// Puts down a flight.
    pub fn put(&mut self, who: Who<'_>, row: &Row<'_>) {
        let seat = self.seat(who);
        self.units[seat.unit].1.put(seat.place, row);
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
        let row = Row {
            flight_id: Some(flight.flight_id.as_str()),
            departure_utc: flight.departure_utc,
            flight_hours: flight.flight_hours,
            tail_hours_end: flight.tail_hours_end,
            load_reversals: u64::try_from(estimate.load_reversals).ok(),
            gap_m: estimate.gap_m,
            gap_se_m: estimate.gap_se_m,
        };
        self.put(who, &row);
    }

    fn seat(&mut self, who: Who<'_>) -> Seat {
        let unit = self.unit(who.part_number, who.serial_number);
        Seat { unit, place: self.units[unit].1.place_of(who.tail_number, who.position) }
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

    fn finish(mut self, is_booked: bool) -> Histories {
        self.units.iter_mut().for_each(|(_, history)| history.finish());
        Histories::new(self.units.into_iter().collect(), is_booked)
    }
}

/// A unit, and one of its places.
#[derive(Debug, Clone, Copy)]
struct Seat {
    unit: usize,
    place: u32,
}

/// Who flew and where, row by row.
struct Seats {
    serials: Names,
    parts: Names,
    tails: Names,
    positions: Names,
}

impl Seats {
    fn who<'a>(&'a self, row: usize, serial_number: &'a str) -> Who<'a> {
        Who {
            part_number: self.parts.get(row),
            serial_number,
            tail_number: self.tails.get(row),
            position: self.positions.get(row),
        }
    }

    /// Whether two rows are of one unit in one place.
    fn are_same(&self, a: usize, b: usize) -> bool {
        [&self.serials, &self.positions, &self.tails, &self.parts].iter().all(|names| names.are_same(a, b))
    }
}

/// Seats of the rows before: the last one, and the last one of each serial number where these have codes.
#[derive(Default)]
struct Seen {
    last: Option<(usize, Seat)>,
    by_code: Vec<Option<(usize, Seat)>>,
}

impl Seen {
    fn seat(&self, seats: &Seats, row: usize) -> Option<Seat> {
        let of_code = match seats.serials.code(row) {
            Some(code) => self.by_code.get(code).copied().flatten(),
            None => self.last,
        };
        of_code.filter(|(before, _)| seats.are_same(*before, row)).map(|(_, seat)| seat)
    }

    fn put(&mut self, seats: &Seats, row: usize, seat: Seat) {
        self.last = Some((row, seat));
        let Some(code) = seats.serials.code(row) else { return };
        if self.by_code.len() <= code {
            self.by_code.resize(code + 1, None);
        }
        self.by_code[code] = self.last;
    }
}

/// Texts of a column: each by itself, or as a code for one of a few.
enum Names {
    Plain(Texts),
    Coded(DictionaryArray<Int32Type>, StringArray),
}

impl Names {
    fn coded(column: &ArrayRef) -> Option<Self> {
        let coded = column.as_dictionary_opt::<Int32Type>()?;
        Some(Self::Coded(coded.clone(), coded.values().as_string_opt::<i32>()?.clone()))
    }

    /// The text of a row, trimmed; an empty one is none.
    fn get(&self, row: usize) -> Option<&str> {
        match self {
            Self::Plain(texts) => texts.get(row),
            Self::Coded(_, texts) => {
                let code = self.code(row)?;
                let text = texts.is_valid(code).then(|| texts.value(code).trim())?;
                (!text.is_empty()).then_some(text)
            }
        }
    }

    fn code(&self, row: usize) -> Option<usize> {
        match self {
            Self::Plain(_) => None,
            Self::Coded(coded, _) => coded.key(row),
        }
    }

    fn are_same(&self, a: usize, b: usize) -> bool {
        match self {
            Self::Plain(texts) => texts.get(a) == texts.get(b),
            Self::Coded(..) => self.code(a) == self.code(b),
        }
    }
}

/// The number of a row.
pub(crate) fn at(numbers: &Float64Array, row: usize) -> Option<f64> {
    numbers.is_valid(row).then(|| numbers.value(row))
}
