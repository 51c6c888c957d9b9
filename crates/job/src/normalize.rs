//! One log to normalized logs: a file for each actuator, which `run` reads back to the same gap.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use ingest::parquet::writer::Encoding;
use ingest::{ActuatorColumns, LogFiles};
use records::{Diagnostic, Installations};

use crate::config::Config;
use crate::flight_log::{FlightLog, catch_panic};

/// Writes the normalized logs of one log below a folder, as `TAIL/DEPARTURE_FLIGHT/POSITION.parquet`: a flight
/// number flies again.
///
/// An actuator that cannot be used becomes a diagnostic; the others are written.
///
/// `claim` is called before a file is written, with the digest of the log, and refuses a file of someone else.
///
/// # Errors
/// A diagnostic when the log cannot be read or identified.
pub fn normalize(
    files: &LogFiles,
    log_path: &str,
    config: &Config,
    installations: &Installations,
    folder: &Path,
    encoding: Encoding,
    claim: &dyn Fn(&Path, &str) -> Result<(), Diagnostic>,
) -> Result<(Vec<PathBuf>, Vec<Diagnostic>), Diagnostic> {
    catch_panic(log_path, || {
        let opened = FlightLog::open(files, log_path, config, installations)?;
        let (mut written, mut diagnostics) = (Vec::new(), Vec::new());
        let id = &opened.identity;
        let write = |at: &ActuatorColumns| {
            let (installation, part) = opened.unit(at, config, installations)?;
            let channels = opened.channels(at, part)?;
            let flight = format!("{}_{}", id.departure_utc.strftime("%Y%m%dT%H%M%SZ"), id.flight_id);
            let names = [id.tail_number.as_str(), &flight, at.position.as_str()].map(file_name);
            let file = folder.join(&names[0]).join(&names[1]).join(format!("{}.parquet", names[2]));
            claim(&file, &opened.digest)?;
            let config_digest = config.digest(&id.tail_number, &installation.part_number);
            let provenance = BTreeMap::from([
                ("source_log".to_owned(), opened.display_name().to_owned()),
                ("source_digest".to_owned(), opened.digest.clone()),
                ("config_digest".to_owned(), config_digest.to_string()),
                ("part_number".to_owned(), installation.part_number.to_string()),
                ("serial_number".to_owned(), installation.serial_number.to_string()),
            ]);
            ingest::log::normalized::write(&file, &channels, id, part.geometry, &provenance, encoding)
                .map_err(|e| e.diagnostic())?;
            Ok(file)
        };
        for at in opened.actuators(installations).filter(|at| at.lacking.is_empty()) {
            match write(at) {
                Ok(file) => written.push(file),
                Err(diagnostic) => diagnostics.push(Diagnostic::in_file(diagnostic, log_path)),
            }
        }
        Ok((written, diagnostics))
    })
}

/// A name as a file may carry it: what is no letter, digit, dot, dash or underscore is written `%2F`.
fn file_name(name: &str) -> String {
    let plain = |b: &u8| b.is_ascii_alphanumeric() || matches!(b, b'-' | b'_') || *b == b'.';
    let dots = name.bytes().all(|b| b == b'.');
    name.bytes()
        .map(|b| if plain(&b) && !dots { char::from(b).to_string() } else { format!("%{b:02X}") })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_name_leaves_its_folder() {
        assert_eq!(file_name("N412FP"), "N412FP");
        assert_eq!(file_name("../x"), "..%2Fx");
        assert_eq!(file_name(".."), "%2E%2E");
    }
}
