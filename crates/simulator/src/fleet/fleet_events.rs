//! Events of a fleet's life in a [`Spec`](crate::Spec): exchanges, replacements, re-shims, inspections, changes, faulty log files.

use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;

use crate::fleet::wear::WearLaw;
use crate::load::vibration::Vibration;

/// A tail and a position on it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Place {
    pub tail: String,
    pub position: String,
}

/// Before a flight, the units of two places change places. Flights are counted from 1, here and below.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Swap {
    pub before_flight: usize,
    pub from: Place,
    pub to: Place,
}

/// Before a flight, a unit leaves the fleet and a spare takes its place.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Replacement {
    pub before_flight: usize,
    pub tail: String,
    pub position: String,
    pub serial_number: String,
    pub gap_m: f64,
    #[serde(default)]
    pub unit_hours: f64,
    pub wear: Option<WearLaw>,
}

/// Before a flight, the gap of an installed unit is set by a shim.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Reshim {
    pub before_flight: usize,
    pub tail: String,
    pub position: String,
    pub gap_m: f64,
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
    pub before_flight: usize,
    pub tail: String,
    pub position: String,
    #[serde(default)]
    pub error_m: f64,
    pub instrument: String,
    pub force_n: f64,
}

/// A change of the actuators that meet all of its conditions; a condition that is left out holds for all.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, SmartDefault)]
#[serde(deny_unknown_fields, default)]
pub struct PlantedChange {
    pub tail: Option<String>,
    pub position: Option<String>,
    pub part_number: Option<String>,
    pub serial_number: Option<String>,
    #[default(1)]
    pub from_flight: usize,
    pub to_flight: Option<usize>,
    #[default(1.0)]
    pub stiffness_factor: f64,
    #[default(1.0)]
    pub friction_factor: f64,
    pub load_gain: f64,
    pub load_bias_n: f64,
    pub skew_s: f64,
    pub load_delay_s: f64,
    pub buffet: Option<Vibration>,
}

/// A log file that does not arrive as it was recorded.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LogFault {
    pub tail: String,
    pub log: usize,
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
