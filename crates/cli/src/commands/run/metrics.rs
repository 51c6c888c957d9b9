//! Run metrics in the Prometheus text format (exposition format 0.0.4).

use std::fmt::Write as _;
use std::path::Path;

use jiff::Timestamp;
use pipeline::{RunSummary, State};

use crate::exit::{Code, Failure};
use crate::row_output::to_file;

/// Writes the metrics to a temporary file and renames it, so that a scraper never reads half of them.
pub(crate) fn write(file: &Path, report: &RunSummary, code: Code) -> Result<(), Failure> {
    let text = text(report, code, value_in(file, "freeplay_run_completed_timestamp_seconds "));
    to_file(file, |out| Ok(std::io::Write::write_all(out, text.as_bytes())?))
}

/// Writes times and exit code of a run that failed without a summary; other values stay those of the last summary.
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

/// Whether the run that began at this time, or a later one, wrote the file.
pub(crate) fn is_of(file: &Path, started_utc: Timestamp) -> bool {
    let started = value_in(file, "freeplay_run_started_timestamp_seconds ");
    started.is_some_and(|started| (started * 1e3).round() >= started_utc.as_millisecond() as f64)
}

fn gauge(text: &mut String, name: &str, help: &str, value: f64) {
    let _ = writeln!(
        text,
        "# HELP freeplay_{name} {help}\n# TYPE freeplay_{name} gauge\nfreeplay_{name} {value}"
    );
}

fn run_gauges(text: &mut String, started_utc: Timestamp, code: Code) {
    let seconds = |at: Timestamp| at.as_millisecond() as f64 / 1e3;
    gauge(text, "run_started_timestamp_seconds", "When the last run began.", seconds(started_utc));
    gauge(text, "run_ended_timestamp_seconds", "When the last run ended.", seconds(Timestamp::now()));
    gauge(text, "run_exit_code", "Exit code of the last run.", f64::from(code as i32));
}

fn value_in(file: &Path, name: &str) -> Option<f64> {
    let before = std::fs::read_to_string(file).ok()?;
    before.lines().find_map(|line| line.strip_prefix(name)?.parse().ok())
}

fn text(report: &RunSummary, code: Code, completed_before: Option<f64>) -> String {
    let mut text = String::new();
    run_gauges(&mut text, report.started_utc, code);
    let seconds = |at: Timestamp| at.as_millisecond() as f64 / 1e3;
    let completed =
        matches!(code, Code::Success | Code::LogsInError | Code::StateReached | Code::AlertsNotSent);
    let completed = if completed { Some(seconds(Timestamp::now())) } else { completed_before };
    let count = |n: usize| Some(n as f64);
    // A run that left logs out cannot determine which tails have no data.
    let quiet = count(report.quiet_now).filter(|_| !report.is_partial());
    let (work, alerts) = (&report.follow_up.work_requests, report.follow_up.alerts.as_ref());
    let newest = report.newest_departure_utc.map(seconds);
    let unsent = alerts.map(|alerts| (alerts.failed + alerts.waiting) as f64);
    let unconfirmed = alerts.map(|alerts| (alerts.unconfirmed + alerts.unconfirmed_before) as f64);
    for (name, help, value) in [
        ("run_completed_timestamp_seconds", "When a run last completed.", completed),
        ("run_duration_seconds", "Duration of the last run.", Some(report.took_s)),
        ("logs_found", "Logs that match the patterns.", count(report.found)),
        ("logs_known", "Logs already processed by earlier runs.", count(report.known)),
        ("logs_done", "Logs processed, including failed ones.", count(report.done)),
        ("logs_in_error", "Failed logs.", count(report.logs_in_error())),
        (
            "logs_still_failed",
            "Failed logs of earlier runs that are not repaired or acknowledged.",
            count(report.unacknowledged()),
        ),
        ("logs_not_reached", "Logs not processed because the run stopped.", count(report.not_reached)),
        ("records_estimated", "Records with a gap that the last run stored.", count(report.estimated)),
        ("records_refused", "Records without a gap that the last run stored.", count(report.refusals())),
        (
            "mapping_faults",
            "Parts, tails and actuators most of whose flights are refused for a wrong mapping.",
            count(report.mapping_faults.len()),
        ),
        ("tails_quiet", "Tails with no new logs for unusually long.", quiet),
        ("units_stale", "Installed units whose newest record is unusually old.", count(report.stale_now)),
        ("newest_departure_timestamp_seconds", "Newest departure of all logs.", newest),
        ("work_requests_open", "Work requests that wait for a decision.", count(work.open)),
        ("work_requests_acknowledged", "Work requests that a person has seen.", count(work.acknowledged)),
        ("work_requests_deferred", "Work requests that a person postponed.", count(work.deferred)),
        ("alerts_sent", "Messages sent by the last run.", alerts.map(|alerts| alerts.sent as f64)),
        ("alerts_unsent", "Messages that the next run sends.", unsent),
        ("alerts_unconfirmed", "Messages that may have been received.", unconfirmed),
    ] {
        value.into_iter().for_each(|value| gauge(&mut text, name, help, value));
    }
    for state in State::ALL.map(State::as_str) {
        let touched = report.trends.iter().filter(|row| row.state == Some(state)).count() as f64;
        let help = "Units updated by this run that are in this state.";
        gauge(&mut text, &format!("units_touched_{state}"), help, touched);
        let units = report.states.get(state).copied().unwrap_or_default() as f64;
        gauge(&mut text, &format!("units_{state}"), "Units of the fleet in this state.", units);
    }
    text
}
