//! Events of a run, for observers.

use records::Diagnostic;

/// One thing that happened. Events of different logs may come in any order.
#[derive(Debug, Clone, PartialEq)]
pub enum Event {
    /// The plan is complete: number and bytes of the logs to read.
    Planned {
        /// Logs to do.
        logs: usize,
        /// Their size.
        bytes: u64,
    },
    /// A worker took a log.
    Started {
        /// Its name.
        log: String,
    },
    /// A log is finished: estimated, refused or in error.
    Finished {
        /// Its name.
        log: String,
        /// Its size.
        bytes: u64,
        /// Gaps.
        estimated: usize,
        /// Sound logs that cannot show one.
        refused: usize,
        /// What is wrong with it.
        diagnostics: Vec<Diagnostic>,
    },
    /// Number of logs that are now safe in the store.
    Stored {
        /// Logs in this commit.
        logs: usize,
    },
    /// Number of units whose trends are being assessed.
    Trends {
        /// Units.
        units: usize,
    },
}
