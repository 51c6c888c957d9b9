//! What a run did with alerts and work requests.

use records::{AlertRecord, AlertStatus, Diagnostic, WorkRequest};
use serde::Serialize;

/// Alerts of a run.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct AlertSummary {
    /// Changes of state since the last known states; none in the run that writes the baseline.
    pub changes: usize,
    /// Whether this run wrote the baseline: the states known when alerts begin.
    pub is_baseline: bool,
    /// Whether changes wait for a run that processes every log.
    pub is_held: bool,
    /// Messages that were accepted.
    pub sent: usize,
    /// Messages that were not accepted; the next run sends them again.
    pub failed: usize,
    /// Messages that may have been received, new in this run.
    pub unconfirmed: usize,
    /// The same of earlier runs.
    pub unconfirmed_before: usize,
    /// Messages left for the next run without an attempt.
    pub waiting: usize,
    /// Messages that were not sent to a channel that the configuration has no more, by its name.
    pub without_channel: std::collections::BTreeMap<String, usize>,
}

impl AlertSummary {
    /// Counts a message of an enabled channel after a run's delivery.
    pub(super) fn count(&mut self, row: &AlertRecord, run_id: &str, is_due: bool) {
        let is_attempted = row.run_id == run_id && row.error.is_some();
        let counter = match row.status {
            AlertStatus::Sent if row.run_id == run_id => &mut self.sent,
            AlertStatus::Unconfirmed if is_attempted => &mut self.unconfirmed,
            AlertStatus::Unconfirmed if !is_due => &mut self.unconfirmed_before,
            AlertStatus::Pending if is_attempted => &mut self.failed,
            _ if is_due => &mut self.waiting,
            _ => return,
        };
        *counter += 1;
    }
}

/// Work requests after a run.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
#[expect(missing_docs, reason = "each field is named for what it holds")]
pub struct WorkSummary {
    pub open: usize,
    pub acknowledged: usize,
    pub deferred: usize,
    /// Requests that this run opened, or opened again.
    pub new: Vec<WorkRequest>,
    /// Deferred requests that came back in this run.
    pub returned: Vec<WorkRequest>,
    /// Requests whose unit is installed in another place.
    pub moved: Vec<WorkRequest>,
    pub closed: Vec<WorkRequest>,
}

/// What follows from a run's findings.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
#[expect(missing_docs, reason = "each field is named for what it holds")]
pub struct FollowUpSummary {
    pub alerts: Option<AlertSummary>,
    pub work_requests: WorkSummary,
    #[serde(rename = "follow_up_errors")]
    pub errors: Vec<Diagnostic>,
}

impl FollowUpSummary {
    /// Whether a message was not accepted, or may not have been, or the tables could not be written.
    pub fn has_failed(&self) -> bool {
        !self.errors.is_empty()
    }
}
