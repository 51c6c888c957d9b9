//! Trend row: the assessment of one unit at a date.

use jiff::Timestamp;
use serde::Serialize;

use crate::row;
use crate::row_schema::NoColumn;

row! {
    /// A change point of a unit.
    #[derive(Debug, Clone, Default, PartialEq, Serialize)]
    pub struct ChangePoint {
        /// Departure of the first flight after the change.
        pub departure_utc: Timestamp,
        /// That flight.
        pub flight_id: Option<String>,
        /// `step`, `reset`, `onset`, `recorded`, `exceedance` or `exceedance_not_confirmed`.
        pub kind: &'static str,
        /// Size, m.
        pub step_m: f64,
        /// Standard error of the size, m.
        pub step_se_m: f64,
        /// Probability that a step has its sign or that wear began; 1 for a recorded event.
        pub certainty: f64,
        /// Whether the tail's other actuators stepped too, or the fitted values of all of them did: the cause is a
        /// sensor or a recorder.
        pub tail_wide: bool,
    }
}

row! {
    /// Assessment of one unit at a date.
    #[derive(Debug, Clone, Default, PartialEq, Serialize)]
    pub struct TrendRow {
        /// Part number of the unit.
        pub part_number: Option<String>,
        /// Serial number of the unit.
        pub serial_number: String,
        /// Tail and position by the installations table, else of the last flight.
        pub tail_number: Option<String>,
        pub position: Option<String>,
        /// Date of the assessment; later data are ignored.
        pub as_of_utc: Timestamp,
        /// Flights.
        pub flights: i64,
        /// The unit's hours.
        pub unit_hours: Option<f64>,
        /// Level of the gap at the last record of the installation, m.
        pub gap_m: Option<f64>,
        /// Standard error of `gap_m`, m.
        pub gap_se_m: Option<f64>,
        /// Records that `gap_m` rests on.
        pub gap_records: Option<i64>,
        /// Departure of the latest record.
        pub latest_utc: Option<Timestamp>,
        /// Gap of the latest record, m.
        pub latest_gap_m: Option<f64>,
        /// Standard error of `latest_gap_m`, m.
        pub latest_gap_se_m: Option<f64>,
        /// Spread of the bias that an installation adds to its gaps, m; not part of `gap_se_m`.
        pub installation_sd_m: Option<f64>,
        /// Flights with a gap.
        pub estimates: i64,
        /// Gaps excluded as outliers.
        pub outliers: i64,
        /// Variance found between flights divided by the stated variance.
        pub noise_factor: f64,
        /// Growth rate, m per flight hour.
        pub rate_m_per_hour: Option<f64>,
        /// 5 % and 95 % bound of the growth rate, m per flight hour.
        pub rate_p05_m_per_hour: Option<f64>,
        pub rate_p95_m_per_hour: Option<f64>,
        /// `wearing`, `steady` or `unknown`, by `growth_probability`.
        pub trend: &'static str,
        /// Probability of growth of 2 % of the limit or more.
        pub growth_probability: Option<f64>,
        /// Most probable wear law: `none`, `onset`, `slowing`, `linear`, `accelerating`.
        pub wear_law: Option<String>,
        /// Probability of `wear_law`.
        pub wear_law_probability: Option<f64>,
        /// What the forecast counts wear in: `flight_hours`, `flights` or `load_reversals`.
        pub usage_axis: Option<String>,
        /// Always null; kept for scripts that select it.
        pub trend_p_value: Option<f64>,
        /// Change points: `departure_utc`, `flight_id`, `kind`, `step_m`, `step_se_m`, `certainty`, `tail_wide`.
        pub change_points: Vec<ChangePoint>,
        /// Act limit, m.
        pub limit_m: Option<f64>,
        /// Flight hours to `limit_m`: earliest (5 %), median, latest (95 %). Null beyond the horizon, 0 at or above
        /// the limit.
        pub crossing_hours_p05: Option<f64>,
        pub crossing_hours_p50: Option<f64>,
        pub crossing_hours_p95: Option<f64>,
        /// Flights to `limit_m`: earliest (5 %), median, latest (95 %).
        pub crossing_flights_p05: Option<f64>,
        pub crossing_flights_p50: Option<f64>,
        pub crossing_flights_p95: Option<f64>,
        /// Date on which `limit_m` is reached: earliest (5 %), median, latest (95 %). It may have passed.
        pub not_before_utc: Option<Timestamp>,
        pub likely_utc: Option<Timestamp>,
        pub not_after_utc: Option<Timestamp>,
        /// Source of the crossing: `measured` (at the limit), `fleet` or `single_unit` (wear laws with or without the
        /// fleet prior), `line` (the last records).
        pub forecast_method: Option<&'static str>,
        /// Probability of reaching the limit within `next_check_hours`.
        pub check_probability: Option<f64>,
        /// Probability that the gap is at or above `limit_m` on `as_of_utc`.
        pub over_limit_probability: Option<f64>,
        /// Flight hours per day at present.
        pub hours_per_day: Option<f64>,
        /// Standard error of `hours_per_day`.
        pub hours_per_day_se: Option<f64>,
        /// Flights per day at present.
        pub flights_per_day: Option<f64>,
        /// Flight hours per flight at present.
        pub hours_per_flight: Option<f64>,
        /// Source of the hours: `flights_table`, `tail_hours` or `logged_flights`.
        pub usage_source: Option<String>,
        /// Days since the last sound record, when more than `stale_after_days`.
        pub stale_days: Option<f64>,
        /// Date of the removal, if the unit is installed nowhere on `as_of_utc`.
        pub removed_utc: Option<Timestamp>,
        /// `normal`, `watch`, `unassessed`, `plan`, `act`, from least to most urgent; null for a removed unit.
        pub state: Option<&'static str>,
        /// Code of the reason: `no_record`, `no_limit`, `stale`, `renewed`, `above_limit`, `limit_held`, `unconfirmed`,
        /// `repeated`, `crosses_soon`, `rises_to_limit`, `at_watch`, `imprecise`, `jumped`, `changed`, `onset`,
        /// `inspected`, `clear`.
        pub reason_code: Option<&'static str>,
        /// Reason of the state, in words.
        pub reason: Option<String>,
        /// States of the unit's other followed quantities.
        pub conditions: Vec<String>,
        /// `replace`, `inspect`, `check_logs`, `set_limit` or null.
        pub action: Option<&'static str>,
        /// Date by which the action is due; null where it is not known.
        pub due_utc: Option<Timestamp>,
        /// Gap that the row is about: `mean` or `largest` (the part's `limit_applies_to`); null without a limit.
        pub limit_applies_to: Option<&'static str>,
        /// Flight hours since the last flight, at the unit's own rate.
        #[serde(skip)]
        pub elapsed_hours: NoColumn<f64>,
        /// What limits the trust in the state, part of `reason`: other settings, flags, age, rows that cannot be right.
        #[serde(skip)]
        pub caveats: NoColumn<Vec<String>>,
        /// The estimated gaps in order of flights, at most a hundred means of neighbours, m: for a sparkline.
        #[serde(skip)]
        pub sketch_m: NoColumn<Vec<f64>>,
    }
}

impl TrendRow {
    /// Whether the limit applies to the largest gap along the stroke.
    pub fn is_by_largest(&self) -> bool {
        self.limit_applies_to == Some("largest")
    }
}
