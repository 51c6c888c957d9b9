//! `run`: processes new and changed logs, updates trends and prints the run summary.

mod follow_up;
mod metrics;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use jiff::Timestamp;
use pipeline::assess::changes::{Cause, UnitChange};
use pipeline::findings::monitoring::recorder_change::RecorderChange;
use pipeline::fleet::bookkeeping::maintenance_log::UnknownUnit;
use pipeline::fleet::histories::Histories;
use pipeline::logs::plan::StandingError;
use pipeline::run::scheduler::{self, Context};
use pipeline::run::summary::{DuplicateLog, LogError};
use pipeline::{Event, Plan, Request, RunEnd, RunSummary, State};
use records::Quantity;
use records::TrendRow;
use records::{SerialNumber, TailNumber};
use store::Holder;

use crate::args::{FailOn, Global, RunArgs, UnitFilterArgs};
use crate::exit::{Code, Failure};
use crate::output::{Output, escape};
use crate::progress::{Progress, span};
use crate::row_output;
use crate::table::{self, count, number, text};

use crate::commands::context::{KnownNames, VERSION, check_range, load_config};
use crate::commands::results::trend::unit_table;

/// Maximum number of changed units in the summary.
const MAX_CHANGES_SHOWN: usize = 20;

/// Runs the pipeline.
///
/// # Errors
/// If nothing could be run, or the store failed.
pub(crate) fn run(args: &RunArgs, global: &Global, output: &Output) -> Result<Code, Failure> {
    let started_utc = Timestamp::now();
    let ended = execute(args, global, output, started_utc);
    let Err(failure) = &ended else { return ended };
    if let (Some(file), false) = (&args.metrics, args.dry_run)
        && row_output::check_file(file, output).is_ok()
        && !metrics::is_of(file, started_utc)
    {
        metrics::write_failed(file, started_utc, failure.code())?;
    }
    ended
}

fn execute(
    args: &RunArgs,
    global: &Global,
    output: &Output,
    started_utc: Timestamp,
) -> Result<Code, Failure> {
    check_range(args.departures.since, args.departures.until)?;
    args.metrics.as_deref().map_or(Ok(()), |file| row_output::check_file(file, output))?;
    let config = load_config(global)?;
    let request = request(args)?;
    if args.tail.is_some() || args.serial.is_some() {
        let installations = scheduler::installations(&config)?;
        let names = KnownNames::new(Histories::default(), installations);
        names.check_units(&UnitFilterArgs {
            tail: args.tail.clone(),
            serial: args.serial.clone(),
            part: None,
        })?;
    }
    if args.dry_run {
        return dry_run(&config, &request, output);
    }
    let stop = Arc::new(AtomicBool::new(false));
    listen(&stop)?;
    let progress = Progress::new("run", output);
    let phase = Arc::new(Mutex::new(Phase::Searching));
    let watch = |event: Event| {
        if matches!(event, Event::Planned { .. }) {
            enter(&phase, Phase::Processing);
        }
        output.event(&event);
        follow(&event, &progress);
    };
    let context = Context {
        program_version: VERSION,
        holder: Holder::this_process(),
        wait: args.wait,
        stop: &stop,
        watch: &watch,
    };
    let metrics = args.metrics.clone();
    answer_interrupt(&stop, &phase, output, move || {
        metrics.map_or(Ok(()), |file| metrics::write_failed(&file, started_utc, Code::Interrupted))
    });
    let report = scheduler::run(&config, &request, &context);
    enter(&phase, Phase::Ended);
    progress.end();
    let report = report?;
    output.diagnostics(report.errors.iter().map(|e| &e.diagnostic));
    output.diagnostics(&report.follow_up.errors);
    let reached = args.fail_on.is_some_and(|least| is_reached(&report, least));
    let code = code(&report, reached, stop.load(Ordering::Relaxed));
    if let Some(file) = &args.metrics {
        metrics::write(file, &report, code)?;
    }
    let shown = if args.json {
        let text = serde_json::to_string_pretty(&report).map_err(std::io::Error::from)?;
        output.write_exact(&(text + "\n"))
    } else {
        output.write_result(&summary_text(&report, &config.file.display().to_string(), code))
    };
    // The run is stored: a summary that cannot be written does not make it fail.
    if let Err(Failure::Failed(diagnostic)) = shown {
        output.diagnostics([&*diagnostic]);
    }
    Ok(code)
}

