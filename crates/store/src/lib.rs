//! Result store: gap records, log records and run records in Delta tables.
//!
//! A store is a folder that other engines can open:
//!
//! ```text
//! results/
//!   store.json   format version of the store
//!   lock         the current writer, while there is one
//!   gaps/        one row per actuator and flight
//!   logs/        one row per log and run that finished with it
//!   runs/        one row at the start of a run and one at its end
//!   alerts/      changes of state, and what became of their messages; from the first alert on
//!   work/        events of work requests; from the first request on
//!   states/      state of each unit after the last run, for the next run to tell what changed
//! ```
//!
//! A prefix of a bucket holds the same, except for the lock: see `docs/store.md`.
//!
//! One process writes at a time ([`Store::lock`]). Any number of processes read at the same time; each query reads
//! one version of a table and therefore sees whole commits only. A commit is on disk when it returns.
//! `docs/store.md` explains the layout and the guarantees.
//!
//! ```
//! use store::{LogResult, Query, Store};
//!
//! let dir = tempfile::tempdir()?;
//! let store = Store::create_or_open(dir.path().join("results"))?;
//! // One writer at a time, which holds the lock until it is dropped.
//! let mut writer = store.lock(None)?;
//! assert!(store.lock(None).is_err());
//! let results: Vec<LogResult> = Vec::new();
//! writer.commit(&results)?;
//!
//! let query = Query { tail_number: Some("N412FP".into()), ..Query::default() };
//! assert!(store.records(&query)?.is_empty());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod admin;
mod delta;
mod error;
mod handle;
mod read;
mod store_dir;
mod write;

pub use admin::info::Info;
pub use admin::withdraw::Withdrawal;
pub use delta::foreign_table::live_files;
pub use error::Error;
pub use handle::Store;
pub use read::column_scan::ColumnScan;
pub use read::query::Query;
pub use records::{AlertRecord, LogOutcome, LogRecord, RecordKey, RunRecord, WorkEvent};
pub use write::compact::Compaction;
pub use write::writer::{HeldRecord, LogResult, Writer};
