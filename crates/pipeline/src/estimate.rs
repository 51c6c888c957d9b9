//! Estimates ad hoc: logs, or arrays, to rows without a store.

use std::path::Path;

use ingest::LogFiles;
use ingest::log::in_memory::ChannelArrays;
use job::Config;
use job::flight_log::{FlightLog, catch_panic, estimate_unidentified, part_of};
use records::row_schema::Row;
use records::{Diagnostic, GapEstimate, GapRecord, Installations, PartNumber, Position};

use crate::error::Error;
use crate::run::discover;

records::row! {
    /// An estimate without a store: the columns of a record except those of a run. Columns of an unidentified log are
    /// null.
    #[derive(Debug, Clone)]
    #[expect(missing_docs, reason = "each field is the column of a record")]
    pub struct EstimateRow {
        pub tail_number: Option<String>,
        pub position: Option<String>,
        pub part_number: Option<String>,
        pub serial_number: Option<String>,
        pub flight_id: Option<String>,
        pub departure_utc: Option<jiff::Timestamp>,
        pub flight_hours: Option<f64>,
        pub tail_hours_end: Option<f64>,
        pub estimate: GapEstimate,
        pub log_path: Option<String>,
        pub log_digest: Option<String>,
        pub config_digest: String,
        pub program_version: String,
    }
    order = <GapRecord as Row>::order
}

/// Estimates every actuator of a log: as booked, or all as one part. What is wrong with the log, or with single
/// actuators of it, goes to `diagnostics`.
///
/// # Errors
/// As [`discover::log_containing`].
pub fn estimate(
    path: &Path,
    config: &Config,
    installations: &Installations,
    part: Option<&PartNumber>,
    program_version: &str,
    diagnostics: &mut Vec<Diagnostic>,
) -> Result<Vec<EstimateRow>, Error> {
    let shown = path.display().to_string();
    let read = match part {
        Some(number) => catch_panic(&shown, || as_part(path, &shown, config, number, program_version)),
        None => {
            let files = discover::log_containing(config, path)?;
            catch_panic(&shown, || {
                booked(&files, &shown, config, installations, program_version, diagnostics)
            })
        }
    };
    Ok(read.unwrap_or_else(|diagnostic| {
        diagnostics.push(diagnostic);
        Vec::new()
    }))
}

fn as_part(
    path: &Path,
    shown: &str,
    config: &Config,
    number: &PartNumber,
    program_version: &str,
) -> Result<Vec<EstimateRow>, Diagnostic> {
    let found = estimate_unidentified(&LogFiles::one(path), shown, config, part_of(config, number)?)?;
    let row = |(position, estimate): (Position, GapEstimate)| EstimateRow {
        tail_number: None,
        position: Some(position.to_string()),
        part_number: Some(number.to_string()),
        serial_number: None,
        flight_id: None,
        departure_utc: None,
        flight_hours: None,
        tail_hours_end: None,
        estimate,
        log_path: Some(shown.to_owned()),
        log_digest: None,
        config_digest: config.digest_of_part(number),
        program_version: program_version.to_owned(),
    };
    Ok(found.into_iter().map(row).collect())
}

fn booked(
    files: &LogFiles,
    shown: &str,
    config: &Config,
    installations: &Installations,
    program_version: &str,
    diagnostics: &mut Vec<Diagnostic>,
) -> Result<Vec<EstimateRow>, Diagnostic> {
    let opened = FlightLog::open(files, shown, config, installations)?;
    let flight = opened.flight();
    let mut rows = Vec::new();
    for at in opened.actuators(installations) {
        match opened
            .unit(at, config, installations)
            .and_then(|(stay, part)| Ok((stay, opened.estimate(at, part, config)?)))
        {
            Ok((stay, estimate)) => rows.push(EstimateRow {
                tail_number: Some(flight.tail_number.to_string()),
                position: Some(at.position.to_string()),
                part_number: Some(stay.part_number.to_string()),
                serial_number: Some(stay.serial_number.to_string()),
                flight_id: Some(flight.flight_id.to_string()),
                departure_utc: Some(flight.departure_utc),
                flight_hours: flight.flight_hours,
                tail_hours_end: flight.tail_hours_end,
                estimate,
                log_path: Some(shown.to_owned()),
                log_digest: Some(opened.digest.clone()),
                config_digest: config.digest(&flight.tail_number, &stay.part_number).to_string(),
                program_version: program_version.to_owned(),
            }),
            Err(diagnostic) => diagnostics.push(diagnostic.in_file(shown)),
        }
    }
    Ok(rows)
}

/// Estimates in-memory channels as a part.
///
/// # Errors
/// A diagnostic when the part is not configured, or the arrays are no channels.
pub fn of_arrays(
    arrays: &ChannelArrays<'_>,
    config: &Config,
    number: &PartNumber,
    program_version: &str,
) -> Result<EstimateRow, Diagnostic> {
    let part = part_of(config, number)?;
    // A position is part of a log's identity, which arrays have none of.
    let own = Position::new("arrays").map_err(|e| Diagnostic::new("empty_name", e))?;
    let channels = arrays.to_channels(own).map_err(|e| e.diagnostic())?;
    let estimate = job::estimate::estimate(&channels, part, &config.document.estimate)?;
    Ok(EstimateRow {
        tail_number: None,
        position: None,
        part_number: Some(number.to_string()),
        serial_number: None,
        flight_id: None,
        departure_utc: None,
        flight_hours: None,
        tail_hours_end: None,
        estimate,
        log_path: None,
        log_digest: None,
        config_digest: config.digest_of_part(number),
        program_version: program_version.to_owned(),
    })
}
