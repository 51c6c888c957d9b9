//! Histories while their rows come in, from tables of any length.

use std::collections::HashMap;
use std::ops::Range;
use std::path::Path;

use arrow::array::{Array, Float64Array, RecordBatch};
use ingest::tables::TableBatch;
use jiff::Timestamp;
use rayon::prelude::*;
use records::GapRecord;

use crate::error::Error;
use crate::flown::{Beside, Row};
use crate::histories::{Histories, HistoryName, Places};
use crate::joined::joined;
use crate::seats::{Names, Seats, Seen, Who};

/// Rows of a block: its 32 MiB are more than what any allocator keeps to itself once they are given up.
const BLOCK_ROWS: usize = 1 << 19;

/// Shares of a table that a worker is given: the slower one leaves some of its own to the others.
const SHARES: usize = 4;

/// Histories while their rows come in.
///
/// Most rows are of another unit than the row before. So they are put down in the order of arrival, and each unit's
/// are brought together at the end, when it is known how many there are: nothing grows, and no row is moved twice.
#[derive(Debug, Default)]
pub struct Gathering {
    /// Units by serial number; a serial number is unique only with its part number.
    by_serial: HashMap<String, Vec<usize>>,
    pub(crate) units: Vec<Counted>,
    last: usize,
    /// The unit that came after each the last time.
    follows: Vec<usize>,
    pub(crate) blocks: Vec<Block>,
}

/// A unit, and how much was put down of it.
#[derive(Debug)]
pub(crate) struct Counted {
    pub(crate) name: HistoryName,
    pub(crate) places: Places,
    pub(crate) rows: usize,
    /// Of its flights' names.
    pub(crate) bytes: usize,
}

/// Rows in the order of arrival, and their flights' names one after the other.
#[derive(Debug, Default)]
pub(crate) struct Block {
    pub(crate) rows: Vec<Put>,
    pub(crate) names: String,
}

/// A row that was put down.
#[derive(Debug)]
pub(crate) struct Put {
    pub(crate) unit: u32,
    /// Which of its unit's places it was flown in.
    pub(crate) place: u32,
    /// Where its flight's name ends in the block.
    pub(crate) name_end: u32,
    pub(crate) departure_us: i64,
    /// `NaN` for none.
    pub(crate) gap_m: f64,
    pub(crate) beside: Beside,
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
    pub fn add(&mut self, chunk: &TableBatch) -> Result<(), ingest::Error> {
        chunk.column(&["serial_number", "serial"])?;
        self.rows(chunk, &Seats::of(chunk)?, &Names::of(chunk, &["flight_id"])?)
    }

    /// Puts down rows of the store.
    ///
    /// # Errors
    /// The first cell that cannot be read.
    pub(crate) fn add_stored(&mut self, batch: RecordBatch) -> Result<(), ingest::Error> {
        self.add(&TableBatch::new(Path::new("results"), batch, 0))
    }

