//! What a fleet writes down in `pipeline.toml`, and what it makes of one flight: log in, records out.
//!
//! [`Config`] is checked whole before the first flight; [`Opened::record`] is a pure composition of
//! the floors below it, the same in the nightly run, at the prompt and in a notebook.

pub mod config;
pub mod estimate;
pub mod facts;
pub mod flight;
pub mod look;
pub mod normalize;
pub mod part;
pub mod schedules;
pub mod trace;
pub mod value;

pub use config::Config;
pub use flight::{Opened, Stamp};
pub use part::Part;

/// Changes with every change to the method that can move a number; part of every configuration digest.
pub const METHOD_VERSION: u32 = 6;
