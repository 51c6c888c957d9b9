//! What a log must offer, and where in it: the mapping that `pipeline.toml` writes down.

use std::collections::BTreeMap;

use jiff::civil::Date;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_with::skip_serializing_none;
use smart_default::SmartDefault;
use strum::{IntoStaticStr, VariantArray};

use crate::mapping::units::{TimeUnit, Unit};
use crate::mapping::{RawValue, SampleFilter};

/// Everything needed to read one log.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Mapping {
    /// Which flight a log is.
    pub identity: IdentityMapping,
    /// Its clock.
    pub clock: ClockMapping,
    /// Its channels.
    pub channels: Channels,
    /// How its rows are laid out.
    #[serde(default, skip_serializing_if = "is_default")]
    pub layout: Layout,
    /// Files of other kinds that belong to the same flight, by the name that channels call them.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub groups: BTreeMap<String, GroupMapping>,
}

impl Mapping {
    /// Clock, layout and identity of the files of a group, or of the main logs.
    #[must_use]
    pub fn of_group(&self, group: Option<&str>) -> Self {
        let group = group.and_then(|name| self.groups.get(name));
        Self {
            clock: group.and_then(|group| group.clock.as_ref()).unwrap_or(&self.clock).clone(),
            layout: group.map_or(&self.layout, |group| &group.layout).clone(),
            identity: group.and_then(|group| group.identity.as_ref()).unwrap_or(&self.identity).clone(),
            ..Self::default()
        }
    }
}

/// How the rows of a log are laid out; by default a row holds one sample of every channel.
#[skip_serializing_none]
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Layout {
    /// The column that names the channel of each row; `column` of a channel is then such a name.
    pub name_column: Option<String>,
    /// The column with the value of each row.
    pub value_column: Option<String>,
    /// The column that names the position of each row.
    pub position_column: Option<String>,
}

/// Another kind of file. Identity that it does not hold is shared with the main logs.
#[skip_serializing_none]
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GroupMapping {
    /// Patterns of its files, from the folder of the configuration.
    pub files: Vec<String>,
    /// Its clock. Default: that of the main logs.
    pub clock: Option<ClockMapping>,
    /// Its layout. Default: wide.
    #[serde(default, skip_serializing_if = "is_default")]
    pub layout: Layout,
    /// Identity of its flight. Default: as for the main logs.
    pub identity: Option<IdentityMapping>,
}

/// Where tail, flight and departure stand: in the file's metadata, in constant columns, in its path, in
/// the names of its folders, or in the configuration itself. For each fact the first source that has it
/// wins, in that order; the flights table fills what is still open.
#[serde_with::apply(_ => #[serde(skip_serializing_if = "is_default")])]
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct IdentityMapping {
    /// Key-value metadata of the Parquet footer: field → key, or `key.name` where the value is JSON. Fields: `tail_number`,
    /// `flight_id`, `departure_utc`, `position`, `flight_hours`, `tail_hours_end`, `landing_utc`.
    pub metadata: BTreeMap<IdentityField, String>,
    /// Columns with one value throughout the log: field → column.
    pub columns: BTreeMap<IdentityField, String>,
    /// Whether each row names its flight, so that a file may hold many. A row that names none is ignored.
    pub by_row: bool,
    /// A regular expression on the absolute path, with fields as named groups.
    pub path: Option<String>,
    /// Folders called `name=value`: field → name.
    pub folders: BTreeMap<IdentityField, String>,
    /// Values for logs that do not hold them: field → value.
    pub values: BTreeMap<IdentityField, String>,
    /// Registrations of aircraft that loggers call otherwise; the first match counts.
    pub tail_aliases: Vec<TailAlias>,
    /// `strftime` pattern of departures. Default: ISO 8601.
    pub departure_format: Option<String>,
    /// Time zone of departures that name none, e.g. `UTC`; without it, such a departure is refused.
    pub time_zone: Option<String>,
}

/// `[[identity.tail_aliases]]`: the registration of an aircraft that a logger calls otherwise.
#[skip_serializing_none]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TailAlias {
    /// What the logs call the aircraft.
    pub logged: String,
    /// Its registration.
    pub tail_number: String,
    /// First departure day, UTC, of this name, e.g. `"2026-03-01"`.
    #[schemars(with = "Option<String>")]
    pub from: Option<Date>,
    /// Last departure day, UTC, of this name.
    #[schemars(with = "Option<String>")]
    pub until: Option<Date>,
}

impl TailAlias {
    /// Whether this is the aircraft of a log; without a day of departure only where every day is.
    pub(crate) fn is_of(&self, logged: &str, day: Option<Date>) -> bool {
        let holds = |day| self.from.is_none_or(|from| from <= day) && self.until.is_none_or(|end| day <= end);
        self.logged == logged && day.map_or(self.from.is_none() && self.until.is_none(), holds)
    }
}

