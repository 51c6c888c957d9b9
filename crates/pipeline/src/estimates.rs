//! Tables made elsewhere: estimates to be judged, and the days on which to judge them.

use std::path::Path;

use ingest::tables::{Table, name, number, utc};

use crate::error::Error;
use crate::trends::{AsOf, Flown};

/// Reads an estimates table: `serial_number` (or `serial`), `departure_utc`, `gap_m`, and what else the
/// contract allows.
///
/// # Errors
/// When the table cannot be read, lacks one of these, or holds a cell that cannot be read.
pub fn read(file: &Path) -> Result<Vec<Flown>, Error> {
    flown(&Table::read(file).map_err(bad)?)
}

/// The flights of an estimates table.
///
/// # Errors
/// As [`read`].
pub fn flown(table: &Table) -> Result<Vec<Flown>, Error> {
    let serial = table.column(&["serial_number", "serial"]).map_err(bad)?;
    let departure = table.column(&["departure_utc"]).map_err(bad)?;
    let gap = table.column(&["gap_m"]).map_err(bad)?;
    let tail = table.find(&["tail_number", "tail"]);
    let [position, part, flight, hours, meter, reversals, se] = [
        "position",
        "part_number",
        "flight_id",
        "flight_hours",
        "tail_hours_end",
        "load_reversals",
        "gap_se_m",
    ]
    .map(|column| table.find(&[column]));
    let text = |row, column: Option<usize>| column.and_then(|c| table.text(row, c)).map(str::to_owned);
    (0..table.len())
        .map(|row| {
            Ok(Flown {
                part_number: text(row, part),
                serial_number: table
                    .required(row, serial, name::<fleet::SerialNumber>)
                    .map_err(bad)?
                    .to_string(),
                tail_number: text(row, tail),
                position: text(row, position),
                flight_id: text(row, flight),
                departure_utc: table.required(row, departure, utc).map_err(bad)?,
                installed_utc: None,
                flight_hours: table.optional(row, hours, number).map_err(bad)?,
                tail_hours_end: table.optional(row, meter, number).map_err(bad)?,
                load_reversals: table.optional(row, reversals, number).map_err(bad)?.map(|n| n as u64),
                gap_m: table.optional(row, Some(gap), number).map_err(bad)?,
                gap_se_m: table.optional(row, se, number).map_err(bad)?,
            })
        })
        .collect()
}

/// Reads a table of queries: `serial_number` (or `serial`), `as_of_utc`, optionally `part_number`.
///
/// # Errors
/// As [`read`].
pub fn queries(file: &Path) -> Result<Vec<AsOf>, Error> {
    asked(&Table::read(file).map_err(bad)?)
}

/// The units and days of a table of queries.
///
/// # Errors
/// As [`read`].
pub fn asked(table: &Table) -> Result<Vec<AsOf>, Error> {
    let serial = table.column(&["serial_number", "serial"]).map_err(bad)?;
    let as_of = table.column(&["as_of_utc"]).map_err(bad)?;
    let part = table.find(&["part_number"]);
    (0..table.len())
        .map(|row| {
            Ok(AsOf {
                part_number: part.and_then(|c| table.text(row, c)).map(str::to_owned),
                serial_number: table
                    .required(row, serial, name::<fleet::SerialNumber>)
                    .map_err(bad)?
                    .to_string(),
                as_of_utc: table.required(row, as_of, utc).map_err(bad)?,
            })
        })
        .collect()
}

#[expect(clippy::needless_pass_by_value, reason = "it is what `map_err` hands over")]
fn bad(error: ingest::Error) -> Error {
    Error::refused(error.complaint())
}
