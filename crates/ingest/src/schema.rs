//! What a log must offer, and where in it: the mapping that `pipeline.toml` writes down.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::unit::{TimeUnit, Unit};

/// Everything needed to read one fleet's logs.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Mapping {
    /// Which flight a log is.
    pub identity: IdentityMapping,
    /// Its clock.
    pub clock: ClockMapping,
    /// Its channels.
    pub channels: Channels,
}

/// Where tail, flight and departure stand: in the file's metadata, in constant columns, in its path,
/// or in the configuration itself. For each fact the first source that has it wins, in that order.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct IdentityMapping {
    /// Key-value metadata of the Parquet footer: fact → key. Facts: `tail_number`, `flight_id`,
    /// `departure_utc`, `position`, `flight_hours`, `tail_hours_end`.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub metadata: BTreeMap<Fact, String>,
    /// Columns that hold one value throughout: fact → column.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub columns: BTreeMap<Fact, String>,
    /// A regular expression on the absolute path with named groups, e.g.
    /// `(?<tail_number>N\w+)/(?<flight_id>[^/]+)_(?<departure_utc>\d{8}T\d{6}Z)\.parquet$`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub path: Option<String>,
    /// What holds for every log that does not say otherwise: fact → value.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub values: BTreeMap<Fact, String>,
    /// How departures are written, by `strftime` signs; ISO 8601 when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub departure_format: Option<String>,
    /// The zone of departures that do not name one, e.g. `UTC` or `Europe/Istanbul`; without it such
    /// a departure is refused rather than guessed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_zone: Option<String>,
}

/// A fact about a flight that a log may state.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Fact {
    /// The aircraft.
    TailNumber,
    /// The flight; made from the departure when a log does not name it.
    FlightId,
    /// Departure; the first stamp of an absolute clock when a log does not name it.
    DepartureUtc,
    /// The place of the one actuator in this log, when columns do not name it.
    Position,
    /// Length of the flight, hours.
    FlightHours,
    /// The tail's total hours after the flight.
    TailHoursEnd,
}

impl Fact {
    /// Every fact, in the order in which they are looked for.
    pub const ALL: [Self; 6] = [
        Self::TailNumber,
        Self::FlightId,
        Self::DepartureUtc,
        Self::Position,
        Self::FlightHours,
        Self::TailHoursEnd,
    ];

    /// The key as configuration spells it.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::TailNumber => "tail_number",
            Self::FlightId => "flight_id",
            Self::DepartureUtc => "departure_utc",
            Self::Position => "position",
            Self::FlightHours => "flight_hours",
            Self::TailHoursEnd => "tail_hours_end",
        }
    }
}

/// The clock of a log.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ClockMapping {
    /// The time column. Not needed when `rate_hz` is given and rows are evenly spaced.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub column: Option<String>,
    /// Its unit; not needed for Arrow timestamps.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<TimeUnit>,
    /// The rate of the rows, Hz, where it is known better than from the stamps.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rate_hz: Option<f64>,
    /// How far stamps may fall back and still be put in order, s. Default 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_back_s: Option<f64>,
}

/// The channels of an actuator.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Channels {
    /// Only these positions; all that column names tell of when not given.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub positions: Vec<String>,
    /// Motor position: an angle at the motor, or already a length at the screw.
    pub motor_position: ChannelMapping,
    /// Screw position.
    pub screw_position: ChannelMapping,
    /// Load on the screw: a force, or a torque. Positive where it drives δX = screw − motor up.
    pub load: ChannelMapping,
    /// Temperature, where logged.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub temperature: Option<ChannelMapping>,
}

/// One channel: its column and how to read it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ChannelMapping {
    /// The column's name; `{position}` stands for the actuator's place in a log that holds several.
    pub column: String,
    /// m, mm, um, in, deg, rad, rev for positions; N, kN, daN, lbf or N.m, lbf.in, lbf.ft for loads;
    /// degC, degF, K for temperatures.
    pub unit: Unit,
    /// 1, or −1 where the log counts the other way.
    #[serde(default = "one_sign", skip_serializing_if = "is_one_sign")]
    pub sign: i8,
    /// `unit = raw · scale + offset`, for counts.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub scale: f64,
    /// See `scale`.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub offset: f64,
    /// The raw value at which a turning sensor starts again, e.g. 360 in degrees: it is unwrapped.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wraps_at: Option<f64>,
    /// Raw values that mean "no value", e.g. −9999.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub missing: Vec<f64>,
    /// Turns of this sensor to one turn of the screw, where a gear lies between. Default 1.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub gear_ratio: f64,
}

impl Default for ChannelMapping {
    fn default() -> Self {
        Self {
            column: String::new(),
            unit: Unit::Metre,
            sign: 1,
            scale: 1.0,
            offset: 0.0,
            wraps_at: None,
            missing: Vec::new(),
            gear_ratio: 1.0,
        }
    }
}

fn one() -> f64 {
    1.0
}

fn one_sign() -> i8 {
    1
}

#[expect(
    clippy::float_cmp,
    clippy::trivially_copy_pass_by_ref,
    reason = "serde hands over a reference to the default itself"
)]
fn is_one(value: &f64) -> bool {
    *value == 1.0
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde hands over a reference")]
fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde hands over a reference")]
fn is_one_sign(sign: &i8) -> bool {
    *sign == 1
}
