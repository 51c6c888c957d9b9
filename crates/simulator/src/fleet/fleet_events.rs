//! Events of a fleet's life in a [`Spec`](crate::Spec): exchanges, replacements, re-shims, inspections, changes, faulty log files.

use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;

use crate::fleet::wear::WearLaw;
use crate::load::vibration::Vibration;

/// A tail and a position on it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Place {
    /// The tail.
    pub tail: String,
    /// The position.
    pub position: String,
}

/// Before a flight, the units of two places change places.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Swap {
    /// The first flight of both tails with the new arrangement, counted from 1, so at least 2.
    pub before_flight: usize,
    /// One place.
    pub from: Place,
    /// The other.
    pub to: Place,
}

/// Before a flight, a unit leaves the fleet and a spare takes its place.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Replacement {
    /// The first flight of the spare, counted from 1, so at least 2.
    pub before_flight: usize,
    /// The tail.
    pub tail: String,
    /// The position.
    pub position: String,
    /// Serial number of the spare.
    pub serial_number: String,
    /// Its gap, metres.
    pub gap_m: f64,
    /// Its age, hours. Default 0, new.
    #[serde(default)]
    pub unit_hours: f64,
    /// How it wears. Default the part's law.
    pub wear: Option<WearLaw>,
}

/// Before a flight, the gap of an installed unit is set by a shim.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Reshim {
    /// The first flight with the new gap, counted from 1, so at least 2.
    pub before_flight: usize,
    /// The tail.
    pub tail: String,
    /// The position.
    pub position: String,
    /// The gap from then on, metres.
    pub gap_m: f64,
    /// Whether the maintenance table has a row for it. Default true.
    #[serde(default = "default_is_recorded")]
    pub is_recorded: bool,
}

fn default_is_recorded() -> bool {
    true
}

/// Before a flight, the play of an installed unit is measured in the hangar.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlayCheck {
    /// The flight after the check, counted from 1, so at least 2.
    pub before_flight: usize,
    /// The tail.
    pub tail: String,
    /// The position.
    pub position: String,
    /// Reading minus the true gap, metres. Default 0.
    #[serde(default)]
    pub error_m: f64,
    /// The instrument.
    pub instrument: String,
    /// The force at which the play is read, N.
    pub force_n: f64,
}

/// A change of the actuators that meet all of its conditions; a condition that is left out holds for all.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, SmartDefault)]
#[serde(deny_unknown_fields, default)]
pub struct PlantedChange {
    /// The aircraft.
    pub tail: Option<String>,
    /// The place.
    pub position: Option<String>,
    /// The design.
    pub part_number: Option<String>,
    /// The unit, wherever it is installed.
    pub serial_number: Option<String>,
    /// First flight of a tail that shows the change, counted from 1. Default 1.
    #[default(1)]
    pub from_flight: usize,
    /// Flight from which the whole change shows; in between it grows in proportion. Default `from_flight`: a step.
    pub to_flight: Option<usize>,
    /// Stiffness over that before. Default 1.
    #[default(1.0)]
    pub stiffness_factor: f64,
    /// Dry and load-dependent friction over that before. Default 1.
    #[default(1.0)]
    pub friction_factor: f64,
    /// Added to the gain error of the load cell. Default 0.
    pub load_gain: f64,
    /// Added to the zero error of the load cell, N. Default 0.
    pub load_bias_n: f64,
    /// Added to the delay of the screw channel, seconds. Default 0.
    pub skew_s: f64,
    /// Added to the delay of the load channel, seconds. Default 0.
    pub load_delay_s: f64,
    /// Vibration of the load in place of the profile's. Default the profile's.
    pub buffet: Option<Vibration>,
}

/// A log file that does not arrive as it was recorded.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LogFault {
    /// The tail.
    pub tail: String,
    /// Which of the tail's logs, counted from 1.
    pub log: usize,
    /// What happens to it.
    pub fault: FaultKind,
}

/// What happens to a log file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FaultKind {
    /// It arrives a second time under another name.
    Duplicate,
    /// Its transfer stopped: only the beginning arrives, in a folder of its own, `arrives-later/`.
    Truncated,
}
