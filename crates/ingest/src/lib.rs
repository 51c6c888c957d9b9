//! Flight logs in, canonical channels out: SI units, one clock, one actuator at a time.
//!
//! Only this crate knows what a column is called and in which unit it was logged; nobody after it
//! converts a unit. A log that cannot be used becomes an [`Error`] that names file, column, row and
//! remedy, and nothing else is affected.
//!
//! The way of a log: [`Log::open`] reads the footers, [`Log::identity`] says which flight it was,
//! [`Log::positions`] which actuators it holds, and [`Log::actuator`] reads the channels of one of them
//! on one clock.

pub mod arrays;
mod channel;
mod checksum;
pub mod clock;
mod coded;
mod condition;
mod digest;
pub mod error;
mod file;
pub mod flights;
mod growing;
mod hold;
pub mod identity;
mod leaf;
pub mod log;
pub mod noise;
pub mod normal;
mod numbers;
mod page;
pub mod pattern;
mod positioned;
pub mod propose;
pub mod quality;
mod resample;
mod scan;
pub mod schema;
pub mod screw;
mod sheet;
mod source;
mod spare;
mod straight;
pub mod tables;
pub mod unit;
mod wanted;
pub mod write;

pub use clock::Timeline;
pub use condition::Condition;
pub use error::{Error, Fault};
pub use flights::Flights;
pub use identity::Identity;
pub use log::{Actuator, Files, Log, PositionColumns};
pub use quality::Quality;
pub use schema::{
    ChannelMapping, Channels, ClockMapping, GroupMapping, IdentityMapping, Layout, Mapping, Role,
};
pub use screw::Geometry;