/// A fact about a flight that a log may state.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, IntoStaticStr, VariantArray)]
#[strum(serialize_all = "snake_case")]
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum IdentityField {
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
    /// Landing, where the departure is not named: the departure lies the length of the flight before it.
    LandingUtc,
}

impl IdentityField {
    /// All fields, in the order in which they are read.
    pub const ALL: &'static [Self] = Self::VARIANTS;

    /// The key as configuration spells it.
    pub fn as_str(self) -> &'static str {
        self.into()
    }
}

/// The clock of a log.
#[serde_with::apply(_ => #[serde(skip_serializing_if = "is_default")])]
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ClockMapping {
    /// The time column; not needed for evenly spaced rows with `rate_hz`.
    pub column: Option<String>,
    /// Unit of the column; `count` is a counter of samples. Not needed for Arrow timestamps and text.
    pub unit: Option<TimeUnit>,
    /// Origin of a column of numbers: unknown, 1970 UTC, midnight of the day of departure, or 1899-12-30 local time. With
    /// `midnight`, texts may be times of the day.
    pub epoch: Epoch,
    /// The raw value at which a counter starts again at zero.
    pub wraps_at: Option<f64>,
    /// The rate of the rows, Hz, where timestamps are inexact.
    pub rate_hz: Option<f64>,
    /// Resolution of the clock, s: rows that share a timestamp are spread evenly.
    pub tick_s: Option<f64>,
    /// How far timestamps may fall back and still be sorted, s. Default 1; without limit where a third of them falls and
    /// none is repeated.
    pub max_back_s: Option<f64>,
    /// The longest pause of one flight, s; a log with a longer one is refused. Default 3600.
    pub max_gap_s: Option<f64>,
    /// Whether a log whose clock falls back further holds several recordings.
    pub split_at_jumps: bool,
}

/// What a clock of plain numbers counts from.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Epoch {
    /// From an unknown zero.
    #[default]
    None,
    /// From 1970-01-01T00:00:00Z.
    Unix,
    /// From midnight: the clock starts again after a day.
    Midnight,
    /// From 1899-12-30T00:00:00 in local time, mostly in days.
    Excel,
}

/// The channels of an actuator.
#[skip_serializing_none]
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Channels {
    /// Only these positions. Default: all that column names contain.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub positions: Vec<String>,
    /// Motor position: an angle at the motor, or already a length at the screw.
    pub motor_position: ChannelMapping,
    /// Screw position.
    pub screw_position: Option<ChannelMapping>,
    /// Screw minus motor, where it is logged instead of the screw's own position.
    pub relative_position: Option<ChannelMapping>,
    /// `moving` (default), or `locked` where the output is fixed and the screw position constant.
    #[serde(default, skip_serializing_if = "is_default")]
    pub output: Output,
    /// Load on the screw: a force, or a torque. Positive where it drives δX = screw − motor up.
    pub load: ChannelMapping,
    /// Temperature, where logged.
    pub temperature: Option<ChannelMapping>,
    /// Conditions on other columns, which samples must meet.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub when: Vec<SampleFilter>,
}

/// Whether an actuator's output can move.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Output {
    /// It moves, and a channel records it.
    #[default]
    Moving,
    /// It is fixed, as on a test bench: the screw position is constant, and no channel is needed for it.
    Locked,
}

impl Output {
    /// Whether it moves.
    pub fn is_moving(&self) -> bool {
        *self == Self::Moving
    }

    /// Whether it is fixed.
    pub fn is_locked(self) -> bool {
        self == Self::Locked
    }
}

/// A channel of an actuator.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, IntoStaticStr)]
#[strum(serialize_all = "snake_case")]
pub enum Role {
    /// Motor position.
    Motor,
    /// Screw position, or screw minus motor.
    Screw,
    /// Load.
    Load,
    /// Temperature.
    Temperature,
}

impl Role {
    /// Every channel, in the order in which they are read.
    pub const ALL: [Self; 4] = [Self::Motor, Self::Screw, Self::Load, Self::Temperature];
    /// The roles that an estimate needs.
    pub const NEEDED: [Self; 3] = [Self::Motor, Self::Screw, Self::Load];

    /// The word in codes: `motor_frozen`.
    pub fn as_str(self) -> &'static str {
        self.into()
    }
}

impl Channels {
    /// The mapping of a channel, if it has one.
    pub(crate) fn of(&self, role: Role) -> Option<&ChannelMapping> {
        match role {
            Role::Motor => Some(&self.motor_position),
            Role::Screw if self.output.is_locked() => None,
            Role::Screw => self.screw_position.as_ref().or(self.relative_position.as_ref()),
            Role::Load => Some(&self.load),
            Role::Temperature => self.temperature.as_ref(),
        }
    }

