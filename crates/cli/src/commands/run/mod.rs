//! `run`: processes new and changed logs, updates trends and prints the run summary.

mod metrics;
mod summary;

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use jiff::Timestamp;
use pipeline::logs::plan::WorkItem;
use pipeline::run::scheduler::{self, Context};
use pipeline::{Event, Plan, Request, RunEnd, RunSummary, State};
use records::{SerialNumber, TailNumber};

use crate::args::{Global, RunArgs, UnitFilterArgs};
use crate::commands::context::{KnownNames, VERSION, check_range, load_config};
use crate::progress::Progress;
use crate::table::{self, count, number, text};
use crate::{Code, Failure, Output, row_output};

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
    let phase = Arc::new(Mutex::new(Phase::Searching));
    let watch = |event: Event| {
        if matches!(event, Event::Planned { .. }) {
            enter(&phase, Phase::Processing);
        }
        output.event(&event);
        progress.follow(&event);
    };
    let context = Context { program_version: VERSION, wait: args.wait, stop: &stop, watch: &watch };
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
        output.write_result(&summary::text(&report, &config.file.display().to_string(), code))
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

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    /// It lists logs, or waits for another run: nothing is stored.
    Searching,
    Processing,
    Ended,
}

fn enter(phase: &Mutex<Phase>, next: Phase) {
    *phase.lock().unwrap_or_else(PoisonError::into_inner) = next;
}

/// Answers the first signal within a fraction of a second: logs in progress finish; a run that has begun none ends, even
/// if its listing hangs.
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
        // The lock is held until the process ends, so that the run cannot begin to store.
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

/// Whether any unit of the store has this state or a worse one, even if this run did not update the unit.
fn is_reached(report: &RunSummary, least: State) -> bool {
    State::ALL.iter().any(|state| *state >= least && report.states.contains_key(state.as_str()))
}

/// Exit code of a finished run; if it is complete, a reached state comes before alerts that were not sent.
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
        (text("reason", 0), &|w| w.why.to_string()),
        (number("size [MB]", 1), &|w| size(w).map_or_else(table::empty_cell, |size| format!("{size:.2}"))),
    ];
    output.write_result(&(head + &table::of(&work, columns)))?;
    Ok(Code::Success)
}
