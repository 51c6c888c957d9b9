//! The aliases table: units that were modified or re-identified.

use std::path::Path;

use records::{Alias, PartNumber, SerialNumber};

use crate::error::Error;
use crate::tables::cell::name;
use crate::tables::table::Table;

/// Reads the table: `former_serial_number`, `serial_number`, and optionally `former_part_number`, `part_number`.
///
/// # Errors
/// A missing column, or the first cell that cannot be read.
pub fn aliases(file: &Path) -> Result<Vec<Alias>, Error> {
    let table = Table::read(file)?;
    let former = table.column(&["former_serial_number"])?;
    let serial = table.column(&["serial_number"])?;
    let (former_part, part) = (table.find(&["former_part_number"]), table.find(&["part_number"]));
    let row = |row: usize| {
        Ok(Alias {
            former_part_number: table.optional(row, former_part, name::<PartNumber>)?,
            former_serial_number: table.required(row, former, name::<SerialNumber>)?,
            part_number: table.optional(row, part, name::<PartNumber>)?,
            serial_number: table.required(row, serial, name::<SerialNumber>)?,
        })
    };
    table.rows().map(row).collect()
}
