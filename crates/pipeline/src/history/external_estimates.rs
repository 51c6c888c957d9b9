//! External tables: estimates to be assessed, and the dates of the assessments.

use std::path::Path;

use ingest::tables::{Table, TableBatch, TableSplits, name, utc};

use crate::error::Error;
use crate::history::builder::HistoryBuilder;
use crate::history::flight_row::FlightRow;
use crate::history::histories::{Histories, History};
use crate::history::merge::of_parts;
use crate::history::row_keys::KeyColumns;
use jiff::Timestamp;
use records::Diagnostic;

/// A unit and a day.
#[derive(Debug, Clone, PartialEq)]
pub struct AsOfQuery {
    /// The part number, where the table has it.
    pub part_number: Option<String>,
    /// The unit.
    pub serial_number: String,
    /// The date of the assessment; later data are ignored.
    pub as_of_utc: Timestamp,
}

/// Reads an estimates table: `serial_number` (or `serial`), `departure_utc`, `gap_m`, and what else the
/// contract allows.
///
/// # Errors
/// When the table cannot be read, lacks one of these, or holds a cell that cannot be read.
pub fn read(file: &Path) -> Result<Histories, Error> {
    let table = TableSplits::open(file, Some(&HistoryBuilder::COLUMNS), &KeyColumns::COLUMNS).map_err(bad)?;
    let histories = of_parts(table.len(), false, |gathering, some| {
        let mut chunks = table.batches(some).map_err(bad)?;
        chunks.try_for_each(|chunk| gathering.add(&chunk?)).map_err(bad)
    })?;
    without_conflicts(histories, &file.display().to_string())
}

/// The histories of an estimates table in memory.
///
/// # Errors
/// As [`read`].
pub fn from_batches(chunks: &[TableBatch]) -> Result<Histories, Error> {
    let histories = of_parts(chunks.len(), false, |gathering, some| {
        chunks[some].iter().try_for_each(|chunk| gathering.add(chunk)).map_err(bad)
    })?;
    without_conflicts(histories, "estimates")
}

/// The histories, unless two rows give different gaps or hours for one flight of a unit.
fn without_conflicts(histories: Histories, table: &str) -> Result<Histories, Error> {
    const MOST_REPORTED: usize = 3;
    let conflicts = histories.iter().flat_map(|(name, history)| {
        let pairs = history.flights().windows(2).map(|pair| (&pair[0], &pair[1]));
        pairs.filter(|(a, b)| is_conflict(history, a, b)).map(move |(a, b)| (name, history, a, b))
    });
    let found: Vec<Diagnostic> = conflicts
        .take(MOST_REPORTED)
        .map(|((_, serial), history, a, b)| {
            let row = |flown: &FlightRow| {
                let gap = flown.gap_m().map_or("no gap".to_owned(), |m| format!("{:.2} µm", m * 1e6));
                let hours = history.extras(flown).tail_hours_end().map(|h| format!(", {h} tail hours"));
                let flight = history.flight_id(flown).map(|id| format!("flight {id}, ")).unwrap_or_default();
                format!("{flight}{gap}{}", hours.unwrap_or_default())
            };
            let what = format!(
                "two rows contradict each other for unit {serial}, departure {}: {} and {}",
                a.departure_utc(),
                row(a),
                row(b)
            );
            Diagnostic::new("conflicting_rows", what)
                .in_file(table)
                .hint("keep one row for each unit and flight")
        })
        .collect();
    if found.is_empty() { Ok(histories) } else { Err(Error::Refused(found)) }
}

/// Whether two neighbouring rows are of one flight and differ in what they measured.
fn is_conflict(history: &History, a: &FlightRow, b: &FlightRow) -> bool {
    let extras = |flown: &FlightRow| {
        let extras = history.extras(flown);
        (flown.gap_m(), extras.gap_se_m(), extras.flight_hours(), extras.tail_hours_end())
    };
    a.departure_us() == b.departure_us() && history.place(a) == history.place(b) && extras(a) != extras(b)
}

/// Reads a table of queries: `serial_number` (or `serial`), `as_of_utc`, optionally `part_number`.
///
/// # Errors
/// As [`read`].
pub fn queries(file: &Path) -> Result<Vec<AsOfQuery>, Error> {
    queries_of(&Table::read(file).map_err(bad)?)
}

/// The units and days of a table of queries.
///
/// # Errors
/// As [`read`].
pub fn queries_of(table: &Table) -> Result<Vec<AsOfQuery>, Error> {
    let serial = table.column(&["serial_number", "serial"]).map_err(bad)?;
    let as_of = table.column(&["as_of_utc"]).map_err(bad)?;
    let part = table.find(&["part_number"]);
    (0..table.len())
        .map(|row| {
            Ok(AsOfQuery {
                part_number: part.and_then(|c| table.text(row, c)).map(str::to_owned),
                serial_number: table
                    .required(row, serial, name::<records::SerialNumber>)
                    .map_err(bad)?
                    .to_string(),
                as_of_utc: table.required(row, as_of, utc).map_err(bad)?,
            })
        })
        .collect()
}

#[expect(clippy::needless_pass_by_value, reason = "it is what `map_err` hands over")]
fn bad(error: ingest::Error) -> Error {
    Error::refused(error.diagnostic())
}