fn request(args: &RunArgs) -> Result<Request, Failure> {
    let empty = |e: records::ids::IdError| Failure::usage("empty_name", e, "omit the option to select all");
    Ok(Request {
        since_utc: args.departures.since,
        until_utc: args.departures.until,
        tail_number: args.tail.as_ref().map(TailNumber::new).transpose().map_err(empty)?,
        serial_number: args.serial.as_ref().map(SerialNumber::new).transpose().map_err(empty)?,
        limit: args.limit,
        jobs: args.jobs.map(usize::from),
        retry: args.retry,
        redo: args.redo,
        verify_content: args.verify_content,
    })
}

/// The first signal stops the run after the logs in progress; the second ends the process at once.
fn listen(stop: &Arc<AtomicBool>) -> Result<(), Failure> {
    use signal_hook::consts::{SIGINT, SIGTERM};
    for signal in [SIGINT, SIGTERM] {
        signal_hook::flag::register_conditional_shutdown(signal, Code::Interrupted as i32, Arc::clone(stop))?;
        signal_hook::flag::register(signal, Arc::clone(stop))?;
    }
    Ok(())
}

/// What a run is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    /// It lists logs, or waits for another run: nothing is stored.
    Searching,
    /// It processes logs and stores their results.
    Processing,
    Ended,
}

fn enter(phase: &Mutex<Phase>, next: Phase) {
    *phase.lock().unwrap_or_else(PoisonError::into_inner) = next;
}

/// Answers the first signal within a fraction of a second: the logs in progress finish, and a run that has begun none ends.
/// A listing that hangs could not be asked to end.
fn answer_interrupt(
    stop: &Arc<AtomicBool>,
    phase: &Arc<Mutex<Phase>>,
    output: &Output,
    write_metrics: impl FnOnce() -> Result<(), Failure> + Send + 'static,
) {
    const POLL: Duration = Duration::from_millis(100);
    let (stop, phase, output) = (Arc::clone(stop), Arc::clone(phase), output.clone());
    std::thread::spawn(move || {
        while !stop.load(Ordering::Relaxed) {
            std::thread::sleep(POLL);
        }
        // Held until the process ends: the run must not begin to store meanwhile.
        let phase = phase.lock().unwrap_or_else(PoisonError::into_inner);
        match *phase {
            Phase::Searching => {
                output.note("interrupted while searching for logs or waiting; no log was begun");
                if let Err(failure) = write_metrics() {
                    output.failure(&failure);
                }
                std::process::exit(Code::Interrupted as i32);
            }
            Phase::Processing => {
                output
                    .note("interrupted: finishing the logs in progress; press Ctrl-C again to stop at once");
            }
            Phase::Ended => {}
        }
    });
}

fn follow(event: &Event, progress: &Progress<'_>) {
    match event {
        Event::Planned { logs, .. } => progress.total(*logs),
        Event::Started { log } => progress.started(log),
        Event::Finished { log, refused, diagnostics, .. } => {
            progress.finished(log, *refused, diagnostics.len());
        }
        Event::Stored { .. } | Event::Trends { .. } => {}
    }
}

/// Whether any unit of the store is in a state or worse, updated by this run or not.
fn is_reached(report: &RunSummary, least: FailOn) -> bool {
    let least = match least {
        FailOn::Watch => State::Watch,
        FailOn::Unassessed => State::Unassessed,
        FailOn::Plan => State::Plan,
        FailOn::Act => State::Act,
    };
    State::ALL.iter().any(|state| *state >= least && report.states.contains_key(state.as_str()))
}

/// Exit code of a finished run: that of its record, or the state of a unit where the record has none.
fn code(report: &RunSummary, reached: bool, stopped: bool) -> Code {
    match report.end(stopped) {
        RunEnd::Interrupted => Code::Interrupted,
        RunEnd::LogsInError => Code::LogsInError,
        RunEnd::Complete if reached => Code::StateReached,
        RunEnd::Complete if report.follow_up.has_failed() => Code::AlertsNotSent,
        RunEnd::Complete => Code::Success,
    }
}

