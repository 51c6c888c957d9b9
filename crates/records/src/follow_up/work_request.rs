//! Work request: an open finding about a unit, from its events.

use jiff::Timestamp;

use crate::row;

row! {
    /// A finding that wants work, from the run that found it until it is closed.
    #[derive(Debug, Clone, Default, PartialEq, serde::Serialize)]
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
    /// Part number, if known, and serial number.
    pub fn unit(&self) -> (Option<String>, String) {
        (self.part_number.clone(), self.serial_number.clone())
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
