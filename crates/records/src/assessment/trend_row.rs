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
        /// Tail of the unit's last flight.
        pub tail_number: Option<String>,
        /// Position of the unit's last flight.
        pub position: Option<String>,
        /// Date of the assessment: the time of the run, unless `--as-of` or `trend.as_of` sets it. Later data are ignored.
        pub as_of_utc: Timestamp,
        /// Flights.
        pub flights: i64,
        /// The unit's hours.
        pub unit_hours: Option<f64>,
        /// Measured level of the gap at the last record of the installation, m.
        pub gap_m: Option<f64>,
        /// Standard error of `gap_m`, from the errors and the scatter of its records, m.
        pub gap_se_m: Option<f64>,
        /// Records that `gap_m` rests on.
        pub gap_records: Option<i64>,
        /// Departure of the latest record.
        pub latest_utc: Option<Timestamp>,
        /// Gap of the latest record, m.
        pub latest_gap_m: Option<f64>,
        /// Standard error of `latest_gap_m`, with the scatter found between flights, m.
        pub latest_gap_se_m: Option<f64>,
        /// Spread of what an installation adds to every gap measured in it, m; no part of `gap_se_m`.
        pub installation_sd_m: Option<f64>,
        /// Flights with a gap.
        pub estimates: i64,
        /// Gaps excluded as outliers.
        pub outliers: i64,
        /// Variance found between flights divided by the stated variance.
        pub noise_factor: f64,
        /// Growth rate, m per flight hour.
        pub rate_m_per_hour: Option<f64>,
        /// 5 % bound of the growth rate, m per flight hour.
        pub rate_p05_m_per_hour: Option<f64>,
        /// 95 % bound of the growth rate, m per flight hour.
        pub rate_p95_m_per_hour: Option<f64>,
        /// `wearing` (growth probability above 95 %), `steady` (below one half), `unknown` (between, or too few
        /// estimates).
        pub trend: &'static str,
        /// Probability of growth of 2 % of the limit or more.
        pub growth_probability: Option<f64>,
        /// Most probable wear law: `none`, `onset`, `slowing`, `linear`, `accelerating`.
        pub wear_law: Option<String>,
        /// Probability of `wear_law`.
        pub wear_law_probability: Option<f64>,
        /// Measure that the wear of the part number follows, as found or configured: `flight_hours`, `flights` or
        /// `load_reversals`.
        pub usage_axis: Option<String>,
        /// Null: the Mann–Kendall test is no longer made. The column stays for scripts that select it.
        pub trend_p_value: Option<f64>,
        /// Change points: `departure_utc`, `flight_id`, `kind`, `step_m`, `step_se_m`, `certainty`, `tail_wide`.
        pub change_points: Vec<ChangePoint>,
        /// Act limit, m.
        pub limit_m: Option<f64>,
        /// Flight hours to `limit_m`, earliest (5 %); null beyond the horizon, 0 at or above the limit.
        pub crossing_hours_p05: Option<f64>,
        /// Flight hours to `limit_m`, median.
        pub crossing_hours_p50: Option<f64>,
        /// Flight hours to `limit_m`, latest (95 %).
        pub crossing_hours_p95: Option<f64>,
        /// Flights to `limit_m`, earliest (5 %), at the unit's utilisation of the last ninety days.
        pub crossing_flights_p05: Option<f64>,
        /// Flights to `limit_m`, median.
        pub crossing_flights_p50: Option<f64>,
        /// Flights to `limit_m`, latest (95 %).
        pub crossing_flights_p95: Option<f64>,
        /// Date on which `limit_m` is reached, earliest (5 %): from the last flight on, at `hours_per_day`. It does not move
        /// with `as_of_utc`, and may have passed.
        pub not_before_utc: Option<Timestamp>,
        /// Date on which `limit_m` is reached, median.
        pub likely_utc: Option<Timestamp>,
        /// Date on which `limit_m` is reached, latest (95 %).
        pub not_after_utc: Option<Timestamp>,
        /// What the crossing follows from: `measured` (at the limit), `fleet` (wear laws by the part's fleet), `single_unit`
        /// (wear laws by the unit alone), `line` (the last records).
        pub forecast_method: Option<&'static str>,
        /// Probability of reaching the limit within `next_check_hours`, from the curves alone.
        pub check_probability: Option<f64>,
        /// Probability that the gap is at or above `limit_m` on `as_of_utc`.
        pub over_limit_probability: Option<f64>,
        /// Flight hours per day in the last ninety days; dates, the report's chart and its removals use it.
        pub hours_per_day: Option<f64>,
        /// Standard error of `hours_per_day`.
        pub hours_per_day_se: Option<f64>,
        /// Flights per day in the last ninety days.
        pub flights_per_day: Option<f64>,
        /// Flight hours per flight in the last ninety days.
        pub hours_per_flight: Option<f64>,
        /// Source of the hours: `flights_table`, `tail_hours` or `logged_flights` (flights without a log are then
        /// missing).
        pub usage_source: Option<String>,
        /// Days since the last sound record, when more than `stale_after_days`.
        pub stale_days: Option<f64>,
        /// Removal date of a unit that is installed nowhere on `as_of_utc`; it has no state and no dates.
        pub removed_utc: Option<Timestamp>,
        /// `normal`, `watch`, `unassessed`, `plan`, `act`, from least to most urgent; null for a removed unit.
        pub state: Option<&'static str>,
        /// Code of the reason: `no_record`, `no_limit`, `stale`, `renewed`, `above_limit`, `limit_held`, `unconfirmed`,
        /// `crosses_soon`, `rises_to_limit`, `at_watch`, `jumped`, `changed`, `onset`, `inspected`,
        /// `clear`.
        pub reason_code: Option<&'static str>,
        /// Reason of the state, in words.
        pub reason: Option<String>,
        /// States of the other followed quantities of the unit: `softening`, `friction_rising`, …; all in the
        /// quantities table.
        pub conditions: Vec<String>,
        /// What the state asks for: `replace` (state `act`, or `inspect` where the part's `at_limit` asks for it), `inspect`
        /// (`plan`, `watch`, or another quantity changed), `check_logs` or `set_limit` (`unassessed`), or null.
        pub action: Option<&'static str>,
        /// Date until when: `as_of_utc` to replace, or to inspect after a jump; `not_before_utc` to inspect; null where it
        /// is not known.
        pub due_utc: Option<Timestamp>,
        /// Gap that `limit_m`, and every gap of this row, is about: `mean` over the stroke, or `largest` along it (the part's
        /// `limit_applies_to`); null without a limit.
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

    /// Part number, if known, and serial number.
    pub fn unit(&self) -> (Option<String>, String) {
        (self.part_number.clone(), self.serial_number.clone())
    }
}
