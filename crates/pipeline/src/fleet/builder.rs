//! Flights of units from tables: the store's own, or estimates made elsewhere.

use std::collections::BTreeSet;

use arrow::array::{Array, AsArray, ListArray, RecordBatch};
use ingest::tables::TableBatch;
use jiff::Timestamp;
use rayon::prelude::*;
use store::{ColumnScan, Query, Store};

use crate::error::Error;
use crate::fleet::flight_row::{FlightExtras, FlightRow, signed_error};
use crate::fleet::histories::{Histories, History};
use crate::fleet::unit_rows::{PartsByUnit, RowsByUnit, UnitRows, at, batches, number, of_parts};

/// Largest gap that a table made elsewhere may have, m: that of a limit in the configuration.
const LARGEST_M: f64 = 1e-2;
/// The flag of a record whose two estimators disagree, and the column with the gap of the other one.
const DISAGREE: &str = "estimators_disagree";
const OTHER_GAP: &str = "gap_midrange_fitted_m";
/// The columns with the largest gap along the stroke, where it varies, and its standard error.
const LARGEST_GAP: &str = "gap_largest_m";
const LARGEST_GAP_ERROR: &str = "gap_largest_se_m";
/// How tables made elsewhere write that a record has no flag.
const NO_FLAG: [&str; 8] = ["[]", "false", "0", "none", "nan", "null", "na", "-"];
/// The column with the digest of the settings of the estimate.
const SETTINGS: &str = "config_digest";

/// The columns that a table made elsewhere may bring; `serial_number`, `departure_utc` and `gap_m` it must.
pub(crate) const COLUMNS: [&str; 16] = [
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
    LARGEST_GAP,
    LARGEST_GAP_ERROR,
    "flags",
];

/// The histories of units, and the `stored` rows that they were made from.
pub(crate) fn histories(parts: PartsByUnit, stored: Option<ColumnScan>) -> Histories {
    let parts: Vec<_> = parts.into_iter().collect();
    let history = |(name, parts)| (name, History::of_rows(UnitRows::concatenated(parts)));
    let units: Vec<_> = parts.into_par_iter().map(history).collect();
    Histories { units: units.into_iter().collect(), stored: stored.map(Box::new) }
}

/// Every unit's flights in the matching records of the store; `by_largest` as in an estimates table.
///
/// # Errors
/// When the store cannot be read.
pub(crate) fn of_store(
    store: &Store,
    query: &Query,
    by_largest: &BTreeSet<String>,
) -> Result<Histories, Error> {
    let stored = COLUMNS.into_iter().filter(|name| !["serial", "tail"].contains(name));
    let names: Vec<&str> = stored.chain([OTHER_GAP, SETTINGS]).collect();
    let scan = store.scan_columns(query, &names)?;
    let parts = of_parts(scan.file_count(), |rows, part| {
        let mut chunks = batches(&scan, part)?.into_iter();
        chunks.try_for_each(|(chunk, batch)| Ok(add_stored(rows, &chunk, &batch, by_largest)?))
    })?;
    Ok(histories(parts, Some(scan)))
}

/// Adds the flights of an estimates table to those of their units. In flights of the parts `by_largest`, the largest gap along
/// the stroke is the gap, where the table has it.
pub(crate) fn add_external(
    rows: &mut RowsByUnit,
    chunk: &TableBatch,
    by_largest: &BTreeSet<String>,
) -> Result<(), ingest::Error> {
    chunk.column(&["serial_number", "serial"])?;
    chunk.column(&["departure_utc"])?;
    let flags = chunk.texts(chunk.find(&["flags"]))?;
    // A record with any flag contradicts itself, so that it alone confirms nothing.
    let is_flag = |text: &&str| !NO_FLAG.contains(&text.to_ascii_lowercase().as_str());
    let column = chunk.column(&["gap_m"])?;
    let gaps_m = chunk.numbers(Some(column))?;
    if let Some(row) = chunk.rows().find(|row| at(&gaps_m, *row).is_some_and(|gap_m| gap_m.abs() > LARGEST_M))
    {
        let detail = format!("no gap is {} m wide: give metres, 60e-6 for 60 µm", gaps_m.value(row));
        return Err(chunk.error(row, Some(column), detail));
    }
    for name in ["gap_se_m", LARGEST_GAP_ERROR] {
        let column = chunk.find(&[name]);
        let errors_m = chunk.numbers(column)?;
        if let Some(row) = chunk.rows().find(|row| at(&errors_m, *row).is_some_and(|se_m| se_m < 0.0)) {
            let detail = format!("`{}` is below zero: leave an unknown error empty", errors_m.value(row));
            return Err(chunk.error(row, column, detail));
        }
    }
    let other_gap_m = |row, gap_m| flags.get(row).filter(is_flag).map(|_| gap_m);
    add(rows, chunk, by_largest, other_gap_m)
}

