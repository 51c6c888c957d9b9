//! `store runs`: recent runs, or the logs of one run; killed runs included.

use std::time::Duration;

use jiff::Timestamp;
use records::Status;
use store::{LogOutcome, LogRecord, Query, RunRecord, Store};

use crate::args::RowFormatArgs;
use crate::progress::span;
use crate::table::{self, count, number, or_dash, text};
use crate::{Code, Failure, Output, row_output};

/// Columns of a run; `ended` is its status.
const RUN: [&str; 14] = [
    "run_id",
    "started_utc",
    "finished_utc",
    "ended",
    "exit_code",
    "found",
    "known",
    "done",
    "estimated",
    "refused",
    "errors",
    "not_reached",
    "program_version",
    "config_path",
];
/// Columns of a log of a run; `class` is what became of it, and `reason` why.
const LOG: [&str; 10] = [
    "log_path",
    "class",
    "reason",
    "tail_number",
    "flight_id",
    "departure_utc",
    "estimated",
    "refused",
    "duration_s",
    "error_detail",
];

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
            // A run under a wrong clock, dated ahead, is not the last one.
            let now = Timestamp::now();
            let begun = || runs.iter().rfind(|run| run.started_utc <= now).or(runs.last());
            let found = if id == "last" { begun() } else { runs.iter().find(|run| run.run_id == id) };
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
    let ended = runs.iter().map(|run| Some(run_status(run, is_held))).collect();
    let batch = || row_output::columns(&row_output::batch(runs)?, &RUN, &[("ended", ended)]);
    row_output::write_rows(format, output, batch, || page(runs, is_held))?;
    Ok(Code::Success)
}

fn page(runs: &[RunRecord], is_held: bool) -> String {
    let took = |run: &RunRecord| {
        let end = run.finished_utc?;
        Some(span(Duration::try_from(end.duration_since(run.started_utc)).unwrap_or_default()))
    };
    let columns: &table::Columns<'_, RunRecord> = &[
        (text("run", 0), &|r| r.run_id.clone()),
        (text("ended", 0), &|r| status_text(run_status(r, is_held)).to_owned()),
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
    let logs = store.run_logs(&run.run_id)?;
    let reasons = reasons(store, &run.run_id)?;
    let reason = |log: &LogRecord| log.error_code.clone().or_else(|| reasons.get(&log.log_path).map(words));
    let (classes, why) =
        (logs.iter().map(|log| Some(class(log))).collect(), logs.iter().map(reason).collect());
    let batch =
        || row_output::columns(&row_output::batch(&logs)?, &LOG, &[("class", classes), ("reason", why)]);
    let head = format!("run {}, {}: ", run.run_id, status_text(run_status(run, store.is_held()?)));
    row_output::write_rows(format, output, batch, || head + &log_page(&logs, &reason))?;
    Ok(Code::Success)
}

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

/// Class of a log: a readable log without any gap is *refused*.
fn class(log: &LogRecord) -> &'static str {
    match log.outcome {
        LogOutcome::Done if log.estimated == 0 && log.refused > 0 => "refused",
        other => other.as_str(),
    }
}

fn log_page(logs: &[LogRecord], reason: &dyn Fn(&LogRecord) -> Option<String>) -> String {
    let columns: &table::Columns<'_, LogRecord> = &[
        (text("class", 0), &|l| class(l).replace('_', " ")),
        (text("log", 0), &|l| l.log_path.clone()),
        (text("reason", 1), &|l| reason(l).unwrap_or_default()),
        (text("tail", 4), &|l| or_dash(l.tail_number.as_deref())),
        (text("flight", 3), &|l| or_dash(l.flight_id.as_deref())),
        (number("estimated", 2), &|l| l.estimated.to_string()),
        (number("refused", 2), &|l| l.refused.to_string()),
        (number("time [s]", 5), &|l| format!("{:.1}", l.duration_s)),
    ];
    if logs.is_empty() {
        return "no log was new or changed\n".to_owned();
    }
    let mut classes = Reasons::new();
    for log in logs {
        *classes.entry(class(log).replace('_', " ")).or_default() += 1;
    }
    format!("{} ({})\n", count(logs.len(), "log"), words(&classes)) + &table::of(logs, columns)
}
