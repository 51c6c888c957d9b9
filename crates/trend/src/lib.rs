//! The gap of one serial number against its age: level, rate, changes, and when the limit is met.
//!
//! This crate knows ages and gaps, never a file, a filter or a clock: the day of a statement is an
//! argument, and nothing later than it is looked at.

mod bins;
pub mod classic;
mod clean;
mod crossing;
mod curve;
mod error;
mod filter;
mod history;
mod jump;
mod learn;
mod level;
mod look;
mod normal;
mod posterior;
mod prior;
mod season;
pub mod series;
mod settings;
mod state;
mod trend;

pub use error::Error;
pub use prior::{Axis, FleetPrior};
pub use series::{Observation, Series, Usage};
pub use settings::Settings;
pub use state::{Reason, State};
pub use trend::{
    Change, ChangeKind, Crossing, FEWEST_ESTIMATES, Level, Pace, Rate, Trend, Wear, WearLaw, trend,
};
