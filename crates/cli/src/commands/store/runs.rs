//! `store runs`: recent runs, or the logs of one run; killed runs included.

use std::time::Duration;

use jiff::Timestamp;
use records::Status;
use store::{LogOutcome, LogRecord, Query, RunRecord, Store};

use crate::args::RowFormatArgs;
use crate::exit::{Code, Failure};
use crate::output::Output;
use crate::progress::span;
use crate::row_output;
use crate::table::{self, count, number, or_dash, text};

records::row! {
    /// A run as an output row.
    struct Run {
        run_id: String,
        started_utc: Timestamp,
        finished_utc: Option<Timestamp>,
        ended: &'static str,
        exit_code: Option<i64>,
        found: i64,
        known: i64,
        done: i64,
        estimated: i64,
        refused: i64,
        errors: i64,
        not_reached: i64,
        program_version: String,
        config_path: String,
    }
}

records::row! {
    /// A log of a run as an output row.
    struct Log {
        log_path: String,
        class: &'static str,
        reason: Option<String>,
        tail_number: Option<String>,
        flight_id: Option<String>,
        departure_utc: Option<Timestamp>,
        estimated: i64,
        refused: i64,
        duration_s: f64,
        error_detail: Option<String>,
    }
}

/// Lists the last runs, or the logs of one.
///
/// # Errors
/// If the store cannot be read or has no such run.
pub(crate) fn runs(
    store: &Store,
    one: Option<&str>,
    last: usize,
    format: &RowFormatArgs,
    output: &Output,
) -> Result<Code, Failure> {
    let runs = store.runs()?;
    match one {
        None => all(store, &runs[runs.len().saturating_sub(last)..], format, output),
        Some(id) => {
            let found = if id == "last" { runs.last() } else { runs.iter().find(|run| run.run_id == id) };
            let unknown = || {
                let what = format!("no run `{id}` in the store");
                Failure::usage("no_such_run", what, "`freeplay store runs` lists them; `last` is the newest")
            };
            logs(store, found.ok_or_else(unknown)?, format, output)
        }
    }
}

/// Status of a run: value of the column `ended`.
pub(crate) fn run_status(run: &RunRecord, is_held: bool) -> &'static str {
    match run.exit_code {
        Some(0 | 4) => "well",
        Some(1) => "logs in error",
        Some(130) => "interrupted",
        Some(_) => "failed",
        None if is_held && !run.has_ended() => "still goes",
        None => "killed",
    }
}

/// Text shown for a status.
pub(crate) fn status_text(status: &'static str) -> &'static str {
    match status {
        "well" => "completed",
        "logs in error" => "completed, some logs failed",
        "still goes" => "running",
        other => other,
    }
}

fn all(store: &Store, runs: &[RunRecord], format: &RowFormatArgs, output: &Output) -> Result<Code, Failure> {
    let is_held = store.is_held()?;
    let answer: Vec<Run> = runs.iter().map(|run| in_row(run, is_held)).collect();
    row_output::write_rows(format, output, || row_output::batch(&answer), || page(&answer))?;
    Ok(Code::Success)
}

fn in_row(run: &RunRecord, is_held: bool) -> Run {
    Run {
        run_id: run.run_id.clone(),
        started_utc: run.started_utc,
        finished_utc: run.finished_utc,
        ended: run_status(run, is_held),
        exit_code: run.exit_code,
        found: run.found,
        known: run.known,
        done: run.done,
        estimated: run.estimated,
        refused: run.refused,
        errors: run.errors,
        not_reached: run.not_reached,
        program_version: run.program_version.clone(),
        config_path: run.config_path.clone(),
    }
}

fn page(runs: &[Run]) -> String {
    let took = |run: &Run| {
        let end = run.finished_utc?;
        Some(span(Duration::try_from(end.duration_since(run.started_utc)).unwrap_or_default()))
    };
    let columns: &table::Columns<'_, Run> = &[
        (text("run", 0), &|r| r.run_id.clone()),
        (text("ended", 0), &|r| status_text(r.ended).to_owned()),
        (text("duration", 4), &|r| or_dash(took(r).as_deref())),
        (number("found", 2), &|r| r.found.to_string()),
        (number("unchanged", 3), &|r| r.known.to_string()),
        (number("processed", 0), &|r| r.done.to_string()),
        (number("estimated", 1), &|r| r.estimated.to_string()),
        (number("refused", 1), &|r| r.refused.to_string()),
        (number("failed", 0), &|r| r.errors.to_string()),
        (number("not processed", 1), &|r| r.not_reached.to_string()),
    ];
    count(runs.len(), "run") + "\n" + &table::of(runs, columns)
}