fn add_stored(
    rows: &mut RowsByUnit,
    chunk: &TableBatch,
    batch: &RecordBatch,
    by_largest: &BTreeSet<String>,
) -> Result<(), ingest::Error> {
    let flags = batch.column_by_name("flags").and_then(|flags| flags.as_list_opt::<i32>());
    let others_m = chunk.numbers(chunk.find(&[OTHER_GAP]))?;
    // A record whose estimators disagree has the gap of the other one.
    let other_gap_m = |row, _| {
        let has_flags = |flags: &&ListArray| flags.is_valid(row) && flags.value_length(row) > 0;
        let of_row = flags.filter(has_flags)?.value(row);
        let is_disputed = of_row.as_string_opt::<i32>()?.iter().any(|flag| flag == Some(DISAGREE));
        at(&others_m, row).filter(|_| is_disputed)
    };
    add(rows, chunk, by_largest, other_gap_m)
}

/// Adds the flights of some rows. `other_gap_m` gives the gap that contradicts that of a row, m.
fn add(
    rows: &mut RowsByUnit,
    chunk: &TableBatch,
    by_largest: &BTreeSet<String>,
    other_gap_m: impl Fn(usize, f64) -> Option<f64>,
) -> Result<(), ingest::Error> {
    let numbers = |name: &str| chunk.numbers(chunk.find(&[name]));
    let departure = chunk.column(&["departure_utc"])?;
    let departures = chunk.timestamps(Some(departure))?;
    let gaps_m = chunk.numbers(Some(chunk.column(&["gap_m"])?))?;
    let (errors_m, reversals) = (numbers("gap_se_m")?, numbers("load_reversals")?);
    let largest = if by_largest.is_empty() {
        None
    } else {
        let parts = chunk.texts(chunk.find(&["part_number"]))?;
        Some((parts, numbers(LARGEST_GAP)?, numbers(LARGEST_GAP_ERROR)?))
    };
    let (hours, meters) = (numbers("flight_hours")?, numbers("tail_hours_end")?);
    let (flights, settings) =
        (chunk.texts(chunk.find(&["flight_id"]))?, chunk.texts(chunk.find(&[SETTINGS]))?);
    rows.add_rows(chunk, |row, unit, place| {
        let wrong = |detail: String| chunk.error(row, Some(departure), detail);
        let departure_us = departures.is_valid(row).then(|| departures.value(row));
        let departure_us = departure_us.ok_or_else(|| wrong("it is empty".into()))?;
        Timestamp::from_microsecond(departure_us).map_err(|e| wrong(e.to_string()))?;
        let largest = largest.as_ref().and_then(|(parts, largest_m, largest_errors_m)| {
            let gap_m = at(largest_m, row)
                .filter(|_| parts.get(row).is_some_and(|part| by_largest.contains(part)))?;
            Some((Some(gap_m), at(largest_errors_m, row)))
        });
        let (gap_m, gap_se_m) = largest.unwrap_or_else(|| (at(&gaps_m, row), at(&errors_m, row)));
        if let Some(settings) = settings.get(row).filter(|_| gap_m.is_some()) {
            unit.settings.add(settings, 1, departure_us);
        }
        let name = flights.get(row).unwrap_or_default();
        let flown = FlightRow::new(departure_us, gap_m, place, name, &mut unit.names);
        let other_m = gap_m.and_then(|gap_m| other_gap_m(row, gap_m));
        let extras = FlightExtras {
            flight_hours: number(&hours, row),
            tail_hours_end: number(&meters, row),
            gap_se_m: signed_error(gap_se_m, gap_m.zip(other_m)),
            load_reversals: at(&reversals, row).map_or(u64::MAX, |n| n as u64),
        };
        unit.rows.push((flown, extras));
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use arrow::array::{ArrayRef, Float64Array, Int64Array, StringArray, TimestampMicrosecondArray};
    use arrow::compute::cast;
    use arrow::datatypes::DataType;

    use super::*;
    use crate::fleet::histories::UnitKey;

    type Rows = RowsByUnit;
    type Add = fn(&mut Rows, &RecordBatch) -> Result<(), ingest::Error>;

    fn chunk(batch: &RecordBatch) -> TableBatch {
        TableBatch::new("results".as_ref(), batch.clone(), 0)
    }

    fn add_batch(rows: &mut Rows, batch: &RecordBatch) -> Result<(), ingest::Error> {
        add_stored(rows, &chunk(batch), batch, &BTreeSet::new())
    }

    fn add_plain(rows: &mut Rows, batch: &RecordBatch) -> Result<(), ingest::Error> {
        add_external(rows, &chunk(batch), &BTreeSet::new())
    }

    /// The histories of a table in batches.
    fn of_batches(batches: &[RecordBatch], add: Add) -> Histories {
        let put = |rows: &mut Rows, part: usize| {
            add(rows, &batches[part]).unwrap();
            Ok(())
        };
        histories(of_parts(batches.len(), put).unwrap(), None)
    }

    /// A row's texts (part, serial number, tail, position, flight), its departure and its gap.
    type Cells = ([Option<String>; 5], i64, Option<f64>);

    /// Serial numbers of two parts, units that move about, names with a blank, and flights that arrive late.
    fn rows() -> Vec<Cells> {
        let mut random = fastrand::Rng::with_seed(7);
        let mut chance = |bound: u64| random.u64(..bound);
        let mut row = |at: i64| {
            let mut text = |name: &str, count| (chance(9) > 0).then(|| format!("{name}{}", chance(count)));
            let (part, tail, position, flight) =
                (text("P", 2), text("T", 3), text("place ", 2), text(" F", 40));
            let serial = Some(format!("S{}", chance(4)));
            let departure_us = 1_000_000 * (at - chance(20) as i64);
            (
                [part, serial, tail, position, flight],
                departure_us,
                (chance(5) > 0).then(|| 1e-6 * chance(90) as f64),
            )
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
        let reversals: Int64Array = rows.iter().map(|row| row.2.map(|gap_m| (1e6 * gap_m) as i64)).collect();
        let numbers: [(&str, ArrayRef); 3] = [
            ("departure_utc", Arc::new(departures)),
            ("gap_m", Arc::new(gaps_m)),
            ("load_reversals", Arc::new(reversals)),
        ];
        let texts = names.into_iter().enumerate().map(|(column, name)| (name, text(column)));
        RecordBatch::try_from_iter(texts.chain(numbers)).unwrap()
    }

    /// The histories of rows that are read each by itself.
    fn one_by_one(rows: &[Cells]) -> Vec<String> {
        let batches: Vec<_> = rows.chunks(1).map(|row| batch(row, &DataType::Utf8)).collect();
        row_texts(&of_batches(&batches, add_plain))
    }

    /// All that is known of all units.
    fn row_texts(histories: &Histories) -> Vec<String> {
        let of_unit = |(name, history): (&UnitKey, &History)| {
            let flight = |(f, extras): (&FlightRow, &FlightExtras)| {
                format!("{f:?} {:?} {:?} {extras:?}", history.place(f), history.flight_id(f))
            };
            let flights = history.flights().iter().zip(&history.extras);
            format!("{name:?} {:?}", flights.map(flight).collect::<Vec<_>>())
        };
        histories.units.iter().map(of_unit).collect()
    }

    /// Rows of the store and of an estimates table, in parts whose names have different dictionary codes. The order of the
    /// parts decides, not that of the workers, which may outnumber parts and units.
    #[test]
    fn any_number_of_workers_and_parts_brings_together_what_each_row_is_by_itself() {
        let rows = rows();
        let expected = one_by_one(&rows);
        let coded = DataType::Dictionary(Box::new(DataType::Int32), Box::new(DataType::Utf8));
        for (rows_of_part, workers) in [(600, 1), (600, 7), (90, 2), (41, 3), (7, 5)] {
            let parts = |texts| rows.chunks(rows_of_part).map(|some| batch(some, texts)).collect::<Vec<_>>();
            let (stored, plain) = (parts(&coded), parts(&DataType::Utf8));
            let pool = rayon::ThreadPoolBuilder::new().num_threads(workers).build().unwrap();
            let found = pool.install(|| [of_batches(&stored, add_batch), of_batches(&plain, add_plain)]);
            let is_same = found.iter().all(|found| row_texts(found) == expected);
            assert!(is_same, "{rows_of_part} rows a part, {workers} workers");
        }
        assert!(of_parts(0, |_, _| Ok(())).unwrap().is_empty());
    }

    /// Independent of the order of the workers, the first error of the table is returned.
    #[test]
    fn of_several_errors_the_first_is_returned() {
        let refuse = |_: &mut Rows, part: usize| match part {
            0..3 => Ok(()),
            first => {
                let empty = RecordBatch::new_empty(Arc::new(arrow::datatypes::Schema::empty()));
                let error = TableBatch::new("t".as_ref(), empty, first).error(0, None, "bad".into());
                Err(Error::refused(error.diagnostic()))
            }
        };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
        let error = pool.install(|| of_parts(24, refuse)).unwrap_err();
        assert!(format!("{error:?}").contains("row: Some(4)"), "{error:?}");
    }

    #[test]
    fn a_row_without_a_serial_number_is_reported_by_its_number() {
        let mut rows = rows();
        rows[17].0[1] = Some("  ".into());
        let coded = DataType::Dictionary(Box::new(DataType::Int32), Box::new(DataType::Utf8));
        let error = add_batch(&mut RowsByUnit::default(), &batch(&rows, &coded)).unwrap_err();
        assert_eq!(error.diagnostic().location().unwrap(), "column `serial_number`, row 18");
    }
}
