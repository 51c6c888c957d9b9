//! What a report knows: plain values in SI, composed elsewhere.

use jiff::Timestamp;
use serde::Serialize;

use crate::standing::Standing;

/// Everything a report says. Serialised, it is the machine-readable twin of the pages.
#[derive(Debug, Clone, Serialize)]
#[expect(missing_docs, reason = "each field is named for what it holds, with its unit")]
pub struct Report {
    pub made_utc: Timestamp,
    pub program: String,
    pub store_version: Option<u64>,
    /// What the report was narrowed to; nothing for the whole fleet.
    pub scope: Option<String>,
    /// The day of the statements; nothing later was looked at.
    pub as_of_utc: Option<Timestamp>,
    pub newest_departure_utc: Option<Timestamp>,
    pub logs_known: usize,
    /// Hours until the next check, for the probability to meet the limit before it.
    pub check_interval_hours: f64,
    pub log_faults: Vec<LogFault>,
    pub priors: Vec<Prior>,
    pub tails: Vec<Tail>,
    pub units: Vec<Unit>,
    /// Whether a table of inspections was given at all.
    pub inspections_given: bool,
    /// Inspections of units that the records do not know.
    pub inspections_unmatched: usize,
}

/// What a part number's units had taught about the next one.
#[derive(Debug, Clone, Serialize)]
#[expect(missing_docs, reason = "each field is named for what it holds, with its unit")]
pub struct Prior {
    pub part_number: Option<String>,
    /// Nothing later was learned from.
    pub learned_until_utc: Timestamp,
    pub axis: String,
    pub new_m: f64,
    pub new_sd_m: f64,
    pub life_p05_hours: f64,
    pub life_p50_hours: f64,
    pub life_p95_hours: f64,
    /// How much wider forecasts are stated than is usual.
    pub widening: f64,
}

/// A gap and its 90 % interval at a time.
#[derive(Debug, Clone, Copy)]
#[expect(missing_docs, reason = "each field is named for what it holds, with its unit")]
pub struct Banded {
    pub at_utc: Timestamp,
    pub p05_m: f64,
    pub m: f64,
    pub p95_m: f64,
}

/// A log that could not be read.
#[derive(Debug, Clone, Serialize)]
#[expect(missing_docs, reason = "each field is named for what it holds")]
pub struct LogFault {
    pub log_path: String,
    pub tail_number: Option<String>,
    pub code: String,
    pub processed_utc: Timestamp,
}

/// What is known of an aircraft's data.
#[derive(Debug, Clone, Serialize)]
#[expect(missing_docs, reason = "each field is named for what it holds, with its unit")]
pub struct Tail {
    pub tail_number: String,
    pub flights: usize,
    pub records: usize,
    pub refused: usize,
    pub logs_in_error: usize,
    pub last_departure_utc: Option<Timestamp>,
    pub last_estimate_utc: Option<Timestamp>,
}

/// One unit: its statement, and what it stands on.
#[derive(Debug, Clone, Serialize)]
#[expect(missing_docs, reason = "each field is named for what it holds, with its unit")]
pub struct Unit {
    pub part_number: Option<String>,
    pub serial_number: String,
    pub tail_number: Option<String>,
    pub position: Option<String>,
    pub statement: Statement,
    pub quality: Quality,
    pub events: Vec<Event>,
    pub stays: Vec<Stay>,
    pub past: Vec<Past>,
    pub inspections: Vec<Inspection>,
    /// The smoothed level through its flights; drawn, not repeated in the twin.
    #[serde(skip)]
    pub level: Vec<Banded>,
    /// The gap to come, from now on; drawn, not repeated in the twin.
    #[serde(skip)]
    pub forecast: Vec<Banded>,
    /// In the pages and in the store, not repeated in the twin.
    #[serde(skip)]
    pub flights: Vec<FlightRow>,
}

