//! Many logs to normalized logs, one log per worker.

use std::path::{Path, PathBuf};

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
    (folder, encoding): (&Path, Encoding),
    jobs: Option<usize>,
    watch: &(dyn Fn(Event) + Sync),
) -> Result<Normalized, Error> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(jobs.unwrap_or(0)).build()?;
    watch(Event::Planned { logs: logs.len(), bytes: 0 });
    let one = |(files, log_path): &(LogFiles, String)| {
        let done = job::normalize::normalize(files, log_path, config, installations, (folder, encoding));
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
