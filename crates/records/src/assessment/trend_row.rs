//! Trend row: the assessment of one unit at a date.

use jiff::Timestamp;
use serde::Serialize;

use crate::row;
use crate::row_schema::NoColumn;

row! {
    /// A change point of a unit.
    #[derive(Debug, Clone, PartialEq, Serialize)]
    pub struct ChangePoint {
        /// Departure of the first flight after the change.
        pub departure_utc: Timestamp,
        /// That flight.
        pub flight_id: Option<String>,
        /// `step`, `reset`, `onset` or `recorded`.
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
    #[derive(Debug, Clone, PartialEq, Serialize)]
    pub struct TrendRow {
        /// Part number of the unit.
        pub part_number: Option<String>,
        /// Serial number of the unit.
        pub serial_number: String,
        /// Tail of the unit's last flight.
        pub tail_number: Option<String>,
        /// Position of the unit's last flight.
        pub position: Option<String>,
        /// Date of the assessment: the newest departure in the store, unless `--as-of` sets it. Later data are ignored.
        pub as_of_utc: Timestamp,
        /// Flights.
        pub flights: i64,
        /// The unit's hours.
        pub unit_hours: Option<f64>,
        /// Level of the gap, m.
        pub gap_m: Option<f64>,
        /// Standard error of `gap_m`, m.
        pub gap_se_m: Option<f64>,
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
        /// Two-sided p-value of the Mann–Kendall test.
        pub trend_p_value: Option<f64>,
        /// Theil–Sen slope, m per flight hour; null without `--statistics`.
        pub sen_rate_m_per_hour: Option<f64>,
        /// Lower 90 % limit of the Theil–Sen slope, m per flight hour; null without `--statistics`.
        pub sen_low_m_per_hour: Option<f64>,
        /// Upper 90 % limit of the Theil–Sen slope, m per flight hour; null without `--statistics`.
        pub sen_high_m_per_hour: Option<f64>,
        /// p-value of the Mann–Kendall test corrected for autocorrelation (Hamed–Rao); null without `--statistics`.
        pub hamed_rao_p_value: Option<f64>,
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
        /// Date on which `limit_m` is reached, earliest (5 %): from `as_of_utc` on, at `hours_per_day`.
        pub not_before_utc: Option<Timestamp>,
        /// Date on which `limit_m` is reached, median.
        pub likely_utc: Option<Timestamp>,
        /// Date on which `limit_m` is reached, latest (95 %).
        pub not_after_utc: Option<Timestamp>,
        /// Probability of reaching the limit within `next_check_hours`, from the curves alone.
        pub check_probability: Option<f64>,
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
        /// Days since the last estimate, when more than `stale_after_days`; the state is then that of the last
        /// estimate.
        pub stale_days: Option<f64>,
        /// Removal date of a unit that is installed nowhere on `as_of_utc`; it has no state and no dates.
        pub removed_utc: Option<Timestamp>,
        /// `normal`, `watch`, `plan`, `act`, or null (not assessed).
        pub state: Option<&'static str>,
        /// Reason of the state, in words.
        pub reason: Option<String>,
        /// States of the other followed quantities of the unit: `softening`, `friction_rising`, …; all in the
        /// quantities table.
        pub conditions: Vec<String>,
        /// What the state asks for: `replace` (state `act`), `inspect` (`plan`, `watch`, or another quantity changed), or
        /// null.
        pub action: Option<&'static str>,
        /// Date until when: `as_of_utc` to replace, `not_before_utc` to inspect; null where it is not known.
        pub due_utc: Option<Timestamp>,
        /// Probabilities of reaching the limit within intervals of flight hours, from the hours up: for advice on
        /// inspection intervals.
        #[serde(skip)]
        pub interval_chances: NoColumn<Vec<(f64, f64)>>,
        /// The estimated gaps in order of flights, at most a hundred means of neighbours, m: for a sparkline.
        #[serde(skip)]
        pub sketch_m: NoColumn<Vec<f64>>,
    }
}

impl TrendRow {
    /// Part number, if known, and serial number.
    pub fn unit(&self) -> (Option<String>, String) {
        (self.part_number.clone(), self.serial_number.clone())
    }
}

row! {
    /// Inspection interval of a part: the chance that a unit meets its limit before the next inspection.
    #[derive(Debug, Clone, PartialEq, Serialize)]
    pub struct InspectionInterval {
        /// The part.
        pub part_number: Option<String>,
        /// Interval between inspections, flight hours.
        pub interval_hours: f64,
        /// Units of the part in state `normal` or `watch`; those in `plan` and `act` have dates of their own.
        pub units: i64,
        /// Mean chance of a unit.
        pub mean_chance: f64,
        /// Chance of the unit that is likeliest to meet its limit.
        pub largest_chance: f64,
        /// That unit.
        pub serial_number: String,
        /// Accepted chance, from `trend.inspection_risk`.
        pub risk: f64,
        /// Longest interval for which no unit exceeds `risk`, flight hours; null below the shortest listed, and at most
        /// the longest listed.
        pub longest_hours: Option<f64>,
    }
}
