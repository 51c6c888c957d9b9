//! `run`: processes new and changed logs, updates trends and prints the run summary.

mod follow_up;
mod metrics;
mod summary;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use jiff::Timestamp;
use pipeline::logs::plan::WorkItem;
use pipeline::run::scheduler::{self, Context};
use pipeline::{Event, Plan, Request, RunEnd, RunSummary, State};
use records::{SerialNumber, TailNumber};
use store::Holder;

use crate::args::{FailOn, Global, RunArgs, UnitFilterArgs};
use crate::exit::{Code, Failure};
use crate::output::Output;
use crate::progress::Progress;
use crate::row_output;
use crate::table::{self, count, number, text};

use crate::commands::context::{KnownNames, VERSION, check_range, load_config};

/// Runs the pipeline.
///
/// # Errors
/// If nothing could be run, or the store failed.
pub(crate) fn run(args: &RunArgs, global: &Global, output: &Output) -> Result<Code, Failure> {
    let started_utc = Timestamp::now();
    let ended = execute(args, global, output);
    let code = match &ended {
        Err(failure) => failure.code(),
        Ok(Code::Interrupted) => Code::Interrupted,
        Ok(_) => return ended,
    };
    if let (Some(file), false) = (&args.metrics, args.dry_run)
        && row_output::check_file(file, output).is_ok()
        && !metrics::is_of(file, started_utc)
    {
        metrics::write_failed(file, started_utc, code)?;
    }
    ended
}

fn execute(args: &RunArgs, global: &Global, output: &Output) -> Result<Code, Failure> {
    check_range(args.departures.since, args.departures.until)?;
    args.metrics.as_deref().map_or(Ok(()), |file| row_output::check_file(file, output))?;
    let config = load_config(global)?;
    let request = request(args)?;
    if args.tail.is_some() || args.serial.is_some() {
        let installations = scheduler::installations(&config)?;
        let names = KnownNames::Store(None, installations);
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
    let watch = |event: Event| {
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
    let is_done = Arc::new(AtomicBool::new(false));
    announce_interrupt(&stop, &is_done, output);
    let report = scheduler::run(&config, &request, &context);
    is_done.store(true, Ordering::Relaxed);
    progress.end();
    if let (Err(pipeline::Error::Store(store::Error::Held { .. })), true) =
        (&report, stop.load(Ordering::Relaxed))
    {
        output.note("interrupted while waiting for another run; nothing was started");
        return Ok(Code::Interrupted);
    }
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
        output.write_result(&summary::text(&report, &config.file.display().to_string(), code))
    };
    // The run is stored: a summary that cannot be written does not make it fail.
    if let Err(Failure::Failed(diagnostic)) = shown {
        output.diagnostics([&*diagnostic]);
    }
    Ok(code)
}

fn request(args: &RunArgs) -> Result<Request, Failure> {
    let empty =
        |e: records::ids::EmptyIdError| Failure::usage("empty_name", e, "omit the option to select all");
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

/// Acknowledges the first signal within a fraction of a second, while the logs in progress finish.
fn announce_interrupt(stop: &Arc<AtomicBool>, is_done: &Arc<AtomicBool>, output: &Output) {
    const POLL: Duration = Duration::from_millis(100);
    let (stop, is_done, output) = (Arc::clone(stop), Arc::clone(is_done), output.clone());
    std::thread::spawn(move || {
        while !is_done.load(Ordering::Relaxed) {
            if stop.load(Ordering::Relaxed) {
                output
                    .note("interrupted: finishing the logs in progress; press Ctrl-C again to stop at once");
                return;
            }
            std::thread::sleep(POLL);
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

fn dry_run(config: &job::Config, request: &Request, output: &Output) -> Result<Code, Failure> {
    let Plan { found, known, work, .. } = scheduler::dry_run(config, request)?;
    let bytes: i64 = work.iter().filter_map(|w| w.stat.as_ref()).map(|s| s.size_bytes).sum();
    let head = format!(
        "Dry run: {} of {found} would be processed ({known} up to date), {:.1} MB\n",
        count(work.len(), "log"),
        bytes as f64 / 1e6
    );
    let size = |work: &WorkItem| work.stat.as_ref().map(|stat| stat.size_bytes as f64 / 1e6);
    let columns: &table::Columns<'_, WorkItem> = &[
        (text("log", 0), &|w| w.log_path.clone()),
        (text("reason", 0), &|w| w.why.as_str().to_owned()),
        (number("size [MB]", 1), &|w| size(w).map_or_else(table::empty_cell, |size| format!("{size:.2}"))),
    ];
    output.write_result(&(head + &table::of(&work, columns)))?;
    Ok(Code::Success)
}