/// A log in error with code and place; its actuators may share both.
fn failed_log(error: &LogError) -> String {
    let place = error.diagnostic.location().map(|p| format!("  {p}")).unwrap_or_default();
    format!("{}  {}{place}", escape(&error.log), error.diagnostic.code)
}

/// Lists the causes of failures, most frequent first: with its logs where they are few, else with their number and the first.
fn failures(report: &RunSummary, page: &mut String) {
    const MAX_SHOWN: usize = 10;
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
            let (logs, first) = (count(logs.len(), "log"), escape(&errors[0].log));
            lines.push(format!("{logs}  {code}: {}; first {first}", escape(what)));
        } else {
            lines.extend(errors.into_iter().map(failed_log));
            lines.dedup();
        }
    }
    first_lines(page, "", lines, MAX_SHOWN, "");
}

/// Lists the units of the tables of work that were never installed, and the installations that are still to come.
fn table_findings(report: &RunSummary, page: &mut String) {
    let name = |unit: &UnknownUnit| {
        let part = unit.part_number.as_ref().map(|part| format!("{part} / ")).unwrap_or_default();
        format!("{}: {part}{}: no such unit in the installations table", unit.table, unit.serial_number)
    };
    some_of("unknown", "unit", report.unknown_units.iter().map(name), page);
    some_of("ahead", "date", &report.dates_ahead, page);
    some_of("unknown", "tail", &report.unknown_tails, page);
    some_of("unmapped", "group", &report.unmapped_positions, page);
    some_of("note", "note", &report.notes, page);
    if report.absent > 0 {
        let absent = count(report.absent, "log");
        line(
            page,
            "absent",
            &format!("{absent} of earlier runs that no pattern matches any more; their records stay"),
        );
    }
}

/// Prints the first few of some findings, and how many more there are.
fn some_of(
    head: &str,
    noun: &str,
    all: impl IntoIterator<Item: ToString, IntoIter: ExactSizeIterator>,
    page: &mut String,
) {
    first_lines(page, head, all, MAX_FINDINGS, noun);
}

/// Findings of one kind that are printed.
const MAX_FINDINGS: usize = 5;

/// Prints the first of some lines, each after a label, and how many more there are.
fn first_lines(
    page: &mut String,
    head: &str,
    all: impl IntoIterator<Item: ToString, IntoIter: ExactSizeIterator>,
    most: usize,
    noun: &str,
) {
    let all = all.into_iter();
    let more = all.len().saturating_sub(most);
    all.take(most).for_each(|text| line(page, head, &text.to_string()));
    if more > 0 {
        let more =
            if noun.is_empty() { format!("{more} more") } else { count(more, &format!("more {noun}")) };
        line(page, "", &format!("and {more}, all in `freeplay run --json`"));
    }
}

/// Lists the logs that are copies of others.
fn duplicates(report: &RunSummary, page: &mut String) {
    let copies = &report.duplicates;
    if copies.is_empty() {
        return;
    }
    let text = format!("{} with the samples of another log; not used", count(copies.len(), "log"));
    line(page, "duplicates", &text);
    let name = |copy: &DuplicateLog| format!("{}  copy of {}", copy.log, copy.owner);
    first_lines(page, "", copies.iter().map(name), MAX_FINDINGS, "");
}

/// Logs that failed in earlier runs and have not changed since.
fn standing_errors(report: &RunSummary, page: &mut String) {
    let logs = &report.standing_errors;
    if logs.is_empty() {
        return;
    }
    let text =
        format!("{} of earlier runs; after fixing them: `freeplay run --retry`", count(logs.len(), "log"));
    line(page, "still failed", &text);
    let name = |error: &StandingError| {
        // A duplicate names the log that owns its flight.
        let detail = error.detail.lines().find(|line| line.contains("another log holds the same flight"));
        let detail = detail.map(|line| format!("  {}", line.trim())).unwrap_or_default();
        format!("{}  {}{detail}", error.log, error.code)
    };
    first_lines(page, "", logs.iter().map(name), MAX_FINDINGS, "");
}

