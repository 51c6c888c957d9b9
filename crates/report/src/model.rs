//! View model of a report: plain values in SI, composed by `pipeline`.

use std::collections::BTreeMap;
use std::sync::Arc;

use jiff::Timestamp;
use records::WorkRequest;
use records::{QuantityChange, QuantityRow, TrendRow};
use serde::Serialize;

use crate::format::{level, or_no_data, percent};
use crate::state_badge::StateBadge;

/// Content of a report. Serialised, it is `report.json`; field names there follow the first version.
#[derive(Debug, Clone, Default, Serialize)]
#[expect(missing_docs, reason = "each field is named for what it holds, with its unit")]
pub struct Report {
    pub made_utc: Timestamp,
    pub program: String,
    pub store_version: Option<u64>,
    /// Selection the report is limited to; `None` for the whole fleet.
    pub scope: Option<String>,
    /// Date of the assessments; later data are ignored.
    pub as_of_utc: Option<Timestamp>,
    pub newest_departure_utc: Option<Timestamp>,
    pub logs_known: usize,
    /// Hours until the next check, for the probability of reaching the limit before it.
    pub check_interval_hours: f64,
    #[serde(rename = "log_faults")]
    pub log_errors: Vec<LogError>,
    pub priors: Vec<FleetPriorView>,
    pub tails: Vec<Tail>,
    pub units: Vec<UnitView>,
    /// Changes of quantities other than the gap, of units, tails and parts; the newest first.
    pub quantity_changes: Vec<QuantityChange>,
    /// Wrong mappings with evidence and remedy, in words.
    pub mapping_faults: Vec<String>,
    /// Limits and hours that assessments lack, in words.
    pub notes: Vec<String>,
    /// Whether a table of inspections is configured.
    pub inspections_given: bool,
    /// Inspections of units without records.
    pub inspections_unmatched: usize,
    /// Trends of the units, in their order; written as a table, not part of `report.json`.
    #[serde(skip)]
    pub trend_rows: Vec<TrendRow>,
}

/// Fleet prior of a part number, as learned before a cut-off date.
#[derive(Debug, Clone, Serialize)]
#[expect(missing_docs, reason = "each field is named for what it holds, with its unit")]
pub struct FleetPriorView {
    pub part_number: Option<String>,
    /// Training cut-off.
    pub learned_until_utc: Timestamp,
    pub axis: String,
    pub new_m: f64,
    pub new_sd_m: f64,
    pub life_p05_hours: f64,
    pub life_p50_hours: f64,
    pub life_p95_hours: f64,
}

/// Gap and its 90 % interval at a time.
#[derive(Debug, Clone, Copy)]
#[expect(missing_docs, reason = "each field is named for what it holds, with its unit")]
pub struct TimedInterval {
    pub at_utc: Timestamp,
    pub p05_m: f64,
    pub m: f64,
    pub p95_m: f64,
}

/// A log that could not be read.
#[derive(Debug, Clone, Serialize)]
#[expect(missing_docs, reason = "each field is named for what it holds")]
pub struct LogError {
    pub log_path: String,
    pub tail_number: Option<String>,
    pub code: String,
    pub processed_utc: Timestamp,
}

/// Data of one aircraft.
#[derive(Debug, Clone, Default, Serialize)]
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

/// One unit: its assessment and the data behind it.
#[derive(Debug, Clone, Default, Serialize)]
#[expect(missing_docs, reason = "each field is named for what it holds, with its unit")]
pub struct UnitView {
    pub part_number: Option<String>,
    pub serial_number: String,
    pub tail_number: Option<String>,
    pub position: Option<String>,
    #[serde(rename = "statement")]
    pub assessment: Assessment,
    pub quality: Quality,
    pub events: Vec<Event>,
    #[serde(rename = "stays")]
    pub installations: Vec<Installation>,
    #[serde(rename = "past")]
    pub past_forecasts: Vec<PastForecast>,
    pub inspections: Vec<Inspection>,
    /// Work requests about the unit, earliest first.
    pub work_requests: Vec<WorkRequest>,
    /// Followed quantities other than the gap.
    pub quantities: Vec<QuantityView>,
    /// Gaps in order of flights, at most a hundred means of neighbours, m; drawn, not part of `report.json`.
    #[serde(skip)]
    pub sketch_m: Vec<f64>,
    /// Smoothed level over past flights; plotted, not part of `report.json`.
    #[serde(skip)]
    pub level: Vec<TimedInterval>,
    /// Forecast from the report date on; plotted, not part of `report.json`.
    #[serde(skip)]
    pub forecast: Vec<TimedInterval>,
    /// Shown on the page and in the store, not part of `report.json`.
    #[serde(skip)]
    pub flights: Vec<FlightRow>,
}

