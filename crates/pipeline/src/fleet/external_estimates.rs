//! External tables: estimates to be assessed, and the dates of the assessments.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use ingest::tables::{TableBatch, TableSplits, name, utc};
use jiff::Timestamp;

use crate::error::Error;
use crate::fleet::builder::{self, add_external};
use crate::fleet::histories::{Histories, UnitKey};
use crate::fleet::unit_rows::{KeyColumns, PartsByUnit, of_parts};

/// A unit, and the date of its assessment; later data are ignored.
pub type AsOfQuery = (UnitKey, Timestamp);

/// Reads an estimates table: `serial_number` (or `serial`), `departure_utc`, `gap_m`, and what else the
/// contract allows. `by_largest` has the parts whose limits apply to the largest gap along the stroke.
///
/// # Errors
/// When the table cannot be read, lacks one of these, or holds a cell that cannot be read.
pub fn read(file: &Path, by_largest: &BTreeSet<String>) -> Result<Histories, Error> {
    let table = TableSplits::open(file, Some(&builder::COLUMNS), &KeyColumns::COLUMNS)?;
    let parts = of_parts(table.len(), |rows, part| {
        let mut chunks = table.batches(part..part + 1)?;
        Ok(chunks.try_for_each(|chunk| add_external(rows, &chunk?, by_largest))?)
    })?;
    Ok(builder::histories(with_parts(parts), None))
}

/// The histories of an estimates table in memory.
///
/// # Errors
/// As [`read`].
pub fn from_batches(chunks: &[TableBatch], by_largest: &BTreeSet<String>) -> Result<Histories, Error> {
    let parts = of_parts(chunks.len(), |rows, part| Ok(add_external(rows, &chunks[part], by_largest)?))?;
    Ok(builder::histories(with_parts(parts), None))
}

/// The same rows, those without a part number as flights of the one unit with their serial number that has a part.
fn with_parts(mut parts: PartsByUnit) -> PartsByUnit {
    let mut named: BTreeMap<String, Vec<UnitKey>> = BTreeMap::new();
    for unit in parts.keys().filter(|unit| unit.0.is_some()) {
        named.entry(unit.1.clone()).or_default().push(unit.clone());
    }
    for (serial, units) in named {
        if let [unit] = units.as_slice()
            && let Some(rows) = parts.remove(&(None, serial))
        {
            parts.entry(unit.clone()).or_default().extend(rows);
        }
    }
    parts
}

/// The units and days of a table of queries: `serial_number` (or `serial`), `as_of_utc`, optionally `part_number`.
///
/// # Errors
/// As [`read`].
pub fn queries(table: &TableBatch) -> Result<Vec<AsOfQuery>, Error> {
    let serial = table.column(&["serial_number", "serial"])?;
    let as_of = table.column(&["as_of_utc"])?;
    let part = table.find(&["part_number"]);
    table
        .rows()
        .map(|row| {
            let part_number = part.and_then(|c| table.text(row, c)).map(str::to_owned);
            let serial_number = table.required(row, serial, name::<records::SerialNumber>)?.to_string();
            Ok(((part_number, serial_number), table.required(row, as_of, utc)?))
        })
        .collect()
}
