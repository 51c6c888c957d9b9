//! Histories while their rows come in, from tables of any length.

use std::collections::HashMap;
use std::path::Path;

use arrow::array::{Array, Float64Array, RecordBatch};
use fleet::GapRecord;
use ingest::tables::Chunk;
use jiff::Timestamp;

use crate::flown::{Beside, Flown, Row};
use crate::histories::{Histories, History, HistoryName, Places};
use crate::seats::{Names, Seats, Seen, Who};
use crate::shelf::Shelves;

/// Rows of a block: its 36 MiB are more than what any allocator keeps to itself once they are given up.
const BLOCK_ROWS: usize = 1 << 19;

/// Histories while their rows come in.
///
/// Most rows are of another unit than the row before. So they are put down in the order of arrival, and each unit's
/// are brought together at the end, when it is known how many there are: nothing grows, and no row is moved twice.
#[derive(Debug, Default)]
pub struct Gathering {
    /// Units by serial number; a serial number is unique only with its part number.
    by_serial: HashMap<String, Vec<usize>>,
    units: Vec<(HistoryName, Places)>,
    /// Rows of each unit, and bytes of its flights' names.
    counts: Vec<(u32, usize)>,
    last: usize,
    /// The unit that came after each the last time.
    follows: Vec<usize>,
    blocks: Vec<Block>,
}

/// Rows in the order of arrival, and their flights' names one after the other.
#[derive(Debug, Default)]
struct Block {
    rows: Vec<Put>,
    names: String,
}

/// A row that was put down.
#[derive(Debug)]
struct Put {
    unit: u32,
    /// Where its flight's name ends in the block.
    name_end: u32,
    flown: Flown,
    beside: Beside,
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
        self.rows(chunk, &Seats::of_chunk(chunk)?, &Names::plain(chunk, &["flight_id"])?)
    }

    /// Puts down rows of the store, whose texts are dictionaries.
    ///
    /// # Errors
    /// The first cell that cannot be read.
    pub(crate) fn add_stored(&mut self, batch: &RecordBatch) -> Result<(), ingest::Error> {
        let chunk = Chunk::new(Path::new("results"), batch.clone(), 0);
        let flights = Names::stored(batch, &chunk, "flight_id")?;
        self.rows(&chunk, &Seats::stored(batch, &chunk)?, &flights)
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
            let serial_number = seats.serial(row).ok_or_else(|| empty(serial))?;
            let departure_us = departures.is_valid(row).then(|| departures.value(row));
            let departure_utc = departure_us.ok_or_else(|| empty(departure))?;
            let departure_utc = Timestamp::from_microsecond(departure_utc)
                .map_err(|e| chunk.error(row, departure, e.to_string()))?;
            let seat = seen.get(seats, row).unwrap_or_else(|| {
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
            self.put_down(seat, &said);
        }
        Ok(())
    }

    /// Puts down a flight.
    pub fn put(&mut self, who: Who<'_>, row: &Row<'_>) {
        let seat = self.seat(who);
        self.put_down(seat, row);
    }

    fn put_down(&mut self, seat: Seat, row: &Row<'_>) {
        if self.blocks.last().is_none_or(|block| block.rows.len() == BLOCK_ROWS) {
            self.blocks.push(Block { rows: Vec::with_capacity(BLOCK_ROWS), names: String::new() });
        }
        let last = self.blocks.len() - 1;
        let block = &mut self.blocks[last];
        let (rows, bytes) = &mut self.counts[seat.unit];
        let name = row.flight_id.unwrap_or_default();
        block.names.push_str(name);
        block.rows.push(Put {
            unit: seat.unit as u32,
            name_end: block.names.len() as u32,
            flown: Flown::new(row, seat.place, *rows),
            beside: Beside::of(row),
        });
        *rows += 1;
        *bytes += name.len();
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
        Seat { unit, place: self.units[unit].1.number(who.tail_number, who.position) }
    }

    /// Where a unit is kept. Most tables have one unit's rows together, or the units in one order every night.
    fn unit(&mut self, part_number: Option<&str>, serial_number: &str) -> usize {
        let is = |(part, serial): &HistoryName| serial == serial_number && part.as_deref() == part_number;
        let units = &self.units;
        let follows = self.follows.get(self.last).copied();
        let expected = [Some(self.last), follows].into_iter().flatten();
        if let Some(unit) = expected.into_iter().find(|unit| units.get(*unit).is_some_and(|(n, _)| is(n))) {
            self.last = unit;
            return unit;
        }
        let known = self.by_serial.get(serial_number);
        let known = known.and_then(|all| all.iter().copied().find(|&unit| is(&units[unit].0)));
        let unit = known.unwrap_or_else(|| self.new_unit(part_number, serial_number));
        self.follows[self.last] = unit;
        self.last = unit;
        unit
    }

    fn new_unit(&mut self, part_number: Option<&str>, serial_number: &str) -> usize {
        let (unit, name) = (self.units.len(), (part_number.map(str::to_owned), serial_number.to_owned()));
        self.by_serial.entry(name.1.clone()).or_default().push(unit);
        self.units.push((name, Places::default()));
        self.counts.push((0, 0));
        self.follows.push(0);
        unit
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
        let mut in_order: Vec<usize> = (0..self.units.len()).collect();
        in_order.sort_by_key(|unit| &self.units[*unit].0);
        let rows: Vec<usize> = self.counts.iter().map(|(rows, _)| *rows as usize).collect();
        let mut shelves = Shelves::with_room(&rows, in_order.into_iter());
        let rooms = self.units.into_iter().zip(self.counts);
        let room = |((name, places), (rows, bytes))| (name, History::with_room(places, rows as usize, bytes));
        let mut units: Vec<(HistoryName, History)> = rooms.map(room).collect();
        // Each block is given up before the next is read.
        for Block { rows, names } in self.blocks {
            let mut begin = 0;
            for Put { unit, name_end, flown, beside } in rows {
                let (unit, name) = (unit as usize, &names[begin..name_end as usize]);
                shelves.put(unit, flown.row, beside);
                units[unit].1.put(flown, name);
                begin = name_end as usize;
            }
        }
        let full = units.into_iter().zip(shelves.of_units());
        let full = full.map(|((name, history), beside)| (name, history.finish(beside)));
        Histories::new(full.collect(), is_booked)
    }
}

