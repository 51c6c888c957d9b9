//! Quantity row: one followed quantity of one unit at a date; and what changed, with whose it is.

use jiff::Timestamp;
use serde::Serialize;
use strum::{EnumString, IntoStaticStr, VariantArray};

use crate::row;

/// A followed quantity, named like its column of the records; its unit ends the name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
#[derive(IntoStaticStr, EnumString, VariantArray)]
#[strum(serialize_all = "snake_case")]
#[expect(missing_docs, reason = "each is documented in the records table under its name")]
pub enum Quantity {
    GapM,
    LostMotionM,
    StiffnessNPerM,
    FrictionN,
    FrictionDryN,
    FrictionLoadShare,
    SkewS,
    LoadZeroN,
    LoadDelayS,
    Nis,
}

impl Quantity {
    /// Name of the column.
    pub fn as_str(self) -> &'static str {
        self.into()
    }

    /// Name for readers.
    pub fn label(self) -> &'static str {
        self.displayed().0
    }

    /// Unit in which readers see it, and the factor to that unit.
    pub fn display_unit(self) -> (&'static str, f64) {
        let (_, unit, factor) = self.displayed();
        (unit, factor)
    }

    fn displayed(self) -> (&'static str, &'static str, f64) {
        match self {
            Self::GapM => ("gap", "µm", 1e6),
            Self::LostMotionM => ("lost motion", "µm", 1e6),
            Self::StiffnessNPerM => ("stiffness", "N/µm", 1e-6),
            Self::FrictionN => ("friction", "N", 1.0),
            Self::FrictionDryN => ("dry friction", "N", 1.0),
            Self::FrictionLoadShare => ("load-dependent friction", "%", 100.0),
            Self::SkewS => ("channel delay", "ms", 1e3),
            Self::LoadZeroN => ("load zero", "N", 1.0),
            Self::LoadDelayS => ("load delay", "ms", 1e3),
            Self::Nis => ("mean NIS", "", 1.0),
        }
    }
}

/// A number with three significant digits.
pub fn significant(value: f64) -> String {
    let magnitude = if value == 0.0 { 0 } else { value.abs().log10().floor() as i32 };
    format!("{value:.*}", (2 - magnitude).clamp(0, 4) as usize)
}

/// Whose a change is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, IntoStaticStr)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum ChangeScope {
    /// One unit alone: the actuator, or its own sensors.
    Unit,
    /// All units of a tail at once: sensor, recorder or wiring.
    Tail,
    /// All units of a part number at once: settings, software or season.
    Part,
}

impl ChangeScope {
    /// Its word in columns.
    pub fn as_str(self) -> &'static str {
        self.into()
    }

    /// State of a tail or a part that changed; a unit has one by quantity.
    pub fn state(self) -> Option<&'static str> {
        match self {
            Self::Unit => None,
            Self::Tail => Some("recorder_moved"),
            Self::Part => Some("settings_moved"),
        }
    }

    /// Likely cause.
    pub fn cause(self) -> &'static str {
        match self {
            Self::Unit => "the actuator",
            Self::Tail => "sensor, recorder or wiring of the tail",
            Self::Part => "settings or software, or the season",
        }
    }
}

row! {
    /// A step of a followed quantity.
    #[derive(Debug, Clone, PartialEq, Serialize)]
    pub struct QuantityStep {
        /// Departure of the first flight after the step.
        pub departure_utc: Timestamp,
        /// That flight.
        pub flight_id: Option<String>,
        /// Size, in the unit of the quantity.
        pub size: f64,
        /// Standard error of the size.
        pub size_se: f64,
        /// `unit`, `tail` or `part`: whose step it is.
        pub scope: &'static str,
    }
}

row! {
    /// One followed quantity of one unit at a date; all numbers in the unit that ends the quantity's name.
    #[derive(Debug, Clone, Default, PartialEq, Serialize)]
    pub struct QuantityRow {
        /// Part number of the unit.
        pub part_number: Option<String>,
        /// Serial number of the unit.
        pub serial_number: String,
        /// Tail and position of the unit's last flight.
        pub tail_number: Option<String>,
        pub position: Option<String>,
        /// Date of the assessment; later data are ignored.
        pub as_of_utc: Timestamp,
        /// Column of the records that is followed: `stiffness_n_per_m`, `friction_n`, …
        pub quantity: &'static str,
        /// Flights used, since the last recorded maintenance and for three years at most.
        pub flights: i64,
        /// Flights excluded as outliers.
        pub outliers: i64,
        /// Departure of the first flight used.
        pub since_utc: Option<Timestamp>,
        /// Value at the first flight, at the part's usual temperature and load.
        pub baseline: Option<f64>,
        /// Level now, without what the units of the part share.
        pub level: Option<f64>,
        /// Standard error of `level`.
        pub level_se: Option<f64>,
        /// `level` less `baseline`, without the steps of tail or part; zero where no change is significant.
        pub change: Option<f64>,
        /// Standard error of `change`.
        pub change_se: Option<f64>,
        /// Rate of change without the steps, per flight hour; null for delays.
        pub rate_per_hour: Option<f64>,
        /// Standard error of `rate_per_hour`.
        pub rate_se_per_hour: Option<f64>,
        /// Change from which there is a state.
        pub change_limit: Option<f64>,
        /// Steps: `departure_utc`, `flight_id`, `size`, `size_se`, `scope`.
        pub steps: Vec<QuantityStep>,
        /// `softening`, `stiffening`, `friction_rising`, `friction_falling`, `lost_motion_rising`, `delay_moved`,
        /// `load_zero_moved`, `load_delay_moved`, `innovations_moved`, or null.
        pub state: Option<&'static str>,
        /// Reason of the state, in words.
        pub reason: Option<String>,
    }
}

row! {
    /// A change of a followed quantity, with whose it is and the evidence.
    #[derive(Debug, Clone, Default, PartialEq, Serialize)]
    pub struct QuantityChange {
        /// Column of the records that changed.
        pub quantity: &'static str,
        /// `unit`, `tail` or `part`: whose change it is.
        pub scope: &'static str,
        /// `step` or `drift`.
        pub kind: &'static str,
        /// The part; null for a change of a tail.
        pub part_number: Option<String>,
        /// The tail; null for a change of a part.
        pub tail_number: Option<String>,
        /// The unit; null for a change of a tail or part.
        pub serial_number: Option<String>,
        /// Positions that changed.
        pub positions: Vec<String>,
        /// Units that changed.
        pub units: i64,
        /// Units with flights enough to show it.
        pub units_able: i64,
        /// First flight of the new level; for a drift, that at half of its size.
        pub since_utc: Timestamp,
        /// Value before and after; of several units, the median.
        pub from: f64,
        pub to: f64,
        /// Standard error of the change; of several units, that of the first.
        pub change_se: f64,
        /// State that follows: `recorder_moved` for a tail, `settings_moved` for a part, for a unit as in the
        /// quantities table.
        pub state: Option<&'static str>,
        /// What changed, by how much, and why it is attributed to this scope, in words.
        pub evidence: String,
    }
}
