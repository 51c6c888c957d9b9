//! Histories while their rows come in, from tables of any length.

use std::collections::HashMap;
use std::path::Path;

use arrow::array::{Array, AsArray, Float64Array, ListArray, RecordBatch};
use ingest::tables::TableBatch;
use jiff::Timestamp;

use crate::fleet::flight_row::{FlightExtras, FlightInput};
use crate::fleet::histories::{Positions, UnitKey};
use crate::fleet::row_keys::{KeyCache, KeyColumns, RowKey, TextColumn};
use crate::fleet::settings_counts::SettingsCounts;

/// Rows of a block: its 32 MiB are more than what any allocator keeps to itself once they are given up.
const BLOCK_ROWS: usize = 1 << 19;

/// The flag of a record whose two estimators disagree, and the column with the gap of the other one.
const DISAGREE: &str = "estimators_disagree";
const OTHER_GAP: &str = "gap_midrange_fitted_m";
/// The column with the digest of the settings of the estimate.
const SETTINGS: &str = "config_digest";

/// Builder of histories from rows.
///
/// Most rows belong to another unit than the row before. So rows are stored in the order of arrival, and each unit's
/// rows are collected at the end, when their number is known: no buffer grows, and no row is moved twice.
#[derive(Debug, Default)]
pub struct HistoryBuilder {
    /// Units by serial number; a serial number is unique only with its part number.
    by_serial: HashMap<String, Vec<usize>>,
    pub(crate) units: Vec<UnitEntry>,
    last: usize,
    /// The unit that came after each the last time.
    follows: Vec<usize>,
    pub(crate) blocks: Vec<RowBlock>,
}

/// A unit, and the number of its stored rows.
#[derive(Debug, Default)]
pub(crate) struct UnitEntry {
    pub(crate) name: UnitKey,
    pub(crate) places: Positions,
    pub(crate) rows: usize,
    /// Of its flights' names.
    pub(crate) bytes: usize,
    /// Its gaps by the settings that they were estimated with.
    pub(crate) settings: SettingsCounts,
}

/// Rows in the order of arrival, and their flights' names one after the other.
#[derive(Debug, Default)]
pub(crate) struct RowBlock {
    pub(crate) rows: Vec<StagedRow>,
    pub(crate) names: String,
}

/// A stored row.
#[derive(Debug)]
pub(crate) struct StagedRow {
    pub(crate) unit: u32,
    /// Which of its unit's places it was flown in.
    pub(crate) place: u32,
    /// Where its flight's name ends in the block.
    pub(crate) name_end: u32,
    pub(crate) departure_us: i64,
    /// `NaN` for none.
    pub(crate) gap_m: f64,
    pub(crate) extras: FlightExtras,
}

impl HistoryBuilder {
    /// The columns a chunk may bring; `serial_number`, `departure_utc` and `gap_m` it must.
    pub const COLUMNS: [&'static str; 14] = [
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
        "flags",
    ];

