//! Result store: gap records, log records and run records in Delta tables.
//!
//! A store is a folder, or a prefix of a bucket, that other engines can open: `docs/store.md` explains its layout and the
//! guarantees. One process writes at a time ([`Store::lock`]). Any number of processes read at the same time; each query
//! reads one version of a table and therefore sees whole commits only. A commit is on disk when it returns.
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
pub use delta::table::live_files;
pub use error::Error;
pub use handle::Store;
pub use read::column_scan::ColumnScan;
pub use read::query::Query;
pub use records::{AlertRecord, LogOutcome, LogRecord, RecordKey, RunRecord, WorkEvent};
pub use write::compact::Compaction;
pub use write::writer::{HeldRecord, LogResult, Writer};
