//! Flight logs in, canonical channels out: SI units, one clock, one actuator at a time.
//!
//! Only this crate knows the names and units of logged columns; no later crate
//! converts a unit. A log that cannot be used becomes an [`Error`] that names file, column, row and
//! remedy, and nothing else is affected.
//!
//! The way of a log: [`Log::open`] reads the footers, [`Log::identity`] identifies the flight,
//! `Log::actuators` which actuators it holds, and `Log::read_actuator` reads the channels of one of them
//! on one clock.

pub mod channel;
pub mod error;
mod io;
pub mod log;
pub mod mapping;
pub mod parquet;
pub mod tables;
pub mod time;

pub use channel::quality::Quality;
pub use channel::si_conversion::Geometry;
pub use error::{Error, ErrorKind};
pub use log::identity::Identity;
pub use log::{ActuatorChannels, ActuatorColumns, Log, LogFiles};
pub use mapping::{
    ChannelMapping, Channels, ClockMapping, GroupMapping, IdentityMapping, Layout, Mapping, Role,
    SampleFilter,
};
pub use tables::flights::Flights;
pub use time::clock::TimeBase;
