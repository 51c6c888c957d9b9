//! Work request: an open finding about a unit. Its events, the steps of its life, are only added; the request is their sum.

use jiff::Timestamp;
use serde::Serialize;
use strum::{EnumString, IntoStaticStr};

use crate::row_schema::word_cell;
use crate::{row, stored_row};

/// Kind of a work event.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, IntoStaticStr, EnumString)]
#[strum(serialize_all = "snake_case")]
pub enum WorkEventKind {
    /// A run found the unit in state `plan` or `act`.
    #[default]
    Opened,
    /// A person has seen the request.
    Acknowledged,
    /// A person postponed the request.
    Deferred,
    /// A deferred request came back: its date passed, or the state became worse.
    Returned,
    /// The unit is installed in another place.
    Moved,
    /// The state of the unit changed.
    StateChanged,
    /// The unit, removed before, is installed again without maintenance.
    Reopened,
    /// The unit was removed.
    Removed,
    /// The maintenance table has a repair of the unit.
    Maintained,
    /// A person closed the request.
    Closed,
}

impl WorkEventKind {
    /// Whether the event closes its request.
    pub fn closes(self) -> bool {
        matches!(self, Self::Removed | Self::Maintained | Self::Closed)
    }
}

word_cell!(WorkEventKind);

stored_row! {
    /// One step in the life of a work request.
    #[derive(Debug, Clone, Default, PartialEq)]
    pub struct WorkEvent {
        /// Number of the event in the store, from 1.
        pub number: i64,
        /// The request, such as `W12`.
        pub request_id: String,
        /// What happened to the request.
        pub event: WorkEventKind,
        /// Part number of the unit.
        pub part_number: Option<String>,
        /// Serial number of the unit.
        pub serial_number: String,
        /// The aircraft.
        pub tail_number: Option<String>,
        /// Position on the aircraft.
        pub position: Option<String>,
        /// Quantity of the finding; `gap` is the free play.
        pub quantity: String,
        /// State of the unit.
        pub state: Option<String>,
        /// Why: of the state, of the person, or of the table that closed the request.
        pub reason: Option<String>,
        /// Who: a person, or `freeplay` for what a run found.
        pub by: String,
        /// Of a deferral: until when.
        pub until_utc: Option<Timestamp>,
        /// Date of the fact: of the assessment, of the removal, of the repair, or of the command.
        pub as_of_utc: Timestamp,
        /// When the event was written.
        pub recorded_utc: Timestamp,
        /// The run that wrote it; empty for a command.
        pub run_id: Option<String>,
        /// Departure of the latest flight behind the finding that opened the request.
        pub latest_flight_utc: Option<Timestamp>,
    }
}

row! {
    /// A finding that wants work, from the run that found it until it is closed.
    #[derive(Debug, Clone, Default, PartialEq, Serialize)]
    pub struct WorkRequest {
        /// Identifier, such as `W12`.
        pub request_id: String,
        /// `open`, `acknowledged`, `deferred` or `closed`.
        pub status: &'static str,
        /// Latest known state of the unit.
        pub state: Option<String>,
        /// Part number of the unit.
        pub part_number: Option<String>,
        /// Serial number of the unit.
        pub serial_number: String,
        /// The aircraft, by the installations table.
        pub tail_number: Option<String>,
        /// Position on the aircraft.
        pub position: Option<String>,
        /// Quantity of the finding; `gap` is the free play.
        pub quantity: String,
        /// Reason of the latest known state.
        pub finding: Option<String>,
        /// Due date in the latest assessment, `due_utc` of the trend.
        pub due_utc: Option<Timestamp>,
        /// Date of the assessment that opened the request.
        pub opened_utc: Timestamp,
        /// Departure of the latest flight behind the finding that opened it.
        pub latest_flight_utc: Option<Timestamp>,
        /// Who decided last; `freeplay` when a table closed the request.
        pub by: Option<String>,
        /// Their reason.
        pub reason: Option<String>,
        /// End of a deferral.
        pub until_utc: Option<Timestamp>,
        /// Date of the latest event.
        pub changed_utc: Timestamp,
        /// `removed`, `maintained` or, by a person, `closed`.
        pub closed_by: Option<String>,
        /// Date of the removal, maintenance or command.
        pub closed_utc: Option<Timestamp>,
    }
}

impl WorkRequest {
    /// Until when flights made the finding: a repair after it answers the request, also one that was done before a run saw them.
    pub fn found_until(&self) -> Timestamp {
        self.latest_flight_utc.map_or(self.opened_utc, |at| at.min(self.opened_utc))
    }

    /// Number and status: `W12 deferred to 2026-12-01`.
    pub fn title(&self) -> String {
        format!("{} {}", self.request_id, self.status_text())
    }

    /// Status with its date: `deferred to 2026-12-01`.
    pub fn status_text(&self) -> String {
        let day = |at: Timestamp| at.strftime("%Y-%m-%d");
        match (self.status, self.until_utc, self.closed_utc) {
            ("deferred", Some(until), _) => format!("deferred to {}", day(until)),
            ("open", Some(until), _) => format!("open, was deferred to {}", day(until)),
            ("closed", _, Some(closed)) => {
                format!("{} {}", self.closed_by.as_deref().unwrap_or("closed"), day(closed))
            }
            (other, ..) => other.to_owned(),
        }
    }

    /// Whether work is left to do, now or later.
    pub fn is_open(&self) -> bool {
        self.status != "closed"
    }
}