/// A followed quantity of a unit.
#[derive(Debug, Clone, Serialize)]
pub struct QuantityView {
    /// Its level, change and state.
    #[serde(flatten)]
    pub row: QuantityRow,
    /// Value in each of the unit's flights, NaN for none; plotted, not part of `report.json`.
    #[serde(skip)]
    pub values: Vec<f32>,
}

/// Assessment of a unit on the date of the report.
#[derive(Debug, Clone, Default, Serialize)]
#[expect(missing_docs, reason = "each field is named for what it holds, with its unit")]
pub struct Assessment {
    pub state: Option<String>,
    pub reason: Option<String>,
    /// What the state asks for, and until when.
    pub action: Option<String>,
    pub due_utc: Option<Timestamp>,
    /// Both in words.
    pub action_text: Option<String>,
    pub flights: usize,
    pub unit_hours: Option<f64>,
    pub gap_m: Option<f64>,
    pub gap_se_m: Option<f64>,
    /// Records that the gap rests on.
    pub gap_records: Option<i64>,
    /// The latest record.
    pub latest_utc: Option<Timestamp>,
    pub latest_gap_m: Option<f64>,
    pub latest_gap_se_m: Option<f64>,
    /// What an installation may add to every gap measured in it, standard deviation.
    pub installation_sd_m: Option<f64>,
    pub limit_m: Option<f64>,
    pub watch_m: Option<f64>,
    pub rate_m_per_hour: Option<f64>,
    pub rate_p05_m_per_hour: Option<f64>,
    pub rate_p95_m_per_hour: Option<f64>,
    pub trend: String,
    pub crossing_hours_p05: Option<f64>,
    pub crossing_hours_p50: Option<f64>,
    pub crossing_hours_p95: Option<f64>,
    pub forecast_method: Option<String>,
    pub not_before_utc: Option<Timestamp>,
    pub likely_utc: Option<Timestamp>,
    pub not_after_utc: Option<Timestamp>,
    /// Recent utilisation.
    pub hours_per_day: Option<f64>,
    pub hours_per_flight: Option<f64>,
    /// Probability of reaching the limit before the next check.
    pub check_probability: Option<f64>,
    pub law: Option<String>,
    pub axis: Option<String>,
    /// State one day earlier; the outer `None` if the unit had no record then.
    pub state_day_before: Option<Option<String>>,
}

/// Quality of the data behind an assessment.
#[derive(Debug, Clone, Default, Serialize)]
#[expect(missing_docs, reason = "each field is named for what it holds, with its unit")]
pub struct Quality {
    pub estimated: usize,
    pub refused: usize,
    /// Rejection reasons and their counts, most frequent first.
    pub reasons: Vec<(String, usize)>,
    /// Remedy of each of them.
    pub remedies: BTreeMap<String, String>,
    #[serde(rename = "doubts")]
    pub flags: Vec<(String, usize)>,
    pub last_estimate_utc: Option<Timestamp>,
    pub days_since_estimate: Option<f64>,
    /// Standard deviation between successive flights divided by the reported standard error.
    #[serde(rename = "noise_found_over_stated")]
    pub noise_ratio: Option<f64>,
}

/// A change point of the gap that wear does not explain, or the onset of wear.
#[derive(Debug, Clone, Serialize)]
#[expect(missing_docs, reason = "each field is named for what it holds, with its unit")]
pub struct Event {
    pub departure_utc: Timestamp,
    pub kind: String,
    pub step_m: f64,
    /// Whether an installation or maintenance entry near that date explains it.
    #[serde(rename = "in_books")]
    pub is_on_record: bool,
    /// Whether other actuators of the tail changed at the same time, which points to a sensor or recorder.
    #[serde(rename = "tail_wide")]
    pub is_tail_wide: bool,
}

/// An installation of the unit on a tail.
#[derive(Debug, Clone, Serialize)]
#[expect(missing_docs, reason = "each field is named for what it holds, with its unit")]
pub struct Installation {
    pub tail_number: String,
    pub position: String,
    pub installed_utc: Timestamp,
    pub removed_utc: Option<Timestamp>,
}

