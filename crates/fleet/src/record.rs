//! The record: what one actuator's flight says about its gap, and how that came to be said.

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use crate::flight::Flight;
use crate::ids::{PartNumber, Position, SerialNumber};

/// Whether the flight could show a gap.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// `gap_m` holds a number.
    Estimated,
    /// A sound log that cannot show a gap; `reason` says why.
    Refused,
}

impl Status {
    /// The word stored in the `status` column.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Estimated => "estimated",
            Self::Refused => "refused",
        }
    }
}

/// What is needed to make the number again, bit for bit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Provenance {
    /// The log as it was found; relative to the configuration file where it lies below it.
    pub log_path: String,
    /// blake3 of the footer and of the column chunks that were read, hexadecimal.
    pub log_digest: String,
    /// blake3 of every setting that can change this number, hexadecimal.
    pub config_digest: String,
    /// The version of Freeplay that made it.
    pub program_version: String,
    /// The run that made it.
    pub run_id: String,
    /// When it was made.
    pub processed_utc: Timestamp,
}

/// What one actuator's channels in one flight say: the gap, or why there is none, and what it stands on.
///
/// It needs no identity: the same numbers come out of a log nobody has booked.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// Whether `gap_m` holds a number.
    pub status: Status,
    /// Stable code: why the flight was refused, or the gravest doubt about its number.
    pub reason: Option<String>,
    /// Stable codes of doubts that do not forbid the number.
    pub flags: Vec<String>,
    /// ΔS by the configured method, m.
    pub gap_m: Option<f64>,
    /// Its standard error, m.
    pub gap_se_m: Option<f64>,
    /// Its 5 % bound, m.
    pub gap_p05_m: Option<f64>,
    /// Its 95 % bound, m.
    pub gap_p95_m: Option<f64>,
    /// ΔS exactly as equations 29–31 have it, m.
    pub gap_midrange_m: Option<f64>,
    /// Stiffness fitted in this flight, N/m.
    pub stiffness_n_per_m: Option<f64>,
    /// Its standard error, N/m.
    pub stiffness_se_n_per_m: Option<f64>,
    /// Delay of the screw channel against the motor's found and allowed for, s.
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
    /// For a purely rotary part: metres of gap to a radian, m/rad.
    pub reference_radius_m: Option<f64>,
    /// How often the load changed sides.
    pub load_reversals: i64,
    /// Samples the number stands on.
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
    /// Mean normalised innovation squared; a diagnostic to hold against the unit's own history.
    pub nis: Option<f64>,
}

impl Estimate {
    /// A sound log that cannot show a gap, and why.
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
    /// Which tail, which flight, when, how long.
    #[serde(flatten)]
    pub flight: Flight,
    /// The place on the aircraft.
    pub position: Position,
    /// The design of the unit that sat there.
    pub part_number: PartNumber,
    /// The unit that sat there.
    pub serial_number: SerialNumber,
    /// The unit's own age after this flight, hours, where it is known.
    pub unit_hours: Option<f64>,
    /// What its channels say.
    #[serde(flatten)]
    pub estimate: Estimate,
    /// Where the number comes from.
    #[serde(flatten)]
    pub provenance: Provenance,
}

impl GapRecord {
    /// The order in which records are shown and exported: by departure, then tail, flight and position.
    ///
    /// It depends on nothing but the flights themselves, so one worker or many give the same table.
    pub fn canonical_key(&self) -> impl Ord + use<> {
        let f = &self.flight;
        (f.departure_utc, f.tail_number.clone(), f.flight_id.clone(), self.position.clone())
    }
}
