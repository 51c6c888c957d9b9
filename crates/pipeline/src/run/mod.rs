//! A run: workers, the single writer, and the run summary.

pub mod distributed;
mod flight_ownership;
mod memory_budget;
pub mod scheduler;
pub mod summary;
pub(crate) mod time_limit;
mod worker_pool;

use records::Diagnostic;

/// One thing that happened. Events of different logs may come in any order.
#[derive(Debug, Clone, PartialEq)]
#[expect(missing_docs, reason = "each field is named for what it holds")]
pub enum Event {
    Planned {
        logs: usize,
        bytes: u64,
    },
    Started {
        log: String,
    },
    /// A log is finished, with its gaps, its flights without one, and its errors.
    Finished {
        log: String,
        bytes: u64,
        estimated: usize,
        refused: usize,
        diagnostics: Vec<Diagnostic>,
    },
    /// Number of logs that are now safe in the store.
    Stored {
        logs: usize,
    },
    Trends {
        units: usize,
    },
}
