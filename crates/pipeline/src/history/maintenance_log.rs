//! Maintenance log: work on units, with its date.

use std::collections::BTreeMap;
use std::path::Path;

use ingest::tables::{Table, name, utc};
use records::{PartNumber, SerialNumber};
use trend::MaintenanceEvent;

use crate::error::Error;

/// Entries by part and serial number.
pub type MaintenanceLog = BTreeMap<(String, String), Vec<MaintenanceEvent>>;

/// Reads a maintenance table: `part_number`, `serial_number`, `utc`, `kind` (`reshim`, `rerig`, `overhaul` or
/// `lubrication`); CSV or Parquet.
///
/// # Errors
/// When the table cannot be read, lacks a column, or holds a cell that cannot be read.
pub fn read(file: &Path) -> Result<MaintenanceLog, Error> {
    let bad = |e: ingest::Error| Error::Refused(vec![e.diagnostic()]);
    let table = Table::read(file).map_err(bad)?;
    let [part, serial, done, kind] =
        ["part_number", "serial_number", "utc", "kind"].map(|n| table.column(&[n]));
    let (part, serial, done, kind) =
        (part.map_err(bad)?, serial.map_err(bad)?, done.map_err(bad)?, kind.map_err(bad)?);
    let mut maintenance = MaintenanceLog::new();
    for row in 0..table.len() {
        let unit = (
            table.required(row, part, name::<PartNumber>).map_err(bad)?.to_string(),
            table.required(row, serial, name::<SerialNumber>).map_err(bad)?.to_string(),
        );
        let utc_us = table.required(row, done, utc).map_err(bad)?.as_microsecond();
        let renews = table.required(row, kind, renews).map_err(bad)?;
        maintenance.entry(unit).or_default().push(MaintenanceEvent { utc_us, renews });
    }
    Ok(maintenance)
}

/// Whether what was done makes a worn unit as good as new.
fn renews(kind: &str) -> Result<bool, String> {
    match kind {
        "reshim" | "overhaul" => Ok(true),
        "rerig" | "lubrication" => Ok(false),
        _ => {
            Err(format!("{kind:?} is no kind of maintenance: `reshim`, `rerig`, `overhaul` or `lubrication`"))
        }
    }
}