    /// Whether δX is logged itself.
    pub(crate) fn is_relative(&self) -> bool {
        self.screw_position.is_none() && !self.output.is_locked()
    }
}

/// One channel: its column and how to read it.
#[skip_serializing_none]
#[derive(Debug, Clone, PartialEq, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ChannelMapping {
    /// The column; `{position}` stands for the actuator's position, `record.field` reaches into structs.
    pub column: String,
    /// Unit of the position, load or temperature.
    #[default(Unit::Metre)]
    pub unit: Unit,
    /// 1, or −1 where the log counts the other way.
    #[serde(default = "one::<i8>", skip_serializing_if = "is_one")]
    #[default(one())]
    pub sign: i8,
    /// `unit = raw · scale + offset`, for counts.
    #[serde(default = "one::<f64>", skip_serializing_if = "is_one")]
    #[default(one())]
    pub scale: f64,
    /// See `scale`.
    #[serde(default, skip_serializing_if = "is_default")]
    pub offset: f64,
    /// The raw value at which a turning sensor starts again, e.g. 360 in degrees.
    pub wraps_at: Option<f64>,
    /// Raw values that mean "no value", e.g. −9999.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub missing: Vec<f64>,
    /// Turns of this sensor for one turn of the screw. Default 1.
    #[serde(default = "one::<f64>", skip_serializing_if = "is_one")]
    #[default(one())]
    pub gear_ratio: f64,
    /// A column that marks valid samples; `{position}` as in `column`.
    pub valid_column: Option<String>,
    /// The values of `valid_column` that mean valid. Default `[1]`, which is also *true*.
    #[serde(default = "yes", skip_serializing_if = "is_yes")]
    #[default(yes())]
    pub valid_values: Vec<RawValue>,
    /// Bits of `valid_column` that are all set in a valid sample, e.g. `0x60`.
    pub valid_bits: Option<u64>,
    /// Bits of `valid_column` that are all clear in a valid sample.
    pub invalid_bits: Option<u64>,
    /// Whether scale, offset and unit in the Arrow metadata of the column are ignored.
    #[serde(default, skip_serializing_if = "is_default")]
    pub ignore_metadata: bool,
    /// The `[group.…]` whose files hold this channel. Default: the main logs.
    pub group: Option<String>,
    /// The channel's own time column, in the unit of the clock.
    pub time_column: Option<String>,
    /// The channel's own rate, Hz, where it is slower than its rows.
    pub rate_hz: Option<f64>,
    /// Time from the row's timestamp to the channel's sampling instant, s.
    #[serde(default, skip_serializing_if = "is_default")]
    pub instant_s: f64,
    /// Recording delay of the channel, s: logged(t) = true(t − latency).
    #[serde(default, skip_serializing_if = "is_default")]
    pub latency_s: f64,
    /// Redundant channels, best first, for logs in which this one is not usable.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub alternatives: Vec<ChannelMapping>,
    /// The raw values that a condition asks for, if the column is that of a condition: it is read as it is logged.
    #[serde(skip)]
    pub condition: Option<Vec<RawValue>>,
}

impl ChannelMapping {
    /// This channel and its alternatives, best first.
    pub fn choices(&self) -> impl Iterator<Item = &Self> {
        std::iter::once(self).chain(&self.alternatives)
    }

    /// Bits of the status word that are set and clear in a valid sample, where it has such bits.
    pub(crate) fn status_bits(&self) -> Option<(u64, u64)> {
        self.valid_bits.or(self.invalid_bits)?;
        Some((self.valid_bits.unwrap_or(0), self.invalid_bits.unwrap_or(0)))
    }

    /// How far the samples lie from the stamps of their rows, s.
    pub(crate) fn shift_s(&self) -> f64 {
        self.instant_s - self.latency_s
    }
}

impl From<&SampleFilter> for ChannelMapping {
    /// The column of a condition.
    fn from(filter: &SampleFilter) -> Self {
        Self {
            column: filter.column.clone(),
            group: filter.group.clone(),
            time_column: filter.time_column.clone(),
            rate_hz: filter.rate_hz,
            condition: Some(filter.equals.clone()),
            ..Self::default()
        }
    }
}

fn yes() -> Vec<RawValue> {
    vec![RawValue::Number(1.0)]
}

fn is_yes(values: &[RawValue]) -> bool {
    values == [RawValue::Number(1.0)]
}

fn one<T: From<i8>>() -> T {
    1.into()
}

fn is_one<T: From<i8> + PartialEq>(value: &T) -> bool {
    *value == one()
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}
