//! Flight logs in, canonical channels out: SI units, one clock, one actuator at a time.
//!
//! Only this crate knows the names and units of logged columns; no later crate
//! converts a unit. A log that cannot be used becomes an [`Error`] that names file, column, row and
//! remedy, and nothing else is affected.
//!
//! A log is read in four steps: [`Log::open`] reads the footers, [`Log::identity`] identifies the flight,
//! [`Log::actuators`] finds its actuators, and [`Log::read_actuator`] reads the channels of one actuator
//! on one clock.
//!
//! ```
//! use ingest::mapping::units::{TimeUnit, Unit};
//! use ingest::parquet::writer::{Column, write_parquet};
//! use ingest::{ChannelMapping, Channels, ClockMapping, Geometry, Log, LogFiles, Mapping};
//!
//! // A log at 100 Hz: motor angle in degrees behind a lead of 5 mm, screw position in mm, load in kN.
//! let dir = tempfile::tempdir()?;
//! let file = dir.path().join("flight.parquet");
//! let turns = (0..500).map(|k| f64::from(k) / 100.0);
//! let columns = [
//!     ("time_s", turns.clone().collect()),
//!     ("aileron_motor", turns.clone().map(|turns| 360.0 * turns).collect()),
//!     ("aileron_screw", turns.clone().map(|turns| 5.0 * turns + 0.1).collect()),
//!     ("aileron_load", turns.map(|turns| 8.0 * turns.sin()).collect()),
//! ];
//! write_parquet(&file, &columns.map(|(name, values)| (name.to_owned(), Column::Real(values))), &[])?;
//!
//! let channel = |column: &str, unit| ChannelMapping { column: column.into(), unit, ..Default::default() };
//! let mapping = Mapping {
//!     clock: ClockMapping {
//!         column: Some("time_s".into()),
//!         unit: Some(TimeUnit::Second),
//!         ..Default::default()
//!     },
//!     channels: Channels {
//!         motor_position: channel("{position}_motor", Unit::Degree),
//!         screw_position: Some(channel("{position}_screw", Unit::Millimetre)),
//!         load: channel("{position}_load", Unit::Kilonewton),
//!         ..Default::default()
//!     },
//!     ..Default::default()
//! };
//! let log = Log::open(&LogFiles::one(&file), &mapping.clone().into())?;
//! let actuators = log.actuators(&mapping.channels, None)?;
//! let screw = Geometry::Linear { lead_m_per_rev: Some(0.005) };
//! let channels = log.read_actuator(&actuators[0], &mapping.channels, screw)?;
//! assert_eq!(channels.position.as_str(), "aileron");
//! // δX = 0.1 mm at every sample.
//! assert!(channels.dx_m.iter().all(|dx_m| (dx_m - 1e-4).abs() < 1e-12));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod bounds;
pub mod channel;
mod error;
pub mod infer;
mod io;
pub mod log;
pub mod mapping;
pub mod parquet;
pub mod tables;
mod time;

pub use channel::quality::Quality;
pub use channel::si_conversion::Geometry;
pub use error::{Error, is_passing, is_transient};
pub use log::identity::Identity;
pub use log::{ActuatorChannels, ActuatorColumns, Log, LogFiles};
pub use mapping::{
    ChannelMapping, Channels, ClockMapping, GroupMapping, IdentityMapping, Layout, Mapping, RawValue, Role,
    SampleFilter,
};
pub use tables::flights::Flights;
