//! Events of a run, for observers.

use records::Diagnostic;

/// One thing that happened. Events of different logs may come in any order.
#[derive(Debug, Clone, PartialEq)]
#[expect(missing_docs, reason = "each field is named for what it holds")]
pub enum Event {
    /// The plan is complete: number and bytes of the logs to read.
    Planned { logs: usize, bytes: u64 },
    /// A worker took a log.
    Started { log: String },
    /// A log is finished, with its gaps, its flights without one, and its errors.
    Finished { log: String, bytes: u64, estimated: usize, refused: usize, diagnostics: Vec<Diagnostic> },
    /// Number of logs that are now safe in the store.
    Stored { logs: usize },
    /// Number of units whose trends are being assessed.
    Trends { units: usize },
}