/// A past forecast and the level found later.
#[derive(Debug, Clone, Serialize)]
#[expect(missing_docs, reason = "each field is named for what it holds, with its unit")]
pub struct PastForecast {
    pub as_of_utc: Timestamp,
    pub days_ago: i64,
    pub state: Option<String>,
    pub gap_m: f64,
    /// Forecast for the date of the report, with its 90 % interval.
    #[serde(rename = "foreseen_low_m")]
    pub predicted_low_m: f64,
    #[serde(rename = "foreseen_m")]
    pub predicted_m: f64,
    #[serde(rename = "foreseen_high_m")]
    pub predicted_high_m: f64,
    /// Level found on the date of the report.
    pub found_m: f64,
}

impl PastForecast {
    /// State to show.
    pub(crate) fn badge(&self) -> StateBadge {
        StateBadge::from_state(self.state.as_deref())
    }

    /// Whether the level found lies within the forecast interval.
    pub fn held(&self) -> bool {
        (self.predicted_low_m..=self.predicted_high_m).contains(&self.found_m)
    }
}

/// A hangar inspection and the estimate to compare with it.
#[derive(Debug, Clone, Serialize)]
#[expect(missing_docs, reason = "each field is named for what it holds, with its unit")]
pub struct Inspection {
    pub date_utc: Timestamp,
    pub play_m: f64,
    pub instrument: Option<String>,
    pub force_n: Option<f64>,
    /// Median of the last estimates before the inspection; `None` if there is no recent one.
    pub estimate_m: Option<f64>,
    pub estimates: usize,
}

impl Inspection {
    /// Estimate less inspection, m.
    pub(crate) fn difference_m(&self) -> Option<f64> {
        self.estimate_m.map(|estimate_m| estimate_m - self.play_m)
    }
}

/// One flight of a unit; a report holds those of the whole fleet.
#[derive(Debug, Clone)]
#[expect(missing_docs, reason = "each field is named for what it holds, with its unit")]
pub struct FlightRow {
    pub departure_utc: Timestamp,
    pub flight_id: Box<str>,
    pub tail_number: Arc<str>,
    pub position: Arc<str>,
    pub unit_hours: Option<f64>,
    pub gap_m: Option<f64>,
    pub gap_p05_m: Option<f64>,
    pub gap_p95_m: Option<f64>,
    pub gap_midrange_m: Option<f64>,
    pub load_reversals: Option<u64>,
    pub load_p05_n: Option<f64>,
    pub load_p95_n: Option<f64>,
    /// Rejection reason or quality flags.
    pub remarks: Box<str>,
    /// Page of its diagnostic plot, relative to the report folder, where one is drawn.
    pub plot_path: Option<Box<str>>,
}

impl Report {
    /// Footer of a page: time, program and store version.
    pub(crate) fn footer(&self) -> String {
        let version = self.store_version.map_or_else(String::new, |v| format!(" from store version {v}"));
        format!("Made {} UTC by {}{version}.", crate::format::minute(self.made_utc), self.program)
    }

    /// Units by part number; those without one under `–`.
    pub(crate) fn by_part(&self) -> BTreeMap<&str, Vec<&UnitView>> {
        let mut parts: BTreeMap<&str, Vec<&UnitView>> = BTreeMap::new();
        for unit in &self.units {
            parts.entry(unit.part_number.as_deref().unwrap_or("–")).or_default().push(unit);
        }
        parts
    }
}

impl UnitView {
    /// Tail and position.
    pub(crate) fn place(&self) -> String {
        let words = [self.tail_number.as_deref(), self.position.as_deref()];
        words.into_iter().flatten().collect::<Vec<_>>().join(" ")
    }

    /// Gap divided by limit.
    pub(crate) fn share(&self) -> Option<f64> {
        Some(self.assessment.gap_m? / self.assessment.limit_m?)
    }

    /// Gap divided by limit, as text.
    pub(crate) fn share_text(&self) -> String {
        or_no_data(self.share(), percent)
    }

    /// Gap with its 90 % interval, as text.
    pub(crate) fn gap_text(&self) -> String {
        level(self.assessment.gap_m, self.assessment.gap_se_m)
    }

    /// Number of flights with an estimate.
    pub(crate) fn estimates(&self) -> usize {
        self.flights.iter().filter(|flight| flight.gap_m.is_some()).count()
    }

    /// State to show.
    pub fn badge(&self) -> StateBadge {
        StateBadge::from_state(self.assessment.state.as_deref())
    }

    /// The latest work request that is not closed.
    pub fn open_request(&self) -> Option<&WorkRequest> {
        self.work_requests.iter().rfind(|request| request.is_open())
    }

    /// Part and serial number, `PART / SERIAL`.
    pub fn name(&self) -> String {
        match &self.part_number {
            Some(part) => format!("{part} / {}", self.serial_number),
            None => self.serial_number.clone(),
        }
    }
}
