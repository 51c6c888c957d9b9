//! The gap of one serial number against its age: level, rate, changes, and when the limit is met.
//!
//! This crate knows ages and gaps, never a file, a filter or a clock: the day of a statement is an
//! argument, and nothing later than it is looked at.

pub mod classic;
mod error;
mod normal;
mod prior;
mod rate;
pub mod series;
mod settings;
mod trend;

pub use error::Error;
pub use prior::FleetPrior;
pub use series::{Observation, Series, Usage};
pub use settings::Settings;
pub use trend::{
    Change, ChangeKind, Crossing, FEWEST_ESTIMATES, Level, Rate, Reason, State, Trend, Wear, trend,
};
