//! Results: gap records, accounts of logs and accounts of runs, kept in Delta tables.
//!
//! A store is a folder that other engines can open as it is:
//!
//! ```text
//! results/
//!   store.json   the format of the folder
//!   lock         who writes, while somebody does
//!   gaps/        one row per actuator and flight
//!   logs/        one row per log and run that finished with it
//!   runs/        one row when a run begins and one when it ends
//! ```
//!
//! A prefix of a bucket holds the same, but for the lock: `docs/store.md` says what that means.
//!
//! One process writes at a time ([`Store::lock`]); any number read meanwhile, and each answer is made
//! from one version of a table, so it shows whole commits only. A commit is on disk when it returns.
//! The choice of Delta Lake, its layout and its guarantees are told in `docs/store.md`.

mod account;
mod adopt;
pub mod columns;
mod compact;
mod datafile;
mod durable;
mod error;
mod export;
mod frame;
mod info;
mod latest;
mod layout;
mod lock;
mod newest;
mod numbered;
mod parts;
mod place;
mod query;
mod read;
mod runs;
mod stats;
mod table;
mod tabled;
mod verify;
mod writer;

pub use account::{LogAccount, Outcome, RunAccount};
pub use adopt::Adopted;
pub use compact::Compaction;
pub use error::Error;
pub use export::Format;
pub use info::Info;
pub use layout::Store;
pub use lock::Holder;
pub use parts::Parts;
pub use query::{Query, RecordKey};
pub use writer::{LogResult, Writer};
