//! Rows of tables of any length, grouped by unit while they are read.

use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use arrow::array::{Array, Float64Array, RecordBatch};
use ingest::tables::{StringColumn, TableBatch};
use jiff::Timestamp;
use rayon::prelude::*;
use store::ColumnScan;

use crate::error::Error;
use crate::fleet::flight_row::{StoredFlight, TailPosition, UnitKey, place_number};

/// Number of shares of a table for each worker: more than one, so that faster workers take more of them.
const SHARES: usize = 4;

/// Number of gaps and latest departure, µs since 1970 UTC, by the digest of the settings of the estimate. A unit has one or
/// two digests, so a linear search finds that of a row.
#[derive(Debug, Clone, Default)]
pub(crate) struct SettingsCounts(Vec<(String, usize, i64)>);

impl SettingsCounts {
    pub(crate) fn add(&mut self, settings: &str, gaps: usize, latest_us: i64) {
        match self.0.iter_mut().find(|(known, ..)| known == settings) {
            Some((_, count, latest)) => {
                *count += gaps;
                *latest = latest_us.max(*latest);
            }
            None => self.0.push((settings.to_owned(), gaps, latest_us)),
        }
    }

    pub(crate) fn add_all(&mut self, others: &Self) {
        others.0.iter().for_each(|(settings, gaps, latest_us)| self.add(settings, *gaps, *latest_us));
    }

    /// Number of gaps with other settings than the latest gap, the latest departure of these gaps, and the number of all
    /// gaps; `None` if all gaps have the same settings.
    pub(crate) fn others(&self) -> Option<(usize, Timestamp, usize)> {
        let latest_us = self.0.iter().map(|(_, _, us)| *us).max()?;
        let others = || self.0.iter().filter(|(_, _, us)| *us < latest_us);
        let last_us = others().map(|(_, _, us)| *us).max()?;
        let all = self.0.iter().map(|(_, gaps, _)| gaps).sum();
        Some((others().map(|(_, gaps, _)| gaps).sum(), Timestamp::from_microsecond(last_us).ok()?, all))
    }
}

/// Flights of one unit, in the order of arrival.
#[derive(Debug, Default)]
pub(crate) struct UnitRows {
    /// Places of the unit; a flight holds the index of its place.
    pub(crate) places: Vec<TailPosition>,
    pub(crate) names: String,
    /// Gaps by the settings that they were estimated with.
    pub(crate) settings: SettingsCounts,
    /// Number of rows of the table before the part from which the flights count their rows.
    rows_before: u32,
    pub(crate) rows: Vec<StoredFlight>,
}

impl UnitRows {
    pub(crate) fn concatenated(parts: Vec<Self>) -> Self {
        let mut all = Self::default();
        all.rows.reserve_exact(parts.iter().map(|part| part.rows.len()).sum());
        all.names.reserve_exact(parts.iter().map(|part| part.names.len()).sum());
        for mut part in parts {
            let number = |place: &TailPosition| {
                place_number(&mut all.places, place.tail_number.as_deref(), place.position.as_deref())
            };
            let places: Vec<u32> = part.places.iter().map(number).collect();
            let names = all.names.len() as u32;
            let moved = |(flown, _): &mut StoredFlight| flown.relocate(&places, part.rows_before, names);
            part.rows.iter_mut().for_each(moved);
            all.rows.append(&mut part.rows);
            all.names.push_str(&part.names);
            all.settings.add_all(&part.settings);
        }
        all
    }
}

/// Index of a unit, and index of a place of this unit.
type Seat = (usize, u32);

pub(crate) struct KeyColumns {
    pub(crate) serials: StringColumn,
    pub(crate) parts: StringColumn,
    pub(crate) tails: StringColumn,
    pub(crate) positions: StringColumn,
    /// Last row of each serial number with its seat, by dictionary code plus 1; entry 0 is of serial numbers without a code.
    seats: Vec<Option<(usize, Seat)>>,
}

