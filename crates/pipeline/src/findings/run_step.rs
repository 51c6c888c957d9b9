//! Last step of a run: work requests and alerts are brought up to date. Its errors never lose the run's result.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};

use jiff::Timestamp;
use job::Config;
use job::config::AlertChannel;
use records::{AlertRecord, AlertStatus, Diagnostic, Installations, WorkEventKind, WorkRequest};
use store::Writer;

use crate::error::Error;
use crate::findings::alert_changes::{self, Channels};
use crate::findings::channel;
use crate::findings::delivery::{self, Attempt, Courier};
use crate::findings::finding::{Finding, GAP};
use crate::findings::summary::{AlertSummary, FollowUpSummary, WorkSummary};
use crate::findings::work_requests::requests;
use crate::findings::work_update::{self, Tables};
use crate::fleet::bookkeeping::maintenance_log::MaintenanceLog;

pub(crate) struct FollowUp<'a> {
    pub(crate) config: &'a Config,
    pub(crate) installations: &'a Installations,
    pub(crate) maintenance: &'a MaintenanceLog,
    pub(crate) run_id: &'a str,
    /// Whether the run left logs for later: its states are not those of the whole history.
    pub(crate) is_partial: bool,
    pub(crate) stop: &'a AtomicBool,
}

impl FollowUp<'_> {
    /// Updates work requests, detects changes of state, and sends what is due.
    pub(crate) fn run(&self, findings: Vec<Finding>, writer: &mut Writer) -> FollowUpSummary {
        let mut summary = FollowUpSummary::default();
        if let Err(error) = self.try_run(findings, writer, &mut summary) {
            let what = format!("work requests and alerts are not up to date: {error}");
            let hint = "the results of the run are stored; the next run tries again";
            summary.errors.push(Diagnostic::new("follow_up_failed", what).hint(hint));
        }
        summary
    }

    fn try_run(
        &self,
        mut findings: Vec<Finding>,
        writer: &mut Writer,
        summary: &mut FollowUpSummary,
    ) -> Result<(), Error> {
        let now = Timestamp::now();
        self.update_work(&mut findings, writer, &mut summary.work_requests, now)?;
        let channels = &self.config.document.alerts;
        if !channels.values().any(|channel| channel.enabled) {
            return Ok(());
        }
        let alerts = summary.alerts.insert(AlertSummary::default());
        let rows = self.detect(&findings, channels, writer, alerts, now)?;
        let mut courier = StoreCourier { config: self.config, writer, stop: self.stop };
        let failed = delivery::deliver(rows, channels, self.run_id, &mut courier, alerts)?;
        summary.errors.extend(diagnostics(&failed));
        Ok(())
    }

    fn update_work(
        &self,
        findings: &mut [Finding],
        writer: &mut Writer,
        summary: &mut WorkSummary,
        now: Timestamp,
    ) -> Result<(), Error> {
        let mut events = writer.store().work_events()?;
        let mut added = Vec::new();
        if !self.is_partial {
            let newest = findings.iter().map(|finding| finding.as_of_utc).max();
            let at = newest.map_or(now, |newest| newest.max(now));
            let tables = Tables { installations: self.installations, maintenance: self.maintenance, at };
            added = work_update::update(&events, findings, &tables, self.run_id, now);
            writer.add_work_events(&added)?;
        }
        events.extend(added.iter().cloned());
        let mut requests = requests(&events, now);
        let due_of = |finding: &Finding| {
            (finding.unit.clone(), finding.assessment.as_ref().and_then(|row| row.due_utc))
        };
        let due: BTreeMap<_, _> =
            findings.iter().filter(|finding| finding.quantity == GAP).map(due_of).collect();
        for request in requests.iter_mut().filter(|request| request.is_open() && request.quantity == GAP) {
            request.due_utc = due.get(&request.unit()).copied().flatten();
        }
        let count = |status: &str| requests.iter().filter(|request| request.status == status).count();
        let with = |kinds: &[WorkEventKind]| -> Vec<WorkRequest> {
            let ids = added.iter().filter(|event| kinds.contains(&event.event));
            let ids: Vec<&str> = ids.map(|event| event.request_id.as_str()).collect();
            requests.iter().filter(|request| ids.contains(&request.request_id.as_str())).cloned().collect()
        };
        let open: BTreeMap<_, _> = requests
            .iter()
            .filter(|request| request.is_open())
            .map(|request| ((request.unit(), request.quantity.as_str()), &request.request_id))
            .collect();
        for finding in findings {
            finding.work_request =
                open.get(&(finding.unit.clone(), finding.quantity)).map(|id| (*id).clone());
        }
        *summary = WorkSummary {
            open: count("open"),
            acknowledged: count("acknowledged"),
            deferred: count("deferred"),
            new: with(&[WorkEventKind::Opened, WorkEventKind::Reopened]),
            returned: with(&[WorkEventKind::Returned]),
            moved: with(&[WorkEventKind::Moved]),
            closed: with(&[WorkEventKind::Removed, WorkEventKind::Maintained]),
        };
        Ok(())
    }

    /// Writes the changes of this run; returns every row, with the messages of earlier runs.
    fn detect(
        &self,
        findings: &[Finding],
        channels: &Channels,
        writer: &mut Writer,
        summary: &mut AlertSummary,
        now: Timestamp,
    ) -> Result<Vec<AlertRecord>, Error> {
        let mut rows = writer.store().alerts()?;
        summary.is_held = self.is_partial;
        if self.is_partial {
            return Ok(rows);
        }
        let found = alert_changes::detect(&rows, findings, channels, self.run_id, now);
        let changes = found.iter().filter(|row| row.status == AlertStatus::Recorded).count();
        summary.is_baseline = rows.is_empty() && changes > 0;
        summary.changes = if summary.is_baseline { 0 } else { changes };
        // One commit: a killed run leaves the changes with their messages, or neither.
        writer.write_alerts(&found)?;
        rows.extend(found);
        Ok(rows)
    }
}

/// One diagnostic for each kind of failure and channel.
fn diagnostics(failed: &[AlertRecord]) -> Vec<Diagnostic> {
    let mut of_channels = BTreeMap::<(bool, &str), Vec<&AlertRecord>>::new();
    for row in failed {
        let is_unconfirmed = row.status == AlertStatus::Unconfirmed;
        of_channels.entry((is_unconfirmed, &row.channel)).or_default().push(row);
    }
    let diagnostic = |((is_unconfirmed, channel), rows): ((bool, &str), Vec<&AlertRecord>)| {
        let (code, what, hint) = if is_unconfirmed {
            let hint = "compare `freeplay store alerts` with the receiver; `--resend ID` sends one again";
            ("alert_unconfirmed", "perhaps not received", hint)
        } else {
            ("alert_not_sent", "not sent", "the next run sends them again")
        };
        let why = rows[0].error.as_deref().unwrap_or("no reason is known");
        Diagnostic::new(code, format!("alerts `{channel}`: {} {what}: {why}", rows.len())).hint(hint)
    };
    of_channels.into_iter().map(diagnostic).collect()
}

/// Courier of a run: rows go to the store, messages to the configured channels.
struct StoreCourier<'a> {
    config: &'a Config,
    writer: &'a mut Writer,
    stop: &'a AtomicBool,
}

impl Courier for StoreCourier<'_> {
    type Error = store::Error;

    fn write(&mut self, rows: &[AlertRecord]) -> Result<(), store::Error> {
        self.writer.write_alerts(rows)
    }

    fn send(&mut self, channel: &AlertChannel, row: &AlertRecord) -> Attempt {
        channel::send(self.config, channel, row)
    }

    fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}
