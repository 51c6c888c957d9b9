//! Work requests and alerts in the summary of a run.

use std::fmt::Write as _;

use pipeline::findings::summary::{AlertSummary, FollowUpSummary, WorkSummary};
use records::WorkRequest;

use crate::output::escape;
use crate::table::{self, count, unit_name};

/// Requests listed in each line.
const MAX_LISTED: usize = 5;

/// Section of the summary; empty without requests and alerts.
pub(super) fn section(follow_up: &FollowUpSummary) -> String {
    let mut page = work_section(&follow_up.work_requests);
    if let Some(alerts) = &follow_up.alerts {
        page.push_str(&table::labelled("alerts: ", &alerts_text(alerts)));
    }
    if page.is_empty() { page } else { format!("\n{page}") }
}

fn work_section(work: &WorkSummary) -> String {
    let mut page = String::new();
    let counts = [(work.open, "open"), (work.acknowledged, "acknowledged"), (work.deferred, "deferred")];
    let changes =
        [(&work.new, "new"), (&work.returned, "back"), (&work.moved, "moved"), (&work.closed, "closed")];
    if counts.iter().all(|(n, _)| *n == 0) && changes.iter().all(|(some, _)| some.is_empty()) {
        return page;
    }
    let counts: Vec<String> = counts.iter().map(|(n, status)| format!("{n} {status}")).collect();
    let _ = writeln!(page, "work requests: {} (`freeplay work list`)", counts.join(", "));
    for (some, what) in changes.iter().filter(|(some, _)| !some.is_empty()) {
        let more = some.len().saturating_sub(MAX_LISTED);
        let more = if more > 0 { format!(", and {more} more") } else { String::new() };
        page.push_str(&table::labelled(&format!("  {what:<11} "), &(listed(some) + &more)));
    }
    page
}

fn listed(some: &[WorkRequest]) -> String {
    let name = |request: &WorkRequest| {
        let unit = unit_name(request.part_number.as_deref(), &request.serial_number);
        format!("{} {}", request.request_id, escape(&unit))
    };
    some.iter().take(MAX_LISTED).map(name).collect::<Vec<_>>().join(", ")
}

fn alerts_text(alerts: &AlertSummary) -> String {
    let mut parts = Vec::new();
    if alerts.is_baseline {
        parts.push("the present states are the baseline; changes are sent from now on".to_owned());
    } else if alerts.is_held {
        parts.push("changes wait for a run that processes every log".to_owned());
    } else {
        parts.push(count(alerts.changes, "state change"));
    }
    for (n, what) in [
        (alerts.sent, "sent"),
        (alerts.failed, "not sent, the next run sends again"),
        (alerts.waiting, "left for the next run"),
        (alerts.unconfirmed + alerts.unconfirmed_before, "unconfirmed (`freeplay store alerts --unsent`)"),
    ] {
        if n > 0 {
            parts.push(format!("{} {what}", count(n, "message")));
        }
    }
    for (channel, n) in &alerts.without_channel {
        let (messages, channel) = (count(*n, "message"), escape(channel));
        parts.push(format!(
            "{messages} for `[alerts.{channel}]`, which is no longer configured (`freeplay store alerts --drop {channel}`)"
        ));
    }
    parts.join("; ")
}