impl KeyColumns {
    /// Columns that identify unit and place, under all their accepted names.
    pub(crate) const COLUMNS: [&'static str; 6] =
        ["serial_number", "serial", "part_number", "tail_number", "tail", "position"];

    pub(crate) fn of(chunk: &TableBatch) -> Result<Self, ingest::Error> {
        let column = |names: &[&str]| chunk.texts(chunk.find(names));
        Ok(Self {
            serials: column(&["serial_number", "serial"])?,
            parts: column(&["part_number"])?,
            tails: column(&["tail_number", "tail"])?,
            positions: column(&["position"])?,
            seats: Vec::new(),
        })
    }

    /// The seat of a row: that of the last row with this serial number if all keys are equal, else the result of `find`.
    pub(crate) fn seat(
        &mut self,
        row: usize,
        find: impl FnOnce(&Self) -> Result<Seat, ingest::Error>,
    ) -> Result<Seat, ingest::Error> {
        let entry = self.serials.code(row).map_or(0, |code| code + 1);
        let known = self.seats.get(entry).copied().flatten();
        if let Some((_, seat)) = known.filter(|(before, _)| self.are_same(*before, row)) {
            return Ok(seat);
        }
        let seat = find(self)?;
        self.seats.resize(self.seats.len().max(entry + 1), None);
        self.seats[entry] = Some((row, seat));
        Ok(seat)
    }

    /// Whether two rows are of one unit in one place.
    fn are_same(&self, a: usize, b: usize) -> bool {
        [&self.serials, &self.positions, &self.tails, &self.parts].iter().all(|names| names.are_same(a, b))
    }
}

/// Flights by unit, while a table is read.
#[derive(Debug, Default)]
pub(crate) struct RowsByUnit {
    /// Units by serial number; a serial number is unique only with its part number.
    by_serial: HashMap<String, Vec<usize>>,
    units: Vec<(UnitKey, UnitRows)>,
    /// Number of rows read.
    count: u32,
}

/// The parts of each unit's rows, in the order of the parts of the table.
pub(crate) type PartsByUnit = BTreeMap<UnitKey, Vec<UnitRows>>;

impl RowsByUnit {
    /// Passes each row of a table to `read`: its number, the rows of its unit, to which `read` adds, the index of its place,
    /// and its number among all rows read so far.
    pub(crate) fn add_rows(
        &mut self,
        chunk: &TableBatch,
        mut read: impl FnMut(usize, &mut UnitRows, (u32, u32)) -> Result<(), ingest::Error>,
    ) -> Result<(), ingest::Error> {
        let mut keys = KeyColumns::of(chunk)?;
        for row in chunk.rows() {
            let (unit, place) = keys.seat(row, |keys| {
                let column = chunk.find(&["serial_number", "serial"]);
                let empty = || chunk.error(row, column, "it is empty".into());
                let unit = self.unit(keys.parts.get(row), keys.serials.get(row).ok_or_else(empty)?);
                let places = &mut self.units[unit].1.places;
                Ok((unit, place_number(places, keys.tails.get(row), keys.positions.get(row))))
            })?;
            read(row, &mut self.units[unit].1, (place, self.count))?;
            self.count += 1;
        }
        Ok(())
    }

    fn unit(&mut self, part_number: Option<&str>, serial_number: &str) -> usize {
        let is_it = |unit: &&usize| self.units[**unit].0.0.as_deref() == part_number;
        if let Some(unit) = self.by_serial.get(serial_number).and_then(|all| all.iter().find(is_it)) {
            return *unit;
        }
        let (unit, name) = (self.units.len(), (part_number.map(str::to_owned), serial_number.to_owned()));
        self.by_serial.entry(name.1.clone()).or_default().push(unit);
        self.units.push((name, UnitRows::default()));
        unit
    }
}

/// The rows of a table in several parts, by unit. The workers read shares of the parts in parallel; the result is the same
/// as if one worker read all parts in order.
///
/// # Errors
/// The first of the parts' errors.
pub(crate) fn of_parts(
    parts: usize,
    put: impl Fn(&mut RowsByUnit, usize) -> Result<(), Error> + Sync,
) -> Result<PartsByUnit, Error> {
    let share = parts.div_ceil(SHARES * rayon::current_num_threads()).max(1);
    let shares: Vec<usize> = (0..parts).step_by(share).collect();
    let rows = |first: &usize| {
        let mut rows = RowsByUnit::default();
        (*first..parts.min(first + share)).try_for_each(|part| put(&mut rows, part))?;
        Ok(rows)
    };
    let of_shares: Vec<Result<RowsByUnit, Error>> = shares.par_iter().map(rows).collect();
    let (mut found, mut rows_before) = (PartsByUnit::new(), 0);
    for rows in of_shares {
        let RowsByUnit { units, count, .. } = rows?;
        for (name, rows) in units {
            found.entry(name).or_default().push(UnitRows { rows_before, ..rows });
        }
        rows_before += count;
    }
    Ok(found)
}

/// Values of further columns of the store's rows, in the order of the rows; `read` converts the rows of a batch.
///
/// # Errors
/// If a part cannot be read, or `read` fails.
pub(crate) fn further_columns<R: Send, F: Fn(usize) -> R>(
    stored: &ColumnScan,
    names: &[&str],
    read: impl Fn(&TableBatch, &RecordBatch) -> Result<F, ingest::Error> + Sync,
) -> Result<Vec<R>, Error> {
    let scan = stored.with_columns(names)?;
    let of_part = |part| {
        let mut rows = Vec::new();
        for (chunk, batch) in batches(&scan, part)? {
            rows.extend(chunk.rows().map(read(&chunk, &batch)?));
        }
        Ok(rows)
    };
    let parts = (0..scan.file_count()).into_par_iter().map(of_part).collect::<Result<Vec<_>, Error>>()?;
    let mut all = Vec::with_capacity(parts.iter().map(Vec::len).sum());
    parts.into_iter().for_each(|part| all.extend(part));
    Ok(all)
}

/// The batches of a part of the store: each as a table with columns by name, and as stored.
pub(crate) fn batches(scan: &ColumnScan, part: usize) -> Result<Vec<(TableBatch, RecordBatch)>, Error> {
    let named = |batch: RecordBatch| (TableBatch::new(Path::new("results"), batch.clone(), 0), batch);
    Ok(scan.read(part)?.into_iter().map(named).collect())
}

/// The number of a row; `None` if null.
pub(crate) fn at(numbers: &Float64Array, row: usize) -> Option<f64> {
    numbers.is_valid(row).then(|| numbers.value(row))
}

/// The number of a row; NaN if null.
pub(crate) fn number(numbers: &Float64Array, row: usize) -> f64 {
    at(numbers, row).unwrap_or(f64::NAN)
}