/// A unit, and one of its places.
#[derive(Debug, Clone, Copy)]
struct Seat {
    unit: usize,
    place: u32,
}

/// The number of a row.
pub(crate) fn at(numbers: &Float64Array, row: usize) -> Option<f64> {
    numbers.is_valid(row).then(|| numbers.value(row))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use arrow::array::{ArrayRef, Int64Array, StringArray, TimestampMicrosecondArray};
    use arrow::compute::cast;
    use arrow::datatypes::DataType;

    use super::*;

    /// Whole numbers below a bound that look like chance.
    fn chances() -> impl FnMut(u64) -> u64 {
        let mut state = 7_u64;
        move |bound| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) % bound
        }
    }

    /// A row's texts (part, serial number, tail, position, flight), its departure and its gap.
    type Cells = ([Option<String>; 5], i64, Option<f64>);

    /// Serial numbers of two parts, units that move about, names with a blank, and flights that arrive late.
    fn rows() -> Vec<Cells> {
        let mut chance = chances();
        let mut row = |at: i64| {
            let mut text = |name: &str, count| (chance(9) > 0).then(|| format!("{name}{}", chance(count)));
            let (part, tail, position, flight) =
                (text("P", 2), text("T", 3), text("place ", 2), text(" F", 40));
            let serial = Some(format!("S{}", chance(4)));
            let departure_us = 1_000_000 * (at - chance(20) as i64);
            ([part, serial, tail, position, flight], departure_us, (chance(5) > 0).then(|| chance(90) as f64))
        };
        (0..600).map(&mut row).collect()
    }

    fn batch(rows: &[Cells], texts: &DataType) -> RecordBatch {
        let names = ["part_number", "serial_number", "tail_number", "position", "flight_id"];
        let text = |column: usize| {
            let plain: StringArray = rows.iter().map(|(texts, ..)| texts[column].as_deref()).collect();
            cast(&plain, texts).unwrap()
        };
        let departures: TimestampMicrosecondArray = rows.iter().map(|row| Some(row.1)).collect();
        let gaps_m: Float64Array = rows.iter().map(|row| row.2).collect();
        let reversals: Int64Array = rows.iter().map(|row| row.2.map(|gap| gap as i64)).collect();
        let numbers: [(&str, ArrayRef); 3] = [
            ("departure_utc", Arc::new(departures)),
            ("gap_m", Arc::new(gaps_m)),
            ("load_reversals", Arc::new(reversals)),
        ];
        let texts = names.into_iter().enumerate().map(|(column, name)| (name, text(column)));
        RecordBatch::try_from_iter(texts.chain(numbers)).unwrap()
    }

    /// Each row by itself, as the tables mean it.
    fn one_by_one(rows: &[Cells]) -> Histories {
        let mut gathering = Gathering::default();
        for ([part, serial, tail, position, flight], departure_us, gap_m) in rows {
            let who = Who {
                part_number: part.as_deref(),
                serial_number: serial.as_deref().unwrap(),
                tail_number: tail.as_deref(),
                position: position.as_deref(),
            };
            let row = Row {
                flight_id: flight.as_deref().map(str::trim),
                departure_utc: Timestamp::from_microsecond(*departure_us).unwrap(),
                flight_hours: None,
                tail_hours_end: None,
                load_reversals: gap_m.map(|gap| gap as u64),
                gap_m: *gap_m,
                gap_se_m: None,
            };
            gathering.put(who, &row);
        }
        gathering.booked()
    }

    #[test]
    fn rows_of_the_store_and_of_a_foreign_table_are_what_each_of_them_is_by_itself() {
        let rows = rows();
        let coded = DataType::Dictionary(Box::new(DataType::Int32), Box::new(DataType::Utf8));
        let (mut stored, mut plain) = (Gathering::default(), Gathering::default());
        // In other parts names have other codes.
        for some in rows.chunks(230) {
            stored.add_stored(&batch(some, &coded)).unwrap();
            plain.add(&Chunk::new("table".as_ref(), batch(some, &DataType::Utf8), 0)).unwrap();
        }
        let expected = format!("{:?}", one_by_one(&rows));
        assert_eq!(format!("{:?}", stored.booked()), expected);
        assert_eq!(format!("{:?}", plain.booked()), expected);
    }

    #[test]
    fn a_row_without_a_serial_number_is_told_by_its_number() {
        let mut rows = rows();
        rows[17].0[1] = Some("  ".into());
        let coded = DataType::Dictionary(Box::new(DataType::Int32), Box::new(DataType::Utf8));
        let error = Gathering::default().add_stored(&batch(&rows, &coded)).unwrap_err();
        assert_eq!(error.complaint().place().unwrap(), "column `serial_number`, row 18");
    }
}