/// What is said of a unit on the day of the report.
#[derive(Debug, Clone, Default, Serialize)]
#[expect(missing_docs, reason = "each field is named for what it holds, with its unit")]
pub struct Statement {
    pub state: Option<String>,
    pub reason: Option<String>,
    pub flights: usize,
    pub unit_hours: Option<f64>,
    pub gap_m: Option<f64>,
    pub gap_se_m: Option<f64>,
    pub limit_m: Option<f64>,
    pub watch_m: Option<f64>,
    pub rate_m_per_hour: Option<f64>,
    pub rate_p05_m_per_hour: Option<f64>,
    pub rate_p95_m_per_hour: Option<f64>,
    pub trend: String,
    pub crossing_hours_p05: Option<f64>,
    pub crossing_hours_p50: Option<f64>,
    pub crossing_hours_p95: Option<f64>,
    pub not_before_utc: Option<Timestamp>,
    pub likely_utc: Option<Timestamp>,
    pub not_after_utc: Option<Timestamp>,
    /// How the unit is used now.
    pub hours_per_day: Option<f64>,
    pub hours_per_flight: Option<f64>,
    /// Probability to meet the limit before the next check.
    pub check_probability: Option<f64>,
    pub law: Option<String>,
    pub axis: Option<String>,
    pub mann_kendall_p: Option<f64>,
    pub hamed_rao_p: Option<f64>,
    pub sen_rate_m_per_hour: Option<f64>,
    pub sen_low_m_per_hour: Option<f64>,
    pub sen_high_m_per_hour: Option<f64>,
    /// The state a day earlier: the outer nothing when the unit was not known then.
    pub state_day_before: Option<Option<String>>,
}

/// How good the data under a statement are.
#[derive(Debug, Clone, Default, Serialize)]
#[expect(missing_docs, reason = "each field is named for what it holds, with its unit")]
pub struct Quality {
    pub estimated: usize,
    pub refused: usize,
    /// Why flights were refused, and how many; most frequent first.
    pub reasons: Vec<(String, usize)>,
    pub doubts: Vec<(String, usize)>,
    pub last_estimate_utc: Option<Timestamp>,
    pub days_since_estimate: Option<f64>,
    /// Standard deviation found between neighbouring flights over the one stated.
    pub noise_found_over_stated: Option<f64>,
}

/// A change that wear does not make.
#[derive(Debug, Clone, Serialize)]
#[expect(missing_docs, reason = "each field is named for what it holds, with its unit")]
pub struct Event {
    pub departure_utc: Timestamp,
    pub kind: String,
    pub step_m: f64,
    /// Whether an installation near that day explains it.
    pub in_books: bool,
    /// Whether the tail's other actuators changed with it: a sensor or a recorder, not wear.
    pub tail_wide: bool,
}

/// A stay on a tail.
#[derive(Debug, Clone, Serialize)]
#[expect(missing_docs, reason = "each field is named for what it holds, with its unit")]
pub struct Stay {
    pub tail_number: String,
    pub position: String,
    pub installed_utc: Timestamp,
    pub removed_utc: Option<Timestamp>,
}

/// A statement made earlier, and what came of it.
#[derive(Debug, Clone, Serialize)]
#[expect(missing_docs, reason = "each field is named for what it holds, with its unit")]
pub struct Past {
    pub as_of_utc: Timestamp,
    pub days_ago: i64,
    pub state: Option<String>,
    pub gap_m: f64,
    /// What was then foreseen for the day of the report, with its 90 % interval.
    pub foreseen_low_m: f64,
    pub foreseen_m: f64,
    pub foreseen_high_m: f64,
    /// What is found on the day of the report.
    pub found_m: f64,
}

impl Past {
    /// Whether the interval held.
    pub fn held(&self) -> bool {
        (self.foreseen_low_m..=self.foreseen_high_m).contains(&self.found_m)
    }
}

/// A hangar check, and the estimate that stands beside it.
#[derive(Debug, Clone, Serialize)]
#[expect(missing_docs, reason = "each field is named for what it holds, with its unit")]
pub struct Inspection {
    pub date_utc: Timestamp,
    pub play_m: f64,
    pub instrument: Option<String>,
    pub force_n: Option<f64>,
    /// Median of the last estimates before the check; nothing when there was none near.
    pub estimate_m: Option<f64>,
    pub estimates: usize,
}

/// One flight of a unit.
#[derive(Debug, Clone)]
#[expect(missing_docs, reason = "each field is named for what it holds, with its unit")]
pub struct FlightRow {
    pub departure_utc: Timestamp,
    pub flight_id: String,
    pub tail_number: String,
    pub position: String,
    pub unit_hours: Option<f64>,
    pub gap_m: Option<f64>,
    pub gap_p05_m: Option<f64>,
    pub gap_p95_m: Option<f64>,
    pub gap_midrange_m: Option<f64>,
    pub load_reversals: Option<u64>,
    pub load_p05_n: Option<f64>,
    pub load_p95_n: Option<f64>,
    /// Why refused, or what is doubted.
    pub remarks: String,
}

impl Unit {
    /// Where it stands.
    pub fn standing(&self) -> Standing {
        Standing::of(self.statement.state.as_deref())
    }

    /// Part and serial number as people say them.
    pub fn name(&self) -> String {
        match &self.part_number {
            Some(part) => format!("{part} / {}", self.serial_number),
            None => self.serial_number.clone(),
        }
    }
}
