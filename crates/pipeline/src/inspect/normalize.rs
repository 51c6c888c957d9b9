//! Logs to normalized logs, one log per worker: a file for each actuator, which `run` reads back to the same gap.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use ingest::LogFiles;
use ingest::parquet::writer::Encoding;
use job::Config;
use job::flight_log::{Actuator, FlightLog, catch_panic};
use rayon::prelude::*;
use records::{Diagnostic, Installations};

use crate::logs::discover::{NamedLog, SelectedLogs};
use crate::{Error, Event};

/// What became of the logs.
#[derive(Debug, Clone, Default, PartialEq)]
#[expect(missing_docs, reason = "each field is named for what it holds")]
pub struct Normalized {
    /// The files written, in order of the logs.
    pub written: Vec<PathBuf>,
    pub diagnostics: Vec<Diagnostic>,
}

/// Writes the normalized logs of the selected logs below a folder, as `TAIL/DEPARTURE_FLIGHT/POSITION.parquet`: a flight
/// number flies again.
///
/// # Errors
/// When workers cannot be started. Logs and actuators in error are diagnostics; the others are written.
pub fn normalize(
    config: &Config,
    installations: &Installations,
    selected: SelectedLogs,
    folder: &Path,
    encoding: Encoding,
    jobs: Option<usize>,
    watch: &(dyn Fn(Event) + Sync),
) -> Result<Normalized, Error> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(jobs.unwrap_or(0)).build()?;
    watch(Event::Planned { logs: selected.logs.len(), bytes: 0 });
    let request = Normalization { config, installations, folder, encoding, claims: Mutex::default() };
    let one = |(log_path, files): &NamedLog| {
        let mut done = Normalized::default();
        let failed = catch_panic(log_path, || request.one(files, log_path, &mut done)).err();
        done.diagnostics.extend(failed);
        let (log, diagnostics) = (log_path.clone(), done.diagnostics.clone());
        watch(Event::Finished { log, bytes: 0, estimated: done.written.len(), refused: 0, diagnostics });
        done
    };
    let done: Vec<_> = pool.install(|| selected.logs.par_iter().map(one).collect());
    let mut all = Normalized { diagnostics: selected.faults, ..Normalized::default() };
    for of_log in done {
        all.written.extend(of_log.written);
        all.diagnostics.extend(of_log.diagnostics);
    }
    Ok(all)
}

struct Normalization<'a> {
    config: &'a Config,
    installations: &'a Installations,
    folder: &'a Path,
    encoding: Encoding,
    /// Name and digest of the log of each file.
    claims: Mutex<BTreeMap<PathBuf, (String, String)>>,
}

impl Normalization<'_> {
    fn one(&self, files: &LogFiles, log_path: &str, done: &mut Normalized) -> Result<(), Diagnostic> {
        let opened = FlightLog::open(files, log_path, self.config, self.installations)?;
        for at in opened.actuators().filter(|at| at.columns.lacking.is_empty()) {
            match self.write(&opened, at) {
                Ok(file) => done.written.extend(file),
                Err(diagnostic) => done.diagnostics.push(diagnostic.in_file(log_path)),
            }
        }
        Ok(())
    }

    /// Writes the normalized log of an actuator; nothing for a copy of a log that has been written.
    fn write(&self, opened: &FlightLog<'_>, at: &Actuator) -> Result<Option<PathBuf>, Diagnostic> {
        let id = &opened.identity;
        let (installation, part) = opened.unit(at)?;
        let channels = opened.channels(at, part)?;
        let flight =
            format!("{}_{}", id.flight.departure_utc.strftime("%Y%m%dT%H%M%SZ"), id.flight.flight_id);
        let names = [id.flight.tail_number.as_str(), &flight, at.columns.position.as_str()].map(file_name);
        let file = self.folder.join(&names[0]).join(&names[1]).join(format!("{}.parquet", names[2]));
        if !self.claim(&file, opened)? {
            return Ok(None);
        }
        let provenance = BTreeMap::from([
            ("source_log".to_owned(), opened.display_name.clone()),
            ("source_digest".to_owned(), opened.digest.clone()),
            ("config_digest".to_owned(), opened.config_digest(installation)),
            ("part_number".to_owned(), installation.part_number.to_string()),
            ("serial_number".to_owned(), installation.serial_number.to_string()),
        ]);
        ingest::log::normalized::write(&file, &channels, id, part.geometry, &provenance, self.encoding)
            .map_err(|e| e.diagnostic())?;
        Ok(Some(file))
    }

    /// Gives a file to a log, where no other log of this run has it and it is not there, or is of the same log. False if a
    /// copy of the log has the file.
    fn claim(&self, file: &Path, opened: &FlightLog<'_>) -> Result<bool, Diagnostic> {
        let log_path = opened.display_name.as_str();
        let mut claims = self.claims.lock().unwrap_or_else(PoisonError::into_inner);
        let owner = match claims.get(file) {
            Some((_, digest)) if *digest == opened.digest => return Ok(false),
            Some((other, _)) => Some(format!("the normalized log of {other}")),
            None if file.symlink_metadata().is_err() => None,
            None => match ingest::log::normalized::source(file) {
                Some((log, digest)) if log == log_path || digest == opened.digest => None,
                Some((log, _)) => Some(format!("the normalized log of {log}")),
                None => Some("not a normalized log".to_owned()),
            },
        };
        if let Some(owner) = owner {
            let what = format!("{} exists and is {owner}", file.display());
            let hint = "remove one of the logs or the file, or name another folder";
            return Err(Diagnostic::new("would_overwrite", what).hint(hint));
        }
        claims.insert(file.to_owned(), (log_path.to_owned(), opened.digest.clone()));
        Ok(true)
    }
}

/// A name as a file may carry it: what is no letter, digit, dot, dash or underscore is written `%2F`. So is a first dot,
/// which would hide the file from `run`.
fn file_name(name: &str) -> String {
    let is_plain =
        |at: usize, b: u8| b.is_ascii_alphanumeric() || b"-_".contains(&b) || (b == b'.' && at > 0);
    let written = |(at, b)| if is_plain(at, b) { char::from(b).to_string() } else { format!("%{b:02X}") };
    name.bytes().enumerate().map(written).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_name_leaves_its_folder() {
        assert_eq!(file_name("N412FP"), "N412FP");
        assert_eq!(file_name("../x"), "%2E.%2Fx");
        assert_eq!(file_name(".N412.FP"), "%2EN412.FP");
    }
}
