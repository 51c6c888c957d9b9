//! Flight logs in, canonical channels out: SI units, one clock, one actuator at a time.
//!
//! Only this crate knows what a column is called and in which unit it was logged; nobody after it
//! converts a unit. A log that cannot be used becomes an [`Error`] that names file, column, row and
//! remedy, and nothing else is affected.
//!
//! The way of a log: [`Log::open`] reads the footer, [`Log::identity`] says which flight it was,
//! [`Log::positions`] which actuators it holds, [`Log::timeline`] puts its rows on one clock, and
//! [`Log::actuator`] reads the channels of one of them.

pub mod clock;
pub mod error;
pub mod identity;
pub mod log;
pub mod pattern;
pub mod quality;
mod read;
pub mod schema;
pub mod tables;
pub mod unit;
pub mod write;

pub use clock::Timeline;
pub use error::{Error, Fault};
pub use identity::Identity;
pub use log::{Actuator, Geometry, Log, PositionColumns};
pub use quality::Quality;
pub use schema::{ChannelMapping, Channels, ClockMapping, IdentityMapping, Mapping};
