//! The gap of one serial number against its age: level, rate, changes, and when the limit is met.
//!
//! This crate knows ages and gaps, never a file, a filter or a clock: the day of a statement is an
//! argument, and nothing later than it is looked at.
//!
//! A [`Series`] adds up a unit's usage, a [`FleetPrior`] learns from a part number's units, and [`trend()`]
//! weighs a bank of wear curves by both.
//!
//! # From night to night
//!
//! A [`Kept`] holds what a unit's flights said, in some 10 kB, so that a flight more costs the same however
//! long the history is. What is said from it is what [`trend()`] says from the whole history, to the last bit:
//!
//! ```
//! use trend::{FleetPrior, Kept, Observation, Series, Settings, Usage, trend};
//!
//! let flight = |day: i64| Observation {
//!     departure_us: day * 86_400_000_000,
//!     installation: 0,
//!     flight_hours: Some(1.5),
//!     tail_hours_end: None,
//!     load_reversals: None,
//!     gap_m: Some(30e-6 + 1e-8 * day as f64 + 1e-6 * (day as f64).sin()),
//!     gap_se_m: Some(1e-6),
//! };
//! let (settings, prior) = (Settings::for_limit(1e-4), FleetPrior::vague(1e-4));
//! let series = |days| Series::new((0..days).map(flight), &Usage::default());
//! let day_us = |day: i64| day * 86_400_000_000;
//!
//! let bytes = Kept::of(&series(500)?, day_us(499), &prior).to_bytes();
//! // The next night: the state, a flight, and none of those before.
//! let kept = Kept::from_bytes(&bytes, &prior).ok_or("made anew from its history")?;
//! let kept = kept.after([flight(500)])?.ok_or("made anew from its history")?;
//! let said = kept.says(day_us(500), &[], &settings, &prior, None)?.ok_or("made anew from its history")?;
//! assert_eq!(said, trend(&series(501)?, day_us(500), &settings, Some(&prior), None)?);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # What would make it wrong
//!
//! - A law far from every curve of the bank. Intervals widen to what the fleet's own past shows
//!   (`calibrate`), but a turn that no unit has made yet is in no history: of nine such laws the 90 %
//!   interval held 76 to 97 % (`examples/foreign`).
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
mod course;
mod crossing;
mod curve;
mod digest;
mod each;
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

pub use each::{Each, InTurn};
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
