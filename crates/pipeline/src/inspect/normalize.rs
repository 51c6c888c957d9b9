//! Many logs to normalized logs, one log per worker.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use ingest::LogFiles;
use ingest::parquet::writer::Encoding;
use job::Config;
use rayon::prelude::*;
use records::{Diagnostic, Installations};

use crate::error::Error;
use crate::run::event::Event;

/// What became of the logs.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Normalized {
    /// The files written, in order of the logs.
    pub written: Vec<PathBuf>,
    /// What could not be.
    pub diagnostics: Vec<Diagnostic>,
}

/// Writes the normalized logs of some logs below a folder.
///
/// # Errors
/// When workers cannot be started. Logs in error are diagnostics.
pub fn normalize(
    config: &Config,
    installations: &Installations,
    logs: &[(LogFiles, String)],
    folder: &Path,
    encoding: Encoding,
    jobs: Option<usize>,
    watch: &(dyn Fn(Event) + Sync),
) -> Result<Normalized, Error> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(jobs.unwrap_or(0)).build()?;
    watch(Event::Planned { logs: logs.len(), bytes: 0 });
    let claims: Mutex<BTreeMap<PathBuf, String>> = Mutex::default();
    let one = |(files, log_path): &(LogFiles, String)| {
        let claim = |file: &Path, digest: &str| claimed(&claims, file, log_path, digest);
        let done =
            job::normalize::normalize(files, log_path, config, installations, folder, encoding, &claim);
        let done = done.unwrap_or_else(|diagnostic| (Vec::new(), vec![diagnostic]));
        let (log, diagnostics) = (log_path.clone(), done.1.clone());
        watch(Event::Finished { log, bytes: 0, estimated: done.0.len(), refused: 0, diagnostics });
        done
    };
    let done: Vec<_> = pool.install(|| logs.par_iter().map(one).collect());
    let mut all = Normalized::default();
    for (written, diagnostics) in done {
        all.written.extend(written);
        all.diagnostics.extend(diagnostics);
    }
    Ok(all)
}

/// Gives a file to a log, where no other log of this run has it and it is not there, or is of the same log.
fn claimed(
    claims: &Mutex<BTreeMap<PathBuf, String>>,
    file: &Path,
    log_path: &str,
    digest: &str,
) -> Result<(), Diagnostic> {
    let mut claims = claims.lock().unwrap_or_else(PoisonError::into_inner);
    let owner = match claims.get(file) {
        Some(other) => Some(format!("the normalized log of {other}")),
        None if file.symlink_metadata().is_err() => None,
        None => match ingest::log::normalized::source(file) {
            Some((log, of)) if log == log_path || of == digest => None,
            Some((log, _)) => Some(format!("the normalized log of {log}")),
            None => Some("not a normalized log".to_owned()),
        },
    };
    if let Some(owner) = owner {
        let what = format!("{} exists and is {owner}", file.display());
        let hint = "remove one of the logs or the file, or name another folder";
        return Err(Diagnostic::new("would_overwrite", what).hint(hint));
    }
    claims.insert(file.to_owned(), log_path.to_owned());
    Ok(())
}