/// Run summary as text.
#[allow(clippy::too_many_lines, reason = "one line of the summary after the other")]
fn summary_text(report: &RunSummary, config: &str, code: Code) -> String {
    let mut page = format!(
        "Freeplay {VERSION} · run {} · {config}\n",
        report.started_utc.strftime("%Y-%m-%dT%H:%M:%SZ")
    );
    for run in &report.cut_short {
        let text = format!(
            "{} did not finish: {} processed, {} remaining",
            run.started_utc.strftime("previous run %Y-%m-%dT%H:%M:%SZ"),
            count(run.done as usize, "log"),
            run.not_reached
        );
        line(&mut page, "interrupted", &text);
    }
    let new = report.found - report.known - report.not_asked - report.left;
    let mut found =
        format!("{}: {new} new or changed, {} already processed", count(report.found, "log"), report.known);
    for (what, n) in [
        ("excluded by --tail/--serial/--since/--until", report.not_asked),
        ("left for later by --limit", report.left),
    ] {
        if n > 0 {
            let _ = write!(found, ", {n} {what}");
        }
    }
    line(&mut page, "found", &found);
    let records = report.estimated + report.refusals();
    line(
        &mut page,
        "stored",
        &format!(
            "{} of {}: {} estimated, {}",
            count(records, "record"),
            count(report.flights, "flight"),
            report.estimated,
            refused(report)
        ),
    );
    for refusals in &report.refusals {
        let remedy = refusals.remedy.map(|remedy| format!(": {remedy}")).unwrap_or_default();
        line(&mut page, "refused", &format!("{} {}{remedy}", refusals.reason, refusals.count));
    }
    some_of("mapping", "fault", &report.mapping_faults, &mut page);
    some_of("repeated", "pair", &report.samples_repeated, &mut page);
    if report.kept > 0 {
        let records = count(report.kept, "stored record");
        line(&mut page, "kept", &format!("{records} of logs that failed now stay as they were"));
    }
    some_of("moved", "place", &report.moved, &mut page);
    table_findings(report, &mut page);
    duplicates(report, &mut page);
    if !report.errors.is_empty() {
        line(
            &mut page,
            "failed",
            &format!("{} could not be used; all others are stored", count(report.logs_in_error(), "log")),
        );
    }
    failures(report, &mut page);
    standing_errors(report, &mut page);
    if report.not_reached > 0 {
        line(
            &mut page,
            "remaining",
            &format!("{} not processed; the next run processes them", count(report.not_reached, "log")),
        );
        first_lines(&mut page, "", &report.not_reached_logs, 10, "");
    }
    if !report.quiet.is_empty() {
        let tails: Vec<String> = report
            .quiet
            .iter()
            .map(|quiet| {
                format!("{} since {}", escape(&quiet.tail_number), quiet.since_utc.strftime("%Y-%m-%d"))
            })
            .collect();
        line(&mut page, "no data", &format!("from {}: {}", count(tails.len(), "tail"), tails.join(", ")));
    }
    for moved in &report.recorder_moved {
        line(&mut page, "recorder", &recorder_moved(moved));
    }
    for change in report.quantity_changes.iter().take(MAX_CHANGES) {
        let of_unit = change.serial_number.as_deref().map(|serial| format!("{} ", escape(serial)));
        line(&mut page, "changed", &format!("{}{}", of_unit.unwrap_or_default(), escape(&change.evidence)));
    }
    if report.quantity_changes.len() > MAX_CHANGES {
        let more = report.quantity_changes.len() - MAX_CHANGES;
        line(&mut page, "", &format!("and {more} more, all in `freeplay trend --changes`"));
    }
    if let Some((log, seconds)) = &report.slowest {
        let took = span(Duration::from_secs_f64(report.took_s));
        line(
            &mut page,
            "time",
            &format!(
                "{took}, {}; slowest log {} ({seconds:.1} s)",
                count(report.workers, "worker"),
                escape(log)
            ),
        );
    }
    page.push_str(&work_list_section(&report.trends, &report.work_list));
    page.push_str(&changes_section(&report.changed));
    page.push_str(&follow_up::section(&report.follow_up));
    if code == Code::LogsInError && !report.errors.is_empty() {
        let failed = count(report.logs_in_error(), "log");
        let _ = writeln!(page, "Exit code 1: {failed} failed. After fixing them: `freeplay run --retry`");
    } else if code == Code::LogsInError && report.unacknowledged() > 0 {
        let failed = count(report.unacknowledged(), "log");
        let _ = writeln!(
            page,
            "Exit code 1: {failed} of earlier runs still failed. After fixing them: `freeplay run --retry`; \
             to accept them: `logs.acknowledged_errors`"
        );
    } else if code == Code::LogsInError {
        let _ = writeln!(
            page,
            "Exit code 1: mapping or part settings are wrong for most flights. After fixing pipeline.toml: `freeplay run`"
        );
    }
    page
}

