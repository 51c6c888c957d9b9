//! The estimation job: `pipeline.toml` in, one gap record per actuator and flight out.
//!
//! [`Config`] is validated completely before the first flight. [`FlightLog::record`] composes ingest and estimator;
//! every caller (run, command line, Python) uses it.

pub mod config;
pub mod estimate;
pub mod flight_log;
pub mod panic;
pub mod part_identification;
pub mod rejection;
pub mod trace;

pub use config::Config;
pub use config::part::Part;
pub use flight_log::FlightLog;

/// Version of the estimation method: changes with every change that can move a number; part of every configuration
/// digest.
pub const METHOD_VERSION: u32 = 22;