fn logs(store: &Store, run: &RunRecord, format: &RowFormatArgs, output: &Output) -> Result<Code, Failure> {
    let found = store.run_logs(&run.run_id)?;
    let reasons = reasons(store, &run.run_id)?;
    let reason = |log: &LogRecord| log.error_code.clone().or_else(|| reasons.get(&log.log_path).map(words));
    let answer: Vec<Log> = found.iter().map(|log| in_log(log, reason(log))).collect();
    let head = format!("run {}, {}: ", run.run_id, status_text(run_status(run, store.is_held()?)));
    row_output::write_rows(format, output, || row_output::batch(&answer), || head + &log_page(&answer))?;
    Ok(Code::Success)
}

/// Count by reason.
type Reasons = std::collections::BTreeMap<String, usize>;

/// Rejection reasons of a run's records by log; records superseded by a later run are not included.
fn reasons(store: &Store, run_id: &str) -> Result<std::collections::HashMap<String, Reasons>, Failure> {
    let mut reasons: std::collections::HashMap<String, Reasons> = std::collections::HashMap::new();
    for record in store.records(&Query { run_id: Some(run_id.to_owned()), ..Query::default() })? {
        if record.estimate.status == Status::Refused {
            let of_log = reasons.entry(record.provenance.log_path).or_default();
            *of_log.entry(record.estimate.reason.unwrap_or_default()).or_default() += 1;
        }
    }
    Ok(reasons)
}

fn words(reasons: &Reasons) -> String {
    let words: Vec<String> = reasons.iter().map(|(reason, n)| format!("{reason} {n}")).collect();
    words.join(", ")
}

fn in_log(log: &LogRecord, reason: Option<String>) -> Log {
    Log {
        log_path: log.log_path.clone(),
        class: class(log),
        reason,
        tail_number: log.tail_number.clone(),
        flight_id: log.flight_id.clone(),
        departure_utc: log.departure_utc,
        estimated: log.estimated,
        refused: log.refused,
        duration_s: log.duration_s,
        error_detail: log.error_detail.clone(),
    }
}

/// Class of a log: a readable log without any gap is *refused*.
fn class(log: &LogRecord) -> &'static str {
    match log.outcome {
        LogOutcome::Done if log.estimated == 0 && log.refused > 0 => "refused",
        other => other.as_str(),
    }
}

fn log_page(logs: &[Log]) -> String {
    let columns: &table::Columns<'_, Log> = &[
        (text("class", 0), &|l| l.class.replace('_', " ")),
        (text("log", 0), &|l| l.log_path.clone()),
        (text("reason", 1), &|l| l.reason.clone().unwrap_or_default()),
        (text("tail", 4), &|l| or_dash(l.tail_number.as_deref())),
        (text("flight", 3), &|l| or_dash(l.flight_id.as_deref())),
        (number("estimated", 2), &|l| l.estimated.to_string()),
        (number("refused", 2), &|l| l.refused.to_string()),
        (number("time [s]", 5), &|l| format!("{:.1}", l.duration_s)),
    ];
    let mut classes = Reasons::new();
    for log in logs {
        *classes.entry(log.class.replace('_', " ")).or_default() += 1;
    }
    format!("{} ({})\n", count(logs.len(), "log"), words(&classes)) + &table::of(logs, columns)
}
