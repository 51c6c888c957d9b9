//! Gap record: the estimated gap of one actuator in one flight, and its provenance.

use arrow::datatypes::SchemaRef;
use jiff::Timestamp;
use serde::{Deserialize, Deserializer, Serialize};
use strum::{EnumString, IntoStaticStr};

use crate::ids::{FlightId, PartNumber, Position, SerialNumber, TailNumber};
use crate::row_schema::{self, Cells as _, word_cell};
use crate::stored_row;

stored_row! {
    /// Identity of a flight, and its hours if known.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    pub struct Flight {
        /// The aircraft.
        pub tail_number: TailNumber,
        /// The operator's flight identifier, unique within the tail.
        pub flight_id: FlightId,
        /// Departure.
        pub departure_utc: Timestamp,
        /// Length of the flight, hours.
        pub flight_hours: Option<f64>,
        /// The tail's total hours after the flight.
        pub tail_hours_end: Option<f64>,
    }
}

/// Whether the flight allows an estimate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, IntoStaticStr, EnumString)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum Status {
    /// `gap_m` holds a number.
    Estimated,
    /// The log is readable, but allows no estimate; `reason` holds the rejection code.
    #[default]
    Refused,
    /// `freeplay store forget` took the record out: no command of Freeplay reads it, and it can be brought back.
    Withdrawn,
}

word_cell!(Status);

stored_row! {
    /// Everything needed to reproduce the estimate bitwise.
    #[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
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
        /// Time of computation.
        pub processed_utc: Timestamp,
    }
}

stored_row! {
    /// Estimate of one actuator in one flight: the gap or the rejection reason, with its diagnostics.
    ///
    /// It holds no identity: an unidentified log gives the same numbers.
    #[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
    pub struct GapEstimate {
        /// `estimated`, `refused` or, after `store forget`, `withdrawn`.
        pub status: Status,
        /// Code of the rejection, or of the most severe flag.
        pub reason: Option<String>,
        /// Codes of the quality flags, which do not reject the estimate.
        pub flags: Vec<String>,
        /// ΔS by the configured method, m.
        pub gap_m: Option<f64>,
        /// Standard error of `gap_m`, m; null for the mid-range estimate.
        pub gap_se_m: Option<f64>,
        /// 5 % and 95 % bound of `gap_m`, m; null for the mid-range estimate.
        pub gap_p05_m: Option<f64>,
        pub gap_p95_m: Option<f64>,
        /// ΔS by equations 29–31, m; also present for rejected flights.
        pub gap_midrange_m: Option<f64>,
        /// Stiffness fitted in this flight, N/m.
        pub stiffness_n_per_m: Option<f64>,
        /// Standard error of `stiffness_n_per_m`, N/m.
        pub stiffness_se_n_per_m: Option<f64>,
        /// Delay of the screw channel relative to the motor channel, fitted in this flight, s.
        pub skew_s: Option<f64>,
        /// Width of the loop of relative position against load at zero load, m.
        pub loop_width_m: Option<f64>,
        /// Lost motion between plus and minus the part's reference load, m.
        pub lost_motion_m: Option<f64>,
        /// Metres of gap per radian of a rotary part, m/rad.
        pub reference_radius_m: Option<f64>,
        /// Load reversals.
        pub load_reversals: i64,
        /// Samples used.
        pub samples: i64,
        /// Samples in the upper and lower set of equations 30 and 31.
        pub samples_upper: i64,
        pub samples_lower: i64,
        /// 5 % and 95 % quantile of the load, N.
        pub load_p05_n: Option<f64>,
        pub load_p95_n: Option<f64>,
        /// Mean temperature, °C.
        pub temperature_c: Option<f64>,
        /// Mean normalised innovation squared.
        pub nis: Option<f64>,
        /// Standard error of `skew_s`, s.
        pub skew_se_s: Option<f64>,
        /// Standard error of `loop_width_m`, m.
        pub loop_width_se_m: Option<f64>,
        /// Standard error of `lost_motion_m`, m.
        pub lost_motion_se_m: Option<f64>,
        /// Reading of the load channel under no load, fitted in this flight, N.
        pub load_zero_n: Option<f64>,
        /// Standard error of `load_zero_n`, N.
        pub load_zero_se_n: Option<f64>,
        /// Delay of the load channel, lag included, relative to the motor channel, fitted in this flight, s.
        pub load_delay_s: Option<f64>,
        /// Standard error of `load_delay_s`, s.
        pub load_delay_se_s: Option<f64>,
        /// Friction of the screw in motion at the 95 % load, N.
        pub friction_n: Option<f64>,
        /// `gap_midrange_m` with the fitted stiffness, load zero and delays, m: a check of `gap_m`.
        pub gap_midrange_fitted_m: Option<f64>,
        /// Standard error of `friction_n`, N.
        pub friction_se_n: Option<f64>,
        /// Dry friction of the screw fitted in this flight, N: the part that does not depend on the load.
        pub friction_dry_n: Option<f64>,
        /// Standard error of `friction_dry_n`, N.
        pub friction_dry_se_n: Option<f64>,
        /// Share of the load that friction takes, fitted in this flight.
        pub friction_load_share: Option<f64>,
        /// Standard error of `friction_load_share`.
        pub friction_load_share_se: Option<f64>,
        /// Standard error of `nis`.
        pub nis_se: Option<f64>,
        /// Largest gap along the stroke, where the gap varies, m.
        pub gap_largest_m: Option<f64>,
        /// Standard error of `gap_largest_m`, m.
        pub gap_largest_se_m: Option<f64>,
        /// Screw position of `gap_largest_m`, m.
        pub gap_largest_at_m: Option<f64>,
        /// Force with which both flanks of a preloaded nut press under no load, N.
        pub preload_n: Option<f64>,
        /// Standard error of `preload_n`, N.
        pub preload_se_n: Option<f64>,
        /// Screw positions of the gap profile, where the gap varies, m.
        #[serde(deserialize_with = "numbers")]
        pub gap_profile_at_m: Vec<f64>,
        /// Gap at each of `gap_profile_at_m`, m.
        #[serde(deserialize_with = "numbers")]
        pub gap_profile_m: Vec<f64>,
        /// Standard error of `gap_profile_m`, m.
        #[serde(deserialize_with = "numbers")]
        pub gap_profile_se_m: Vec<f64>,
    }
}

