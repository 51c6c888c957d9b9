//! Tables of units: which one was installed where, from when to when, and which were modified or re-identified.

use std::path::Path;

use jiff::Timestamp;
use records::{Alias, Installation, Installations};

use crate::error::{Error, bad_table};
use crate::tables::cell::{name, not_negative, utc};
use crate::tables::column_batches::{ColumnAliases, TableBatch};

/// Reads the installations table: `tail_number, position, part_number, serial_number, installed_utc,
/// removed_utc` and optionally `unit_hours_at_install`, `tail_hours_at_install`.
///
/// # Errors
/// Every cell that cannot be read, or, when all can, every contradiction between rows.
pub fn installations(file: &Path, names: &ColumnAliases) -> Result<Installations, Vec<Error>> {
    let mut table = TableBatch::read(file).map_err(|e| vec![e])?;
    table.names = Some(names.clone());
    let [tail, position, part, serial, installed] =
        table.columns(["tail_number", "position", "part_number", "serial_number", "installed_utc"])?;
    let [removed, unit_hours, tail_hours] =
        ["removed_utc", "unit_hours_at_install", "tail_hours_at_install"].map(|name| table.find(&[name]));
    let rows = table.read_rows(|row| {
        Ok(Installation {
            tail_number: table.required(row, tail, name)?,
            position: table.required(row, position, name)?,
            part_number: table.required(row, part, name)?,
            serial_number: table.required(row, serial, name)?,
            installed_utc: table.required(row, installed, utc)?,
            removed_utc: table.optional(row, removed, removal)?.flatten(),
            unit_hours_at_install: table.optional(row, unit_hours, not_negative)?,
            tail_hours_at_install: table.optional(row, tail_hours, not_negative)?,
            today: None,
        })
    })?;
    // The text of a million rows is not kept next to their values.
    drop(table);
    let contradiction = |fault| bad_table(fault).in_file(file);
    Installations::new(rows).map_err(|found| found.into_iter().map(contradiction).collect())
}

/// Reads the aliases table: `former_serial_number`, `serial_number`, and optionally `former_part_number`, `part_number`.
///
/// # Errors
/// A missing column, or the first cell that cannot be read.
pub fn aliases(file: &Path) -> Result<Vec<Alias>, Error> {
    let table = TableBatch::read(file)?;
    let [former, serial] = [table.column(&["former_serial_number"])?, table.column(&["serial_number"])?];
    let [former_part, part] = ["former_part_number", "part_number"].map(|name| table.find(&[name]));
    let row = |row: usize| {
        Ok(Alias {
            former_part_number: table.optional(row, former_part, name)?,
            former_serial_number: table.required(row, former, name)?,
            part_number: table.optional(row, part, name)?,
            serial_number: table.required(row, serial, name)?,
        })
    };
    table.rows().map(row).collect()
}

/// The removal of a unit; none for the values that databases write for a unit that is still installed: the year 9999
/// (the last day of most calendars lies beyond the last instant that can be stored) and words such as `open`.
fn removal(text: &str) -> Result<Option<Timestamp>, String> {
    const OPEN: [&str; 9] = ["open", "null", "none", "nan", "nat", "n/a", "na", "-", "infinity"];
    let text = text.trim();
    if text.starts_with("9999-") || OPEN.iter().any(|open| text.eq_ignore_ascii_case(open)) {
        return Ok(None);
    }
    utc(text).map(Some)
}
