//! The processing pipeline: discovers flight logs, estimates one flight per worker, stores every finished flight, and
//! returns a run summary that accounts for every log.
//!
//! ```text
//! logs → run → (store) → fleet → assess → findings → report
//! inspect: single logs and records, for a person at a prompt
//! ```
//!
//! This crate alone uses rayon. It prints nothing: it reports [`Event`]s and returns a [`RunSummary`]. Results depend
//! neither on the number of workers nor on the order in which they finish.

pub mod assess;
mod error;
pub mod findings;
pub mod fleet;
pub mod inspect;
pub mod logs;
pub mod report;
pub mod run;

pub use error::Error;
pub use fleet::bookkeeping::join::open_store;
pub use logs::plan::{Plan, Request};
pub use run::Event;
pub use run::scheduler::run;
pub use run::summary::{RunEnd, RunSummary};
pub use trend::State;
