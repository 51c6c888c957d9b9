//! Gap record: the estimated gap of one actuator in one flight, and its provenance.

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use crate::flight::Flight;
use crate::ids::{PartNumber, Position, SerialNumber};

/// Whether the flight allows an estimate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// `gap_m` holds a number.
    Estimated,
    /// The log is readable, but allows no estimate; `reason` holds the rejection code.
    Refused,
}

impl Status {
    /// Value of the `status` column.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Estimated => "estimated",
            Self::Refused => "refused",
        }
    }
}

/// Everything needed to reproduce the estimate bitwise.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Provenance {
    /// Path of the log; relative to the configuration file if the log is stored below it.
    pub log_path: String,
    /// blake3 of the footer and of the column chunks that were read, hexadecimal.
    pub log_digest: String,
    /// blake3 of every setting that affects the estimate, hexadecimal.
    pub config_digest: String,
    /// Version of Freeplay that computed the estimate.
    pub program_version: String,
    /// The run that computed the estimate.
    pub run_id: String,
    /// Time of computation, UTC.
    pub processed_utc: Timestamp,
}

/// GapEstimate of one actuator in one flight: the gap or the rejection reason, with its diagnostics.
///
/// It holds no identity: an unidentified log gives the same numbers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GapEstimate {
    /// Whether `gap_m` holds a number.
    pub status: Status,
    /// Stable code: the rejection reason, or the most severe quality flag.
    pub reason: Option<String>,
    /// Stable codes of quality flags that do not reject the estimate.
    pub flags: Vec<String>,
    /// ΔS by the configured method, m.
    pub gap_m: Option<f64>,
    /// Its standard error, m.
    pub gap_se_m: Option<f64>,
    /// Its 5 % bound, m.
    pub gap_p05_m: Option<f64>,
    /// Its 95 % bound, m.
    pub gap_p95_m: Option<f64>,
    /// ΔS by equations 29–31, m.
    pub gap_midrange_m: Option<f64>,
    /// Stiffness fitted in this flight, N/m.
    pub stiffness_n_per_m: Option<f64>,
    /// Its standard error, N/m.
    pub stiffness_se_n_per_m: Option<f64>,
    /// Estimated and corrected delay of the screw channel relative to the motor channel, s.
    pub skew_s: Option<f64>,
    /// Its standard error, s.
    pub skew_se_s: Option<f64>,
    /// Lost motion at zero load, m.
    pub loop_width_m: Option<f64>,
    /// Its standard error, m.
    pub loop_width_se_m: Option<f64>,
    /// Relative travel between plus and minus the part's reference load, m.
    pub lost_motion_m: Option<f64>,
    /// Its standard error, m.
    pub lost_motion_se_m: Option<f64>,
    /// Zero of the load channel fitted in this flight, N: what it reads under no load.
    pub load_zero_n: Option<f64>,
    /// Its standard error, N.
    pub load_zero_se_n: Option<f64>,
    /// Estimated and corrected delay of the load channel relative to the motor channel, s.
    pub load_delay_s: Option<f64>,
    /// Its standard error, s.
    pub load_delay_se_s: Option<f64>,
    /// Friction of the screw in motion at the 95 % load, N.
    pub friction_n: Option<f64>,
    /// ΔS by equations 29–31 with the stiffness, load zero and delays fitted in this flight, m: a check of `gap_m`.
    pub gap_midrange_fitted_m: Option<f64>,
    /// Reference radius of a purely rotary part: metres of gap per radian, m/rad.
    pub reference_radius_m: Option<f64>,
    /// Number of load reversals.
    pub load_reversals: i64,
    /// Number of samples used.
    pub samples: i64,
    /// Samples in the upper set of equation 30.
    pub samples_upper: i64,
    /// Samples in the lower set of equation 31.
    pub samples_lower: i64,
    /// 5 % quantile of the load, N.
    pub load_p05_n: Option<f64>,
    /// 95 % quantile of the load, N.
    pub load_p95_n: Option<f64>,
    /// Mean temperature, °C, where a channel is mapped.
    pub temperature_c: Option<f64>,
    /// Mean normalised innovation squared (NIS), to compare with the unit's own history.
    pub nis: Option<f64>,
}

impl GapEstimate {
    /// The estimate of a rejected flight, with its rejection code.
    pub fn refused(reason: &str) -> Self {
        Self {
            status: Status::Refused,
            reason: Some(reason.to_owned()),
            flags: Vec::new(),
            gap_m: None,
            gap_se_m: None,
            gap_p05_m: None,
            gap_p95_m: None,
            gap_midrange_m: None,
            stiffness_n_per_m: None,
            stiffness_se_n_per_m: None,
            skew_s: None,
            skew_se_s: None,
            loop_width_m: None,
            loop_width_se_m: None,
            lost_motion_m: None,
            lost_motion_se_m: None,
            load_zero_n: None,
            load_zero_se_n: None,
            load_delay_s: None,
            load_delay_se_s: None,
            friction_n: None,
            gap_midrange_fitted_m: None,
            reference_radius_m: None,
            load_reversals: 0,
            samples: 0,
            samples_upper: 0,
            samples_lower: 0,
            load_p05_n: None,
            load_p95_n: None,
            temperature_c: None,
            nis: None,
        }
    }
}

/// One row of the results: one actuator, one flight. The flattened field names are the column names.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GapRecord {
    /// Tail, flight, departure and duration.
    #[serde(flatten)]
    pub flight: Flight,
    /// Position on the aircraft.
    pub position: Position,
    /// Part number of the installed unit.
    pub part_number: PartNumber,
    /// The installed unit.
    pub serial_number: SerialNumber,
    /// Age of the unit after this flight, hours, if known.
    pub unit_hours: Option<f64>,
    /// The estimate.
    #[serde(flatten)]
    pub estimate: GapEstimate,
    /// Provenance of the estimate.
    #[serde(flatten)]
    pub provenance: Provenance,
}

/// Key of a record: one actuator has one record per flight.
///
/// Its order is the order in which records are shown and exported.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct RecordKey {
    /// Departure, µs since 1970 UTC.
    pub departure_us: i64,
    /// The aircraft.
    pub tail_number: String,
    /// The flight.
    pub flight_id: String,
    /// Position on the aircraft.
    pub position: String,
}

impl RecordKey {
    /// The key columns, in the order of the fields.
    pub const COLUMNS: [&'static str; 4] = ["departure_utc", "tail_number", "flight_id", "position"];

    /// The key of a record.
    pub fn of(record: &GapRecord) -> Self {
        Self {
            departure_us: record.flight.departure_utc.as_microsecond(),
            tail_number: record.flight.tail_number.to_string(),
            flight_id: record.flight.flight_id.to_string(),
            position: record.position.to_string(),
        }
    }
}