/// Reads numbers of JSON, which has `null` for one that is not finite.
fn numbers<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<f64>, D::Error> {
    let numbers = Vec::<Option<f64>>::deserialize(from)?;
    Ok(numbers.into_iter().map(|number| number.unwrap_or(f64::NAN)).collect())
}

impl GapEstimate {
    /// The estimate of a rejected flight, with its rejection code.
    pub fn refused(reason: &str) -> Self {
        Self { reason: Some(reason.to_owned()), ..Self::default() }
    }
}

stored_row! {
    /// One row of the results: one actuator, one flight.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    pub struct GapRecord {
        /// Tail, flight, departure and duration.
        #[serde(flatten)]
        pub flight: Flight,
        /// Position on the aircraft.
        pub position: Position,
        /// Part number of the unit.
        pub part_number: PartNumber,
        /// Serial number of the unit.
        pub serial_number: SerialNumber,
        /// The unit's hours after this flight.
        pub unit_hours: Option<f64>,
        /// The estimate.
        #[serde(flatten)]
        pub estimate: GapEstimate,
        /// Provenance of the estimate.
        #[serde(flatten)]
        pub provenance: Provenance,
    }
    order = column_order
}

impl GapRecord {
    /// Schema of the records table.
    pub fn schema() -> SchemaRef {
        row_schema::schema::<Self>()
    }
}

/// Order of the columns of a record: identity, estimate, provenance, and then the columns of later releases, so that a
/// new column leaves the order of the others as it is. New fields of [`GapEstimate`] are declared last.
fn column_order(column: &str) -> usize {
    const IDENTITY: [&str; 4] = ["tail_number", "position", "part_number", "serial_number"];
    const LAST_OF_FIRST_RELEASE: &str = "nis";
    let (provenance, estimate) = (Provenance::columns("", ""), GapEstimate::columns("", ""));
    let mut later = estimate.iter().skip_while(|c| c.name != LAST_OF_FIRST_RELEASE).skip(1);
    match IDENTITY.iter().position(|name| *name == column) {
        Some(place) => place,
        None if provenance.iter().any(|c| c.name == column) => IDENTITY.len() + 1,
        None if later.any(|c| c.name == column) => IDENTITY.len() + 2,
        None => IDENTITY.len(),
    }
}

/// Key of a record: one actuator has one record per departure of its aircraft. The flight id is no part of it: tables
/// correct it, and two recorders may write it differently.
///
/// Its order is the order in which records are shown and exported.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct RecordKey {
    /// Departure, µs since 1970 UTC.
    pub departure_us: i64,
    /// The aircraft.
    pub tail_number: String,
    /// Position on the aircraft.
    pub position: String,
}

impl RecordKey {
    /// The key columns, in the order of the fields.
    pub const COLUMNS: [&'static str; 3] = ["departure_utc", "tail_number", "position"];

    /// The key of a record.
    pub fn of(record: &GapRecord) -> Self {
        Self {
            departure_us: record.flight.departure_utc.as_microsecond(),
            tail_number: record.flight.tail_number.to_string(),
            position: record.position.to_string(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The results of a distributed run are JSON: one number must not make a log's whole result unreadable.
    #[test]
    fn a_profile_with_a_number_that_is_not_finite_is_read_back_from_json() {
        let estimate = GapEstimate { gap_profile_m: vec![1e-6, f64::NAN], ..GapEstimate::default() };
        let text = serde_json::to_string(&estimate).unwrap();
        let read: GapEstimate = serde_json::from_str(&text).unwrap();
        assert_eq!(
            read.gap_profile_m.iter().map(|m| m.is_nan()).collect::<Vec<_>>(),
            [false, true],
            "{text}"
        );
    }
}
