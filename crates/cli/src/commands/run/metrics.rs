//! Run metrics in the Prometheus text format (exposition format 0.0.4).

use std::fmt::Write as _;
use std::path::Path;

use jiff::Timestamp;
use pipeline::{RunSummary, State};

use crate::exit::{Code, Failure};
use crate::row_output::to_file;

/// Writes the metrics to a temporary file and renames it, so that a scraper never reads half of them.
///
/// # Errors
/// If the file cannot be written.
pub(crate) fn write(file: &Path, report: &RunSummary, code: Code) -> Result<(), Failure> {
    let text = text(report, code, value_in(file, "freeplay_run_completed_timestamp_seconds "));
    to_file(file, |out| Ok(std::io::Write::write_all(out, text.as_bytes())?))
}

/// After a run without a summary: its end and exit code, and the other values of the last run that had one.
///
/// # Errors
/// If the file cannot be written.
pub(crate) fn write_failed(file: &Path, started_utc: Timestamp, code: Code) -> Result<(), Failure> {
    const REPLACED: [&str; 3] =
        ["run_started_timestamp_seconds", "run_ended_timestamp_seconds", "run_exit_code"];
    let of_metric = |line: &str, name: &str| {
        line.split_ascii_whitespace().any(|word| word.strip_prefix("freeplay_") == Some(name))
    };
    let before = std::fs::read_to_string(file).unwrap_or_default();
    let kept = before.lines().filter(|line| !REPLACED.iter().any(|name| of_metric(line, name)));
    let mut text: String = kept.flat_map(|line| [line, "\n"]).collect();
    run_gauges(&mut text, started_utc, code);
    to_file(file, |out| Ok(std::io::Write::write_all(out, text.as_bytes())?))
}

/// Whether the file was written by the run that began then, or a later one.
pub(crate) fn is_of(file: &Path, started_utc: Timestamp) -> bool {
    let ended = value_in(file, "freeplay_run_ended_timestamp_seconds ");
    ended.is_some_and(|ended| ended * 1e3 >= started_utc.as_millisecond() as f64)
}

fn gauge(text: &mut String, name: &str, help: &str, value: f64) {
    let _ = writeln!(
        text,
        "# HELP freeplay_{name} {help}\n# TYPE freeplay_{name} gauge\nfreeplay_{name} {value}"
    );
}

/// Start, end and exit code of a run.
fn run_gauges(text: &mut String, started_utc: Timestamp, code: Code) {
    let seconds = |at: Timestamp| at.as_millisecond() as f64 / 1e3;
    gauge(text, "run_started_timestamp_seconds", "When the last run began.", seconds(started_utc));
    gauge(text, "run_ended_timestamp_seconds", "When the last run ended.", seconds(Timestamp::now()));
    gauge(text, "run_exit_code", "Exit code of the last run.", f64::from(code as i32));
}

/// A value of a metrics file.
fn value_in(file: &Path, name: &str) -> Option<f64> {
    let before = std::fs::read_to_string(file).ok()?;
    before.lines().find_map(|line| line.strip_prefix(name)?.parse().ok())
}

fn text(report: &RunSummary, code: Code, completed_before: Option<f64>) -> String {
    let mut text = String::new();
    run_gauges(&mut text, report.started_utc, code);
    let mut gauge = |name: &str, help: &str, value: f64| gauge(&mut text, name, help, value);
    let states = |state: &str| report.trends.iter().filter(|row| row.state == Some(state)).count() as f64;
    let now = Timestamp::now().as_millisecond() as f64 / 1e3;
    let completed =
        matches!(code, Code::Success | Code::LogsInError | Code::StateReached | Code::AlertsNotSent);
    if let Some(at) = if completed { Some(now) } else { completed_before } {
        gauge("run_completed_timestamp_seconds", "When a run last completed.", at);
    }
    gauge("run_duration_seconds", "Duration of the last run.", report.took_s);
    gauge("logs_found", "Logs that match the patterns.", report.found as f64);
    gauge("logs_known", "Logs already processed by earlier runs.", report.known as f64);
    gauge("logs_done", "Logs processed, including failed ones.", report.done as f64);
    gauge("logs_in_error", "Failed logs.", report.logs_in_error() as f64);
    let standing = report.unacknowledged() as f64;
    gauge(
        "logs_still_failed",
        "Failed logs of earlier runs that are not repaired or acknowledged.",
        standing,
    );
    gauge("logs_not_reached", "Logs not processed because the run stopped.", report.not_reached as f64);
    gauge("records_estimated", "Stored records with a gap.", report.estimated as f64);
    gauge(
        "records_refused",
        "Actuator-flights for which no gap could be determined.",
        report.refusals() as f64,
    );
    gauge(
        "mapping_faults",
        "Parts, tails and actuators most of whose flights are refused for a wrong mapping.",
        report.mapping_faults.len() as f64,
    );
    // A run that left logs out cannot determine which tails have no data.
    if !report.is_partial() {
        gauge("tails_quiet", "Tails with no new logs for unusually long.", report.quiet_now as f64);
    }
    let stale = report.stale_now as f64;
    gauge("units_stale", "Installed units without a gap for unusually long before now.", stale);
    if let Some(newest) = report.newest_departure_utc {
        let newest = newest.as_millisecond() as f64 / 1e3;
        gauge("newest_departure_timestamp_seconds", "Newest departure of all logs.", newest);
    }
    for state in State::ALL.map(State::as_str) {
        let name = format!("units_touched_{state}");
        gauge(&name, "Units updated by this run that are in this state.", states(state));
        let name = format!("units_{state}");
        let units = report.states.get(state).copied().unwrap_or_default() as f64;
        gauge(&name, "Units of the fleet in this state.", units);
    }
    let work = &report.follow_up.work_requests;
    gauge("work_requests_open", "Work requests that wait for a decision.", work.open as f64);
    gauge("work_requests_acknowledged", "Work requests that a person has seen.", work.acknowledged as f64);
    gauge("work_requests_deferred", "Work requests that a person postponed.", work.deferred as f64);
    if let Some(alerts) = &report.follow_up.alerts {
        gauge("alerts_sent", "Messages sent by the last run.", alerts.sent as f64);
        gauge("alerts_unsent", "Messages that the next run sends.", (alerts.failed + alerts.waiting) as f64);
        let unconfirmed = alerts.unconfirmed + alerts.unconfirmed_before;
        gauge("alerts_unconfirmed", "Messages that may have been received.", unconfirmed as f64);
    }
    text
}
