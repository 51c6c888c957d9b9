//! The gap of one serial number against its age: level, rate, changes, and when the limit is met.
//!
//! This crate knows ages and gaps, never a file, a filter or a clock: the day of a statement is an
//! argument, and nothing later than it is looked at.
//!
//! A [`Series`] adds up a unit's usage, a [`FleetPrior`] learns from a part number's units, and [`trend()`]
//! weighs a bank of wear curves by both.
//!
//! # What would make it wrong
//!
//! - A law far from every curve of the bank. Intervals widen to what the fleet's own past shows
//!   (`calibrate`), but a turn that no unit has made yet is in no history: of six such laws the 90 %
//!   interval held 71 to 97 % (`examples/foreign`).
//! - Life that ends other than by growth to the limit, or growth that depends on what no usage axis shows.
//! - A measurement whose bias drifts for years: it is taken for wear. A yearly swing is not.
//! - Maintenance that lowers the gap by less than about 5 µm: no step is found, wear is underestimated.
//! - A fleet of fewer than some thirty units: the prior then is mostly what was assumed.

mod advance;
mod bins;
mod bytes;
mod calibrate;
mod checkpoint;
pub mod classic;
mod clean;
mod crossing;
mod curve;
mod digest;
mod error;
mod filter;
mod grounded;
mod history;
mod jump;
mod kept;
mod learn;
mod level;
mod look;
mod memory;
mod mixture;
mod normal;
mod outlook;
mod posterior;
mod prior;
mod regressions;
mod season;
pub mod series;
mod settings;
mod state;
mod tail;
mod trend;

pub use error::Error;
pub use kept::Kept;
pub use memory::remembered;
pub use outlook::{Band, Outlook, outlook};
pub use prior::{Axis, FleetPrior};
pub use series::{Booked, Observation, Series, Usage};
pub use settings::Settings;
pub use state::{Reason, State};
pub use trend::{
    Change, ChangeKind, Crossing, FEWEST_ESTIMATES, Level, Pace, Rate, Trend, Wear, WearLaw, trend,
};
