//! Summary of a run as text: what became of its logs, what is due in the fleet, and what changed.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::time::Duration;

use jiff::Timestamp;
use pipeline::assess::changes::{Cause, UnitChange};
use pipeline::findings::monitoring::recorder_change::RecorderChange;
use pipeline::findings::summary::{AlertSummary, FollowUpSummary, WorkSummary};
use pipeline::fleet::bookkeeping::maintenance_log::UnknownUnit;
use pipeline::run::summary::LogError;
use pipeline::{RunSummary, State};
use records::{Quantity, WorkRequest};

use crate::commands::context::VERSION;
use crate::commands::results::trend::unit_table;
use crate::exit::Code;
use crate::output::escape;
use crate::progress::span;
use crate::table::{self, count, unit_name};

const MAX_SHOWN: usize = 5;
const MAX_FAILURES: usize = 10;
const MAX_CHANGED: usize = 20;
const IN_JSON: &str = "`freeplay run --json`";
/// Command that prints every log of the latest run with its error.
const LOGS_OF_RUN: &str = "`freeplay store runs --run last`";

struct Page(String);

impl Page {
    fn line(&mut self, label: &str, text: &str) {
        self.0.push_str(&table::labelled(&format!("  {label:<11} "), text));
    }

    /// The first few of some findings, the first with the label, and how many more there are.
    fn list(
        &mut self,
        label: &str,
        all: impl IntoIterator<Item: ToString, IntoIter: ExactSizeIterator>,
        most: usize,
        others_in: &str,
    ) {
        let all = all.into_iter();
        let more = all.len().saturating_sub(most);
        for (at, finding) in all.take(most).enumerate() {
            self.line(if at == 0 { label } else { "" }, &finding.to_string());
        }
        if more > 0 {
            self.line("", &format!("and {more} more, all in {others_in}"));
        }
    }
}

pub(super) fn text(report: &RunSummary, config: &str, code: Code) -> String {
    let started = report.started_utc.strftime("%Y-%m-%dT%H:%M:%SZ");
    let mut page = Page(format!("Freeplay {VERSION} · run {started} · {config}\n"));
    counts(report, &mut page);
    page.list("mapping", &report.mapping_faults, MAX_SHOWN, IN_JSON);
    page.list("repeated", &report.samples_repeated, MAX_SHOWN, IN_JSON);
    if report.kept > 0 {
        let records = count(report.kept, "stored record");
        page.line("kept", &format!("{records} of logs that failed now stay as they were"));
    }
    page.list("moved", &report.moved, MAX_SHOWN, IN_JSON);
    table_findings(report, &mut page);
    failures(report, &mut page);
    sensors_and_recorders(report, &mut page);
    if let Some((log, seconds)) = &report.slowest {
        let took = span(Duration::from_secs_f64(report.took_s));
        let workers = count(report.workers, "worker");
        page.line("time", &format!("{took}, {workers}; slowest log {log} ({seconds:.1} s)"));
    }
    fleet(report, &mut page.0);
    changes(&report.changed, report, &mut page.0);
    page.0.push_str(&follow_up_section(&report.follow_up));
    page.0.push_str(&exit_text(report, code));
    page.0
}

fn counts(report: &RunSummary, page: &mut Page) {
    for run in &report.cut_short {
        let started = run.started_utc.strftime("previous run %Y-%m-%dT%H:%M:%SZ");
        let (done, left) = (count(run.done as usize, "log"), run.not_reached);
        page.line("interrupted", &format!("{started} did not finish: {done} processed, {left} remaining"));
    }
    let new = report.found - report.known - report.not_asked - report.left;
    let logs = count(report.found, "log");
    let mut found = format!("{logs}: {new} new or changed, {} already processed", report.known);
    for (what, n) in [
        ("excluded by --tail/--serial/--since/--until", report.not_asked),
        ("left for later by --limit", report.left),
    ] {
        if n > 0 {
            let _ = write!(found, ", {n} {what}");
        }
    }
    page.line("found", &found);
    let reasons: Vec<String> = report.refused.iter().map(|(reason, n)| format!("{reason} {n}")).collect();
    let reasons = if reasons.is_empty() { String::new() } else { format!(" ({})", reasons.join(", ")) };
    let records = count(report.estimated + report.refusals(), "record");
    let (flights, estimated, refused) =
        (count(report.flights, "flight"), report.estimated, report.refusals());
    page.line(
        "stored",
        &format!("{records} of {flights}: {estimated} estimated, {refused} refused{reasons}"),
    );
    for refusals in &report.refusals {
        let remedy = refusals.remedy.map(|remedy| format!(": {remedy}")).unwrap_or_default();
        page.line("refused", &format!("{} {}{remedy}", refusals.reason, refusals.count));
    }
}