    /// The columns that the store's own rows bring.
    pub(crate) fn of_store() -> Vec<&'static str> {
        let stored = Self::COLUMNS.into_iter().filter(|name| !["serial", "tail", "flags"].contains(name));
        stored.chain(["flags", OTHER_GAP, SETTINGS]).collect()
    }

    /// Adds the rows of a batch.
    ///
    /// # Errors
    /// When a column that must be there is not, and the first cell that cannot be read.
    pub fn add(&mut self, chunk: &TableBatch) -> Result<(), ingest::Error> {
        let texts = TextColumn::of(chunk, &["flags"])?;
        // A list without flags is written as `[]`.
        let has_flags = |row: usize| texts.get(row).is_some_and(|flags| flags != "[]");
        self.add_with_flags(chunk, &|row, gap_m, _| has_flags(row).then_some(gap_m))
    }

    fn add_with_flags(&mut self, chunk: &TableBatch, other_gap: OtherGap<'_>) -> Result<(), ingest::Error> {
        chunk.column(&["serial_number", "serial"])?;
        self.rows(chunk, &KeyColumns::of(chunk)?, &TextColumn::of(chunk, &["flight_id"])?, other_gap)
    }

    /// Adds rows of the store.
    ///
    /// # Errors
    /// The first cell that cannot be read.
    pub(crate) fn add_store_batch(&mut self, batch: RecordBatch) -> Result<(), ingest::Error> {
        let flags = batch.column_by_name("flags").and_then(|flags| flags.as_list_opt::<i32>()).cloned();
        let is_disputed = |row: usize| flags.as_ref().is_some_and(|flags| disagree(flags, row));
        let other_gap = |row, _, other_m: Option<f64>| other_m.filter(|_| is_disputed(row));
        self.add_with_flags(&TableBatch::new(Path::new("results"), batch, 0), &other_gap)
    }

    fn rows(
        &mut self,
        chunk: &TableBatch,
        position_keys: &KeyColumns,
        flights: &TextColumn,
        other_gap: OtherGap<'_>,
    ) -> Result<(), ingest::Error> {
        let column = |names: &[&str]| chunk.column(names).map(Some);
        let (serial, departure) = (chunk.find(&["serial_number", "serial"]), column(&["departure_utc"])?);
        let gaps_m = chunk.numbers(column(&["gap_m"])?)?;
        let departures = chunk.timestamps(departure)?;
        let [hours, meters, reversals, errors_m] =
            ["flight_hours", "tail_hours_end", "load_reversals", "gap_se_m"]
                .map(|name| chunk.numbers(chunk.find(&[name])));
        let (hours, meters, reversals, errors_m) = (hours?, meters?, reversals?, errors_m?);
        let others_m = chunk.numbers(chunk.find(&[OTHER_GAP]))?;
        let mut seen = KeyCache::default();
        let settings = TextColumn::of(chunk, &[SETTINGS])?;
        for row in 0..chunk.len() {
            let empty = |column| chunk.error(row, column, "it is empty".into());
            let position_key = match seen.get(position_keys, row) {
                Some(position_key) => position_key,
                None => {
                    let position_key =
                        self.position_key(position_keys.key_at(row).ok_or_else(|| empty(serial))?);
                    seen.put(position_keys, row, position_key);
                    position_key
                }
            };
            let departure_us = departures.is_valid(row).then(|| departures.value(row));
            let departure_utc = departure_us.ok_or_else(|| empty(departure))?;
            let departure_utc = Timestamp::from_microsecond(departure_utc)
                .map_err(|e| chunk.error(row, departure, e.to_string()))?;
            let said = FlightInput {
                flight_id: flights.get(row),
                departure_utc,
                flight_hours: at(&hours, row),
                tail_hours_end: at(&meters, row),
                load_reversals: at(&reversals, row).map(|n| n as u64),
                gap_m: at(&gaps_m, row),
                gap_se_m: at(&errors_m, row),
                disagreeing_gap_m: at(&gaps_m, row)
                    .and_then(|gap_m| other_gap(row, gap_m, at(&others_m, row))),
            };
            self.push_row(position_key, &said);
            if let Some(settings) = settings.get(row).filter(|_| said.gap_m.is_some()) {
                let latest_us = said.departure_utc.as_microsecond();
                self.units[position_key.unit].settings.add(settings, 1, latest_us);
            }
        }
        Ok(())
    }

    /// Adds a flight.
    pub fn put(&mut self, who: RowKey<'_>, row: &FlightInput<'_>) {
        let position_key = self.position_key(who);
        self.push_row(position_key, row);
    }

    fn push_row(&mut self, position_key: RowTarget, row: &FlightInput<'_>) {
        if self.blocks.last().is_none_or(|block| block.rows.len() == BLOCK_ROWS) {
            self.blocks.push(RowBlock { rows: Vec::with_capacity(BLOCK_ROWS), names: String::new() });
        }
        let last = self.blocks.len() - 1;
        let (block, unit) = (&mut self.blocks[last], &mut self.units[position_key.unit]);
        let name = row.flight_id.unwrap_or_default();
        block.names.push_str(name);
        block.rows.push(StagedRow {
            unit: position_key.unit as u32,
            place: position_key.place,
            name_end: block.names.len() as u32,
            departure_us: row.departure_utc.as_microsecond(),
            gap_m: row.gap_m.unwrap_or(f64::NAN),
            extras: FlightExtras::of(row),
        });
        unit.rows += 1;
        unit.bytes += name.len();
    }

    fn position_key(&mut self, who: RowKey<'_>) -> RowTarget {
        let unit = self.unit(who.part_number, who.serial_number);
        RowTarget { unit, place: self.units[unit].places.number(who.tail_number, who.position) }
    }

    /// Index of a unit. Most tables have one unit's rows together, or the units in one order in every run.
    fn unit(&mut self, part_number: Option<&str>, serial_number: &str) -> usize {
        let is = |(part, serial): &UnitKey| serial == serial_number && part.as_deref() == part_number;
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
        self.units.push(UnitEntry { name, ..UnitEntry::default() });
        self.follows.push(0);
        unit
    }
}