/// Changes of followed quantities that are printed.
const MAX_CHANGES: usize = 10;

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
        escape(&moved.tail_number),
        escape(&moved.positions.join(", ")),
        moved.since_utc.strftime("%Y-%m-%d")
    )
}

fn refused(report: &RunSummary) -> String {
    let reasons: Vec<String> = report.refused.iter().map(|(reason, n)| format!("{reason} {n}")).collect();
    if reasons.is_empty() {
        "0 refused".into()
    } else {
        format!("{} refused ({})", report.refusals(), reasons.join(", "))
    }
}

fn line(page: &mut String, label: &str, text: &str) {
    let _ = writeln!(page, "  {label:<11} {}", escape(text));
}

/// Lists the units that need attention, most urgent first, and counts the others.
fn work_list_section(rows: &[TrendRow], work_list: &[TrendRow]) -> String {
    if rows.is_empty() && work_list.is_empty() {
        return String::new();
    }
    let removed = rows.iter().filter(|r| r.state.is_none()).count();
    let normal = rows.iter().filter(|r| r.state == Some(State::Normal.as_str())).count();
    let mut page = if rows.is_empty() {
        format!("\nno unit updated; {} in the fleet need attention\n", count(work_list.len(), "unit"))
    } else {
        format!(
            "\n{} updated: {} need attention, {normal} normal{}; {} in the fleet need attention\n",
            count(rows.len(), "unit"),
            rows.len() - normal - removed,
            if removed > 0 { format!(", {removed} removed") } else { String::new() },
            count(work_list.len(), "unit")
        )
    };
    if !work_list.is_empty() {
        page.push_str(&unit_table(work_list.iter().collect()));
    }
    page
}

/// Lists the state changes of this run, unit by unit.
fn changes_section(changed: &[UnitChange]) -> String {
    if changed.is_empty() {
        return String::new();
    }
    let mut page = format!("\nstate changes in this run: {}\n", count(changed.len(), "unit"));
    for unit in changed.iter().take(MAX_CHANGES_SHOWN) {
        let part = unit.part_number.as_deref().unwrap_or("–");
        let _ = writeln!(
            page,
            "  {} / {}: {}",
            escape(part),
            escape(&unit.serial_number),
            escape(&change_text(unit))
        );
    }
    if let Some(more @ 1..) = changed.len().checked_sub(MAX_CHANGES_SHOWN) {
        let _ = writeln!(page, "  and {more} more, all in `freeplay run --json`");
    }
    page
}

/// State and event changes of a unit as text.
fn change_text(unit: &UnitChange) -> String {
    let word = |state: Option<&str>| state.unwrap_or("no state").to_owned();
    let mut changes = Vec::new();
    if unit.from.as_deref() != unit.to || (unit.new_events.is_empty() && unit.cleared_events.is_empty()) {
        let why = unit.reason.as_deref().map(|why| format!(" ({why})")).unwrap_or_default();
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

fn dry_run(config: &job::Config, request: &Request, output: &Output) -> Result<Code, Failure> {
    let Plan { found, known, work, .. } = scheduler::dry_run(config, request)?;
    let bytes: i64 = work.iter().filter_map(|w| w.stat.as_ref()).map(|s| s.size_bytes).sum();
    let head = format!(
        "Dry run: {} of {found} would be processed ({known} up to date), {:.1} MB\n",
        count(work.len(), "log"),
        bytes as f64 / 1e6
    );
    let columns = [text("log", 0), text("reason", 0), number("size [MB]", 1)];
    let rows: Vec<Vec<String>> = work
        .iter()
        .map(|w| {
            let megabytes = w
                .stat
                .as_ref()
                .map_or_else(table::empty_cell, |s| format!("{:.2}", s.size_bytes as f64 / 1e6));
            vec![w.log_path.clone(), w.why.as_str().to_owned(), megabytes]
        })
        .collect();
    let table = if rows.is_empty() { String::new() } else { table::layout(&columns, &rows) };
    output.write_result(&(head + &table))?;
    Ok(Code::Success)
}