/// What the operator's tables lack or contradict.
fn table_findings(report: &RunSummary, page: &mut Page) {
    let name = |unit: &UnknownUnit| {
        let part = unit.part_number.as_ref().map(|part| format!("{part} / ")).unwrap_or_default();
        format!("{}: {part}{}: no such unit in the installations table", unit.table, unit.serial_number)
    };
    page.list("unknown", report.unknown_units.iter().map(name), MAX_SHOWN, IN_JSON);
    page.list("ahead", &report.dates_ahead, MAX_SHOWN, IN_JSON);
    page.list("unknown", &report.unknown_tails, MAX_SHOWN, IN_JSON);
    page.list("unmapped", &report.unmapped_positions, MAX_SHOWN, IN_JSON);
    page.list("note", &report.notes, MAX_SHOWN, IN_JSON);
    if report.absent > 0 {
        let absent = count(report.absent, "log");
        let text = "of earlier runs that no pattern matches any more; their records stay";
        page.line("absent", &format!("{absent} {text}"));
    }
}

/// Logs that are copies, that failed now or in earlier runs, and that were left for the next run.
fn failures(report: &RunSummary, page: &mut Page) {
    if !report.duplicates.is_empty() {
        let copies = count(report.duplicates.len(), "log");
        page.line("duplicates", &format!("{copies} with the samples of another log; not used"));
        let copy = report.duplicates.iter().map(|copy| format!("{}  copy of {}", copy.log, copy.owner));
        page.list("", copy, MAX_SHOWN, LOGS_OF_RUN);
    }
    if !report.errors.is_empty() {
        let failed = count(report.logs_in_error(), "log");
        let what = match report.logs_in_part {
            0 => "could not be used; all others are stored".to_owned(),
            part => {
                format!("in error; {part} of them with their other actuators stored, as all other logs are")
            }
        };
        page.line("failed", &format!("{failed} {what}"));
        page.list("", causes(report), MAX_FAILURES, LOGS_OF_RUN);
    }
    if !report.standing_errors.is_empty() {
        let failed = count(report.standing_errors.len(), "log");
        page.line(
            "still failed",
            &format!("{failed} of earlier runs; after fixing them: `freeplay run --retry`"),
        );
        let standing = report.standing_errors.iter().map(|error| {
            // A duplicate names the log that owns its flight.
            let detail = error.detail.lines().find(|line| line.contains("another log holds the same flight"));
            let detail = detail.map(|line| format!("  {}", line.trim())).unwrap_or_default();
            format!("{}  {}{detail}", error.log, error.code)
        });
        page.list("", standing, MAX_SHOWN, IN_JSON);
    }
    if report.not_reached > 0 {
        let left = count(report.not_reached, "log");
        page.line("remaining", &format!("{left} not processed; the next run processes them"));
        page.list("", &report.not_reached_logs, MAX_FAILURES, IN_JSON);
    }
}

/// Causes of failures, most frequent first: with its logs where they are few, else with their number and the first.
fn causes(report: &RunSummary) -> Vec<String> {
    const NAMED: usize = 3;
    let mut causes = BTreeMap::<(&str, &str), Vec<&LogError>>::new();
    for error in &report.errors {
        let cause = (error.diagnostic.code.as_str(), error.diagnostic.message.as_str());
        causes.entry(cause).or_default().push(error);
    }
    let mut causes: Vec<_> = causes.into_iter().collect();
    causes.sort_by_key(|(_, errors)| std::cmp::Reverse(errors.len()));
    let mut lines: Vec<String> = Vec::new();
    for ((code, what), errors) in causes {
        let logs: BTreeSet<&str> = errors.iter().map(|error| error.log.as_str()).collect();
        if logs.len() > NAMED {
            let logs = count(logs.len(), "log");
            lines.push(format!("{logs}  {code}: {what}; first {}", errors[0].log));
        } else {
            // The actuators of a log may share code and place.
            lines.extend(errors.into_iter().map(|error| {
                let place = error.diagnostic.location().map(|place| format!("  {place}"));
                format!("{}  {code}{}", error.log, place.unwrap_or_default())
            }));
            lines.dedup();
        }
    }
    lines
}

/// Tails without data, and changes that are no wear.
fn sensors_and_recorders(report: &RunSummary, page: &mut Page) {
    if !report.quiet.is_empty() {
        let tails = report
            .quiet
            .iter()
            .map(|quiet| format!("{} since {}", quiet.tail_number, quiet.since_utc.strftime("%Y-%m-%d")));
        let tails: Vec<String> = tails.collect();
        page.line("no data", &format!("from {}: {}", count(tails.len(), "tail"), tails.join(", ")));
    }
    page.list("recorder", report.recorder_moved.iter().map(recorder_moved), MAX_FAILURES, IN_JSON);
    let changes = report.quantity_changes.iter().map(|change| {
        let of_unit = change.serial_number.as_deref().map(|serial| format!("{serial} "));
        format!("{}{}", of_unit.unwrap_or_default(), change.evidence)
    });
    page.list("changed", changes, MAX_FAILURES, "`freeplay trend --changes`");
}

