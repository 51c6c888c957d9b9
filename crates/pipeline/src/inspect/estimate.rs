//! Estimates without a store: from logs or arrays to rows.

use std::path::Path;

use ingest::LogFiles;
use ingest::log::in_memory::ChannelArrays;
use job::Config;
use job::flight_log::{FlightLog, catch_panic, for_each_actuator, part_of};
use records::row_schema::Row;
use records::{Diagnostic, GapEstimate, GapRecord, Installations, PartNumber, Position};

use crate::error::Error;
use crate::logs::discover;

records::row! {
    /// An estimate without a store: the columns of a record except those of a run. Columns of an unidentified log are
    /// null.
    #[derive(Debug, Clone, Default)]
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

/// Estimates every actuator of a log: as installed, or all as one part. Errors of the log, or of single actuators, go
/// to `diagnostics`.
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
    let log_path = path.display().to_string();
    let read = match part {
        Some(number) => catch_panic(&log_path, || as_part(path, &log_path, config, number, program_version)),
        None => {
            let files = discover::log_containing(config, path)?;
            catch_panic(&log_path, || {
                as_installed(&files, &log_path, config, installations, program_version, diagnostics)
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
    log_path: &str,
    config: &Config,
    number: &PartNumber,
    program_version: &str,
) -> Result<Vec<EstimateRow>, Diagnostic> {
    let (files, none) = (LogFiles::one(path), Installations::default());
    let mut rows = Vec::new();
    for_each_actuator(&files, log_path, config, &none, Some(number), |channels, part| {
        let estimate = job::estimate::estimate(channels, part, &config.document.estimate)?;
        rows.push(EstimateRow {
            position: Some(channels.position.to_string()),
            log_path: Some(log_path.to_owned()),
            ..unidentified(estimate, config, number, program_version)
        });
        Ok(())
    })?;
    Ok(rows)
}

fn as_installed(
    files: &LogFiles,
    log_path: &str,
    config: &Config,
    installations: &Installations,
    program_version: &str,
    diagnostics: &mut Vec<Diagnostic>,
) -> Result<Vec<EstimateRow>, Diagnostic> {
    let opened = FlightLog::open(files, log_path, config, installations)?;
    let flight = opened.flight();
    let mut rows = Vec::new();
    for at in opened.actuators(installations) {
        match opened
            .unit(at, config, installations)
            .and_then(|(installation, part)| Ok((installation, opened.estimate(at, part, config)?)))
        {
            Ok((installation, estimate)) => rows.push(EstimateRow {
                tail_number: Some(flight.tail_number.to_string()),
                position: Some(at.position.to_string()),
                part_number: Some(installation.part_number.to_string()),
                serial_number: Some(installation.serial_number.to_string()),
                flight_id: Some(flight.flight_id.to_string()),
                departure_utc: Some(flight.departure_utc),
                flight_hours: flight.flight_hours,
                tail_hours_end: flight.tail_hours_end,
                estimate,
                log_path: Some(log_path.to_owned()),
                log_digest: Some(opened.digest.clone()),
                config_digest: config.digest(&flight.tail_number, &installation.part_number).to_string(),
                program_version: program_version.to_owned(),
            }),
            Err(diagnostic) => diagnostics.push(diagnostic.in_file(log_path)),
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
    Ok(unidentified(estimate, config, number, program_version))
}

/// The row of an estimate of a part, of which neither aircraft nor flight is known.
fn unidentified(
    estimate: GapEstimate,
    config: &Config,
    number: &PartNumber,
    program_version: &str,
) -> EstimateRow {
    EstimateRow {
        part_number: Some(number.to_string()),
        estimate,
        config_digest: config.digest_of_part(number),
        program_version: program_version.to_owned(),
        ..EstimateRow::default()
    }
}
