//! View model of a report: plain values in SI, composed by `pipeline`.

use std::collections::BTreeMap;

use jiff::Timestamp;
use records::report_rows::{
    ReportFlight, ReportInspectionRow, ReportLogErrorRow, ReportPastForecastRow, ReportTailRow,
};
use records::{Installation, QuantityChange, QuantityRow, TrendRow, WorkRequest};
use serde::ser::SerializeStruct;
use serde::{Serialize, Serializer};
use trend::Interval;

use crate::charts::frame::day;
use crate::format::or_no_data;
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
    #[serde(rename = "log_faults")]
    pub log_errors: Vec<ReportLogErrorRow>,
    pub priors: Vec<FleetPriorView>,
    pub tails: Vec<ReportTailRow>,
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
}

/// Fleet prior of a part number, as learned before a cut-off date.
#[derive(Debug, Clone, Serialize)]
#[expect(missing_docs, reason = "each field is named for what it holds, with its unit")]
pub struct FleetPriorView {
    pub part_number: Option<String>,
    pub learned_until_utc: Timestamp,
    pub axis: String,
    pub new_m: f64,
    pub new_sd_m: f64,
    pub life_p05_hours: f64,
    pub life_p50_hours: f64,
    pub life_p95_hours: f64,
}

/// One unit: its assessment and the data behind it.
#[derive(Debug, Clone, Default, Serialize)]
#[expect(missing_docs, reason = "each field is named for what it holds, with its unit")]
pub struct UnitView {
    /// In `report.json` under `statement`, with the unit's names and place beside it.
    #[serde(flatten, serialize_with = "statement")]
    pub row: TrendRow,
    pub watch_m: Option<f64>,
    /// State one day earlier; `None` where the unit was not assessed then, `Some(None)` where it was removed.
    pub state_day_before: Option<Option<String>>,
    pub quality: Quality,
    pub events: Vec<Event>,
    #[serde(rename = "stays")]
    pub installations: Vec<Installation>,
    #[serde(rename = "past")]
    pub past_forecasts: Vec<ReportPastForecastRow>,
    pub inspections: Vec<ReportInspectionRow>,
    /// Work requests about the unit, earliest first.
    pub work_requests: Vec<WorkRequest>,
    /// Followed quantities other than the gap.
    pub quantities: Vec<QuantityView>,
    /// Smoothed level over past flights; plotted, not part of `report.json`.
    #[serde(skip)]
    pub level: Vec<(Timestamp, Interval)>,
    /// Forecast from the report date on; plotted, not part of `report.json`.
    #[serde(skip)]
    pub forecast: Vec<(Timestamp, Interval)>,
    /// Shown on the page and in the store, not part of `report.json`.
    #[serde(skip)]
    pub flights: Vec<ReportFlight>,
}

/// Writes an assessment as `statement`, and the names and the place of its unit.
fn statement<S: Serializer>(row: &TrendRow, serializer: S) -> Result<S::Ok, S::Error> {
    let mut unit = serializer.serialize_struct("Unit", 5)?;
    unit.serialize_field("part_number", &row.part_number)?;
    unit.serialize_field("serial_number", &row.serial_number)?;
    unit.serialize_field("tail_number", &row.tail_number)?;
    unit.serialize_field("position", &row.position)?;
    unit.serialize_field("statement", row)?;
    unit.end()
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

impl Event {
    /// What happened, for readers.
    pub(crate) fn word(&self) -> &'static str {
        match self.kind.as_str() {
            "recorded" => "maintenance",
            "reset" if self.step_m < 0.0 => "gap fell",
            "reset" => "gap rose",
            "onset" => "wear began",
            "exceedance" => "over the limit",
            "exceedance_not_confirmed" => "once over the limit",
            _ if self.is_tail_wide => "sensor of the tail moved",
            _ => "measurement moved",
        }
    }
}

/// What every page has: the way to the folder of the report, its title and its footer.
pub(crate) struct Head {
    pub(crate) root: &'static str,
    pub(crate) title: String,
    pub(crate) footer: String,
}

impl Report {
    /// Head of a page, with time, program and store version in its footer.
    pub(crate) fn head(&self, root: &'static str, title: String) -> Head {
        let version = self.store_version.map_or_else(String::new, |v| format!(" from store version {v}"));
        let footer =
            format!("Made {} UTC by {}{version}.", crate::format::minute(self.made_utc), self.program);
        Head { root, title, footer }
    }

    /// Units by part number; those without one under `–`.
    pub(crate) fn by_part(&self) -> BTreeMap<&str, Vec<&UnitView>> {
        let mut parts: BTreeMap<&str, Vec<&UnitView>> = BTreeMap::new();
        for unit in &self.units {
            parts.entry(unit.row.part_number.as_deref().unwrap_or("–")).or_default().push(unit);
        }
        parts
    }

    /// What is wrong or missing in the data: mappings first. `tail` selects what names that tail first.
    pub(crate) fn warnings(&self, tail: Option<&str>) -> Vec<&str> {
        let all = self.mapping_faults.iter().chain(&self.notes).map(String::as_str);
        let names = |text: &&str| {
            tail.is_none_or(|tail| text.strip_prefix(tail).is_some_and(|rest| rest.starts_with([':', ' '])))
        };
        all.filter(names).collect()
    }
}

impl UnitView {
    pub(crate) fn place(&self) -> String {
        let words = [self.row.tail_number.as_deref(), self.row.position.as_deref()];
        words.into_iter().flatten().collect::<Vec<_>>().join(" ")
    }

    /// Day and gap, µm, of each flight with an estimate.
    pub(crate) fn gaps(&self) -> Vec<[f64; 2]> {
        let gap = |flight: &ReportFlight| Some([day(flight.departure_utc), flight.gap_m? * 1e6]);
        self.flights.iter().filter_map(gap).collect()
    }

    pub(crate) fn share_text(&self) -> String {
        let share = self.row.gap_m.zip(self.row.limit_m).map(|(gap_m, limit_m)| gap_m / limit_m);
        or_no_data(share, |share| format!("{:.0} %", 100.0 * share))
    }

    pub(crate) fn badge(&self) -> StateBadge {
        StateBadge::from_state(self.row.state)
    }

    /// The latest work request that is not closed.
    pub(crate) fn open_request(&self) -> Option<&WorkRequest> {
        self.work_requests.iter().rfind(|request| request.is_open())
    }

    /// Part and serial number, `PART / SERIAL`.
    pub fn name(&self) -> String {
        match &self.row.part_number {
            Some(part) => format!("{part} / {}", self.row.serial_number),
            None => self.row.serial_number.clone(),
        }
    }
}