    fn rows(&mut self, chunk: &TableBatch, seats: &Seats, flights: &Names) -> Result<(), ingest::Error> {
        let column = |names: &[&str]| chunk.column(names).map(Some);
        let (serial, departure) = (chunk.find(&["serial_number", "serial"]), column(&["departure_utc"])?);
        let gaps_m = chunk.numbers(column(&["gap_m"])?)?;
        let departures = chunk.timestamps(departure)?;
        let [hours, meters, reversals, errors_m] =
            ["flight_hours", "tail_hours_end", "load_reversals", "gap_se_m"]
                .map(|name| chunk.numbers(chunk.find(&[name])));
        let (hours, meters, reversals, errors_m) = (hours?, meters?, reversals?, errors_m?);
        let mut seen = Seen::default();
        for row in 0..chunk.len() {
            let empty = |column| chunk.error(row, column, "it is empty".into());
            let seat = match seen.get(seats, row) {
                Some(seat) => seat,
                None => {
                    let seat = self.seat(seats.who(row).ok_or_else(|| empty(serial))?);
                    seen.put(seats, row, seat);
                    seat
                }
            };
            let departure_us = departures.is_valid(row).then(|| departures.value(row));
            let departure_utc = departure_us.ok_or_else(|| empty(departure))?;
            let departure_utc = Timestamp::from_microsecond(departure_utc)
                .map_err(|e| chunk.error(row, departure, e.to_string()))?;
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
        let (block, unit) = (&mut self.blocks[last], &mut self.units[seat.unit]);
        let name = row.flight_id.unwrap_or_default();
        block.names.push_str(name);
        block.rows.push(Put {
            unit: seat.unit as u32,
            place: seat.place,
            name_end: block.names.len() as u32,
            departure_us: row.departure_utc.as_microsecond(),
            gap_m: row.gap_m.unwrap_or(f64::NAN),
            beside: Beside::of(row),
        });
        unit.rows += 1;
        unit.bytes += name.len();
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
        Seat { unit, place: self.units[unit].places.number(who.tail_number, who.position) }
    }

    /// Where a unit is kept. Most tables have one unit's rows together, or the units in one order every night.
    fn unit(&mut self, part_number: Option<&str>, serial_number: &str) -> usize {
        let is = |(part, serial): &HistoryName| serial == serial_number && part.as_deref() == part_number;
        let units = &self.units;
        let follows = self.follows.get(self.last).copied();
        let expected = [Some(self.last), follows].into_iter().flatten();
        if let Some(unit) = expected.into_iter().find(|unit| units.get(*unit).is_some_and(|u| is(&u.name))) {
            self.last = unit;
            return unit;
        }
        let known = self.by_serial.get(serial_number);
        let known = known.and_then(|all| all.iter().copied().find(|&unit| is(&units[unit].name)));
        let unit = known.unwrap_or_else(|| self.new_unit(part_number, serial_number));
        self.follows[self.last] = unit;
        self.last = unit;
        unit
    }

    fn new_unit(&mut self, part_number: Option<&str>, serial_number: &str) -> usize {
        let (unit, name) = (self.units.len(), (part_number.map(str::to_owned), serial_number.to_owned()));
        self.by_serial.entry(name.1.clone()).or_default().push(unit);
        self.units.push(Counted { name, places: Places::default(), rows: 0, bytes: 0 });
        self.follows.push(0);
        unit
    }

    /// The histories of a table made elsewhere.
    pub fn foreign(self) -> Histories {
        joined(vec![self], false)
    }

    /// The histories of the store, whose flights belong to stays of the installations table.
    pub fn booked(self) -> Histories {
        joined(vec![self], true)
    }
}

/// The histories of a table in so many parts, `put` down in shares by all workers: the same as if one had put down
/// all of them in order.
///
/// # Errors
/// The first of the parts' errors.
pub(crate) fn of_parts(
    parts: usize,
    is_booked: bool,
    put: impl Fn(&mut Gathering, Range<usize>) -> Result<(), Error> + Sync,
) -> Result<Histories, Error> {
    let share = parts.div_ceil(SHARES * rayon::current_num_threads()).max(1);
    let shares: Vec<usize> = (0..parts).step_by(share).collect();
    let gathered = |first: &usize| {
        let mut gathering = Gathering::default();
        put(&mut gathering, *first..parts.min(first + share))?;
        Ok(gathering)
    };
    let gathered: Vec<Result<Gathering, Error>> = shares.par_iter().map(gathered).collect();
    Ok(joined(gathered.into_iter().collect::<Result<_, _>>()?, is_booked))
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
    use crate::flown::Flown;
    use crate::histories::History;

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
            stored.add_stored(batch(some, &coded)).unwrap();
            plain.add(&TableBatch::new("table".as_ref(), batch(some, &DataType::Utf8), 0)).unwrap();
        }
        let expected = told(&one_by_one(&rows));
        assert_eq!(told(&stored.booked()), expected);
        assert_eq!(told(&plain.booked()), expected);
    }

    /// All that is known of all units.
    fn told(histories: &Histories) -> Vec<String> {
        let of_unit = |(name, history): (&HistoryName, &History)| {
            let flight = |f: &Flown| {
                format!("{f:?} {:?} {:?} {:?}", history.place(f), history.flight_id(f), history.beside(f))
            };
            format!("{name:?} {:?}", history.flights().iter().map(flight).collect::<Vec<_>>())
        };
        histories.iter().map(of_unit).collect()
    }

    /// The order of parts decides, not that of the workers, of whom there may be more than parts or units.
    #[test]
    fn any_number_of_workers_brings_together_what_one_does() {
        let rows = rows();
        let expected = told(&one_by_one(&rows));
        let coded = DataType::Dictionary(Box::new(DataType::Int32), Box::new(DataType::Utf8));
        for (rows_of_part, workers) in [(600, 1), (600, 7), (90, 2), (41, 3), (7, 5)] {
            let parts: Vec<RecordBatch> = rows.chunks(rows_of_part).map(|some| batch(some, &coded)).collect();
            let put = |gathering: &mut Gathering, some: Range<usize>| {
                let mut some = parts[some].iter().cloned();
                some.try_for_each(|batch| gathering.add_stored(batch)).unwrap();
                Ok(())
            };
            let pool = rayon::ThreadPoolBuilder::new().num_threads(workers).build().unwrap();
            let found = pool.install(|| of_parts(parts.len(), true, put)).unwrap();
            assert!(told(&found) == expected, "{rows_of_part} rows a part, {workers} workers");
        }
        assert_eq!(of_parts(0, true, |_, _| Ok(())).unwrap().names().count(), 0);
    }

    /// Whoever is first, it is the table's first error that is told.
    #[test]
    fn of_several_errors_the_first_is_told() {
        let refuse = |_: &mut Gathering, some: Range<usize>| match some.start {
            0 => Ok(()),
            first => Err(Error::refused(
                TableBatch::new(
                    "t".as_ref(),
                    RecordBatch::new_empty(Arc::new(arrow::datatypes::Schema::empty())),
                    first,
                )
                .error(0, None, "bad".into())
                .diagnostic(),
            )),
        };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
        let error = pool.install(|| of_parts(24, true, refuse)).unwrap_err();
        assert!(format!("{error:?}").contains("row: Some(3)"), "{error:?}");
    }

    #[test]
    fn a_row_without_a_serial_number_is_told_by_its_number() {
        let mut rows = rows();
        rows[17].0[1] = Some("  ".into());
        let coded = DataType::Dictionary(Box::new(DataType::Int32), Box::new(DataType::Utf8));
        let error = Gathering::default().add_stored(batch(&rows, &coded)).unwrap_err();
        assert_eq!(error.diagnostic().location().unwrap(), "column `serial_number`, row 18");
    }
}
