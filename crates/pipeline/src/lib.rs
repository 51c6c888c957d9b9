//! The processing pipeline: discovers flight logs, estimates one flight per worker, stores every finished flight, and
//! returns a run summary that accounts for every log.
//!
//! This crate alone uses rayon. It prints nothing: it reports [`Event`]s and returns a [`RunSummary`]. Results depend
//! neither on the number of workers nor on the order in which they finish.

pub mod bookkeeping;
pub mod check;
pub mod discovery;
mod error;
pub mod estimate;
pub mod estimate_plots;
pub mod explain;
pub mod fleet_trends;
pub mod follow_up;
pub mod history;
pub mod monitoring;
pub mod normalize;
pub mod quantities;
pub mod report;
pub mod run;
pub mod simulate;
pub mod store_diff;
pub mod time_limit;

pub use bookkeeping::join::open_store;
pub use error::Error;
pub use run::event::Event;
pub use run::plan::{Plan, Request, WorkReason};
pub use run::scheduler::run;
pub use run::summary::{RunEnd, RunSummary};
pub use trend::State;