fn recorder_moved(moved: &RecorderChange) -> String {
    let change = match moved.quantity {
        Quantity::SkewS => format!("delay {:.1} → {:.1} ms", moved.from * 1e3, moved.to * 1e3),
        Quantity::LoadZeroN => format!("load zero {:+.0} → {:+.0} N", moved.from, moved.to),
        Quantity::LoadDelayS => format!("load delay {:.1} → {:.1} ms", moved.from * 1e3, moved.to * 1e3),
        _ => format!("stiffness {:+.0} %", (moved.to / moved.from - 1.0) * 100.0),
    };
    let whole = if moved.everywhere { "all of " } else { "" };
    format!(
        "{} {whole}{}: {change} since {}; likely a recorder, sensor or wiring change, not wear",
        moved.tail_number,
        moved.positions.join(", "),
        moved.since_utc.strftime("%Y-%m-%d")
    )
}

/// Units of the fleet by state, and those that need attention, most urgent first.
fn fleet(report: &RunSummary, page: &mut String) {
    if report.trends.is_empty() && report.work_list.is_empty() {
        return;
    }
    let states = State::ALL.iter().rev().map(|state| state.as_str());
    let states = states.filter_map(|state| Some(format!("{} {state}", report.states.get(state)?)));
    let (units, updated) =
        (report.states.values().sum(), report.trends.iter().filter(|row| row.state.is_some()).count());
    let states = states.collect::<Vec<_>>().join(", ");
    let _ = writeln!(page, "\n{}: {states}; {updated} updated by this run", count(units, "unit"));
    page.push_str(&unit_table(report.work_list.iter().collect(), u8::MAX));
}

fn changes(changed: &[UnitChange], report: &RunSummary, page: &mut String) {
    if changed.is_empty() {
        return;
    }
    let _ = writeln!(page, "\nstate changes in this run: {}", count(changed.len(), "unit"));
    for unit in changed.iter().take(MAX_CHANGED) {
        let name = unit_name(unit.part_number.as_deref(), &unit.serial_number);
        let text = format!("{}: {}", escape(&name), change_text(unit, report));
        page.push_str(&table::labelled("  ", &text));
    }
    if let Some(more @ 1..) = changed.len().checked_sub(MAX_CHANGED) {
        let _ = writeln!(page, "  and {more} more, all in {IN_JSON}");
    }
}

fn change_text(unit: &UnitChange, report: &RunSummary) -> String {
    let word = |state: Option<&str>| state.unwrap_or("no state").to_owned();
    let mut changes = Vec::new();
    if unit.from.as_deref() != unit.to || (unit.new_events.is_empty() && unit.cleared_events.is_empty()) {
        let row = report.trends.iter().chain(&report.work_list).find(|row| row.unit() == unit.unit());
        let why = row.map(records::TrendRow::why_text).or(unit.reason.clone());
        let why = why.map(|why| format!(" ({why})")).unwrap_or_default();
        changes.push(format!("{} → {}{why}", word(unit.from.as_deref()), word(unit.to)));
    }
    let day = |at: Timestamp| at.strftime("%Y-%m-%d").to_string();
    let new = unit.new_events.iter().map(|e| format!("new: {} of {}", e.kind, day(e.departure_utc)));
    let cleared =
        unit.cleared_events.iter().map(|e| format!("cleared: {} of {}", e.kind, day(e.departure_utc)));
    changes.extend(new.chain(cleared));
    if unit.cause != Cause::Records {
        changes.push(format!("cause: {}", unit.because));
    }
    changes.join("; ")
}

fn exit_text(report: &RunSummary, code: Code) -> String {
    if code != Code::LogsInError {
        return String::new();
    }
    let text = if !report.errors.is_empty() {
        let failed = count(report.logs_in_error(), "log");
        format!("{failed} failed. After the fix: `freeplay run --retry`")
    } else if report.unacknowledged() > 0 {
        let failed = count(report.unacknowledged(), "log");
        format!(
            "{failed} of earlier runs still failed. After the fix: `freeplay run --retry`; to accept them: \
             `logs.acknowledged_errors`"
        )
    } else {
        "mapping or part settings are wrong for most flights. After fixing pipeline.toml: `freeplay run`"
            .to_owned()
    };
    table::labelled("Exit code 1: ", &text)
}

const MAX_REQUESTS: usize = 5;

/// Work requests and alerts; empty without both.
fn follow_up_section(follow_up: &FollowUpSummary) -> String {
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
    let name = |request: &WorkRequest| {
        let unit = unit_name(request.part_number.as_deref(), &request.serial_number);
        format!("{} {}", request.request_id, escape(&unit))
    };
    for (some, what) in changes.iter().filter(|(some, _)| !some.is_empty()) {
        let more = some.len().saturating_sub(MAX_REQUESTS);
        let more = (more > 0).then(|| format!("and {more} more"));
        let listed: Vec<String> = some.iter().take(MAX_REQUESTS).map(name).chain(more).collect();
        page.push_str(&table::labelled(&format!("  {what:<11} "), &listed.join(", ")));
    }
    page
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