/// A unit, and one of its places.
#[derive(Debug, Clone, Copy)]
struct RowTarget {
    unit: usize,
    place: u32,
}

/// The gap that contradicts that of a row, from the row, its gap and that of the other estimator, m; a record of an external
/// table with any flag contradicts itself, so that it alone confirms nothing.
type OtherGap<'a> = &'a dyn Fn(usize, f64, Option<f64>) -> Option<f64>;

/// Whether the flags of a row hold the disagreement of the estimators.
fn disagree(flags: &ListArray, row: usize) -> bool {
    if flags.is_null(row) || flags.value_length(row) == 0 {
        return false;
    }
    let flags = flags.value(row);
    flags.as_string_opt::<i32>().is_some_and(|flags| flags.iter().any(|flag| flag == Some(DISAGREE)))
}

/// The number of a row.
pub(crate) fn at(numbers: &Float64Array, row: usize) -> Option<f64> {
    numbers.is_valid(row).then(|| numbers.value(row))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use arrow::array::{ArrayRef, ListBuilder, StringArray, StringBuilder, TimestampMicrosecondArray};

    use super::*;

    /// A standard error of 3 µm and a distance of 4 µm between the estimators make 5 µm.
    #[test]
    fn stored_gaps_with_the_flag_have_an_error_that_spans_both_estimators() {
        let mut flags = ListBuilder::new(StringBuilder::new());
        for of_row in [&["estimators_disagree"][..], &["soft_contact"], &[]] {
            of_row.iter().for_each(|flag| flags.values().append_value(flag));
            flags.append(true);
        }
        let departures = TimestampMicrosecondArray::from(vec![1, 2, 3]).with_timezone("UTC");
        let numbers = |values: [f64; 3]| Arc::new(Float64Array::from(values.to_vec())) as ArrayRef;
        let columns: [(&str, ArrayRef); 6] = [
            ("serial_number", Arc::new(StringArray::from(vec!["S"; 3]))),
            ("departure_utc", Arc::new(departures)),
            ("gap_m", numbers([30e-6; 3])),
            ("gap_se_m", numbers([3e-6; 3])),
            (OTHER_GAP, numbers([34e-6; 3])),
            ("flags", Arc::new(flags.finish())),
        ];
        let mut builder = HistoryBuilder::default();
        builder.add_store_batch(RecordBatch::try_from_iter(columns).unwrap()).unwrap();
        let histories = builder.into_store();
        let history = histories.get(&(None, "S".into())).unwrap();
        let errors: Vec<f64> =
            history.flights().iter().map(|flown| history.extras(flown).gap_se_m().unwrap() * 1e6).collect();
        assert!((errors[0] - 5.0).abs() < 1e-9 && (errors[1] - 3.0).abs() < 1e-9, "{errors:?}");
        let at = |us| Timestamp::from_microsecond(us).unwrap();
        assert_eq!((history.disputed(at(3), 12), history.disputed(at(3), 2)), ((1, 3), (0, 2)));
    }
}
