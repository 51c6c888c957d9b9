//! Maintenance log: work on units, with its date.

use std::collections::{BTreeMap, BTreeSet};

use ingest::tables::{TableBatch, name, utc};
use jiff::Timestamp;
use job::Config;
use records::{Installations, PartNumber, SerialNumber};
use serde::Serialize;
use trend::MaintenanceEvent;

use crate::error::Error;
use crate::fleet::bookkeeping::dates_ahead::DateAhead;
use crate::fleet::bookkeeping::inspections::InspectionRow;
use crate::fleet::histories::UnitKey;

/// Entries by the part and serial number that the unit has today.
pub type MaintenanceLog = BTreeMap<UnitKey, Vec<MaintenanceEvent>>;

/// Reads the configured maintenance table; empty where none is configured. Its columns are `part_number`, `serial_number`,
/// `utc` and `kind` (`reshim`, `rerig`, `overhaul` or `lubrication`); CSV or Parquet.
///
/// # Errors
/// When the table cannot be read, lacks a column, or holds a cell that cannot be read.
pub fn read(config: &Config, installations: &Installations) -> Result<MaintenanceLog, Error> {
    let mut maintenance = MaintenanceLog::new();
    let Some(file) = &config.document.logs.maintenance else { return Ok(maintenance) };
    let table = TableBatch::read(&config.path(file))?;
    let column = |name| table.column(&[name]);
    let (part, serial) = (column("part_number")?, column("serial_number")?);
    let (done, kind) = (column("utc")?, column("kind")?);
    for row in table.rows() {
        let part = table.required(row, part, name::<PartNumber>)?.to_string();
        let serial = table.required(row, serial, name::<SerialNumber>)?.to_string();
        let done = table.required(row, done, utc)?;
        let event =
            MaintenanceEvent { utc_us: done.as_microsecond(), renews: table.required(row, kind, renews)? };
        maintenance.entry(installations.unit_today((Some(part), serial), done)).or_default().push(event);
    }
    Ok(maintenance)
}

pub(crate) fn dates(log: &MaintenanceLog) -> impl Iterator<Item = DateAhead> {
    log.iter().flat_map(|((part, serial), events)| {
        events.iter().filter_map(|event| {
            let done = Timestamp::from_microsecond(event.utc_us).ok()?;
            Some(DateAhead::new(part.clone(), serial.clone(), "utc", done))
        })
    })
}

/// A row of the maintenance or the inspections table about a unit that was never installed.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[expect(missing_docs, reason = "each field is named for what it holds")]
pub struct UnknownUnit {
    /// File of the table.
    pub table: String,
    pub part_number: Option<String>,
    pub serial_number: String,
}

/// Units of the maintenance and the inspections table that the installations table does not know.
pub(crate) fn unknown_units(
    config: &Config,
    installations: &Installations,
    maintenance: &MaintenanceLog,
    inspections: &[InspectionRow],
) -> Vec<UnknownUnit> {
    let is_unknown = |(_, unit): &(_, &UnitKey)| installations.of_unit(unit).next().is_none();
    let logs = &config.document.logs;
    let maintained = maintenance.keys().map(|unit| (&logs.maintenance, unit));
    let inspected = inspections.iter().map(|row| (&logs.inspections, &row.unit));
    let unit = |(table, (part, serial)): (&Option<String>, &UnitKey)| UnknownUnit {
        table: table.clone().unwrap_or_default(),
        part_number: part.clone(),
        serial_number: serial.clone(),
    };
    let units: BTreeSet<UnknownUnit> = maintained.chain(inspected).filter(is_unknown).map(unit).collect();
    units.into_iter().collect()
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
