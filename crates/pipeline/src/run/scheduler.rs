//! The run: one flight per worker, longest first, each stored as soon as it is finished.
//!
//! Workers pull the next log from one list, so the longest are begun first and no worker waits for
//! another. Their results go to the one thread that writes: it commits the finished ones,
//! whole flights at a time, so an interrupted run keeps what it finished. Workers without a log left
//! take actuators of the logs that are still in work.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use jiff::Timestamp;
use job::Config;
use job::flight_log::{Actuator, FlightLog, catch_panic, config_digest};
use rayon::prelude::*;
use records::{Diagnostic, GapRecord, Installations, PartNumber, Provenance};
use store::{LogOutcome, LogRecord, LogResult, Store};

use crate::assess::trends;
use crate::findings::FollowUp;
use crate::fleet::bookkeeping::dates_ahead::dates_ahead;
use crate::fleet::bookkeeping::inspections::InspectionRow;
use crate::fleet::bookkeeping::join::Bookkeeping;
use crate::fleet::bookkeeping::maintenance_log::unknown_units;
use crate::fleet::bookkeeping::{inspections, maintenance_log};
use crate::logs::discover;
use crate::logs::plan::{self, Plan, Request, WorkItem, WorkReason};
use crate::run::flight_ownership::{OwnershipLedger, ProcessedLog};
use crate::run::memory_budget::{BYTES_PER_SAMPLE, MemoryBudget};
use crate::run::summary::{self, RunSummary};
use crate::run::worker_pool::{PoolSettings, StepCount, WorkerPool};
use crate::{Error, Event};

/// Longest wait of a finished flight for others of the same commit: each commit is a file and a log entry.
const BATCH_WAIT: Duration = Duration::from_millis(500);
/// A log whose file could not be read is opened again after these delays: a stale handle never recovers.
const READ_AGAIN_AFTER: [Duration; 2] = [Duration::from_millis(300), Duration::from_millis(1500)];
/// Number of finished logs that are committed without waiting.
const BATCH_LOGS: usize = 256;

/// Inputs of a run in addition to its configuration.
#[expect(missing_docs, reason = "each field is named for what it holds")]
pub struct Context<'a> {
    pub program_version: &'a str,
    /// Longest wait for another run that holds it.
    pub wait: Option<Duration>,
    /// Set from outside to end the run after the flights in progress.
    pub stop: &'a AtomicBool,
    pub watch: &'a (dyn Fn(Event) + Sync),
}

/// Reads the installations table that the configuration names, with the units' numbers of today.
///
/// # Errors
/// [`Error::Refused`] with every diagnostic about it.
pub fn installations(config: &Config) -> Result<Installations, Error> {
    let file = config.path(&config.document.logs.installations);
    let refused =
        |found: Vec<ingest::Error>| Error::Refused(found.iter().map(ingest::Error::diagnostic).collect());
    let table =
        ingest::tables::installations(&file, &config.document.columns.installations).map_err(refused)?;
    let Some(file) = config.document.logs.aliases.as_ref().map(|file| config.path(file)) else {
        return Ok(table);
    };
    let aliases = ingest::tables::aliases(&file).map_err(|error| refused(vec![error]))?;
    let table = table.with_aliases(&aliases);
    let Some(what) = table.merged_by_aliases() else { return Ok(table) };
    let hint = "an alias leads from a former number of a unit to its number of today, not to another unit";
    Err(Error::refused(Diagnostic::new("bad_table", what).in_file(file.display()).hint(hint)))
}

/// Dry run: returns the plan of a run without executing it.
///
/// # Errors
/// As [`run`], except that no store is needed.
pub fn dry_run(config: &Config, request: &Request) -> Result<Plan, Error> {
    let accounts = match Store::open(config.store()) {
        Err(store::Error::Missing { .. }) => Vec::new(),
        store => store?.accounts()?,
    };
    Ok(plan::plan(config, &installations(config)?, discover::discover(config)?, accounts, request))
}

/// Processes every log that is new or changed, stores the results, and assesses the units they belong to.
///
/// # Errors
/// [`Error::Refused`] when nothing could be run; [`Error::Store`] when the store fails in the middle:
/// what was committed before is intact, and the rest runs next time.
pub fn run(config: &Config, request: &Request, context: &Context<'_>) -> Result<RunSummary, Error> {
    // One worker per core also for one log, whose actuators are spread over them.
    let cores = || std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let workers = request.jobs.unwrap_or_else(cores).max(1);
    execute_run(config, request, context, workers, |inputs, store| {
        process_all(inputs, context, workers, store)
    })
}

/// A gap by values that nobody entered would be no gap of the part.
fn refuse_placeholders(config: &Config, installations: &Installations) -> Result<(), Error> {
    let is_placeholder =
        |number: &&PartNumber| config.document.part.get(number.as_str()).is_some_and(|part| part.placeholder);
    let installed: BTreeSet<&PartNumber> = installations.iter().map(|i| &i.part_number).collect();
    let Some(number) = installed.into_iter().find(is_placeholder) else { return Ok(()) };
    let what = format!("the values of part {number} are placeholders");
    let hint = "enter its part number and the values of its data sheet in pipeline.toml and the installations table; then \
                delete `placeholder = true`";
    Err(Error::refused(config.at(number.as_str(), Diagnostic::new("placeholder", what).hint(hint))))
}

/// Writes the outcomes of some logs in one commit.
pub(crate) type StoreLogs<'a> = dyn FnMut(Vec<ProcessedLog>) -> Result<(), Error> + 'a;

/// A run from plan to summary; `work` processes the logs and hands their outcomes over to be stored.
pub(crate) fn execute_run(
    config: &Config,
    request: &Request,
    context: &Context<'_>,
    workers: usize,
    work: impl FnOnce(&Arc<RunInputs>, &mut StoreLogs<'_>) -> Result<(), Error>,
) -> Result<RunSummary, Error> {
    let clock = Instant::now();
    let installations = installations(config)?;
    // Before a store is made: a refused run leaves nothing behind.
    refuse_placeholders(config, &installations)?;
    let inspections = inspections::read(config, &installations)?;
    let maintenance = maintenance_log::read(config, &installations)?;
    let found = discover::discover(config)?;
    let store = Store::create_or_open(config.store())?;
    let mut writer = store.lock(context.wait)?;
    let killed = writer.close_killed_runs()?;
    let plan = plan::plan(config, &installations, found, store.accounts()?, request);
    let started_utc = Timestamp::now();
    let mut report = RunSummary::begin(run_id(started_utc), started_utc, &plan, workers);
    report.cut_short = killed;
    report.unknown_units = unknown_units(config, &installations, &maintenance, &inspections);
    let others = maintenance_log::dates(&maintenance).chain(inspections.iter().map(InspectionRow::date));
    report.dates_ahead = dates_ahead(&installations, others, started_utc);
    let config_path = config.file.display().to_string();
    let to_do: Vec<LogRecord> =
        plan.work.iter().map(|work| summary::not_reached(work, &report.run_id)).collect();
    let bytes = plan.work.iter().filter_map(|w| w.stat.as_ref()).map(|s| s.size_bytes as u64).sum();
    (context.watch)(Event::Planned { logs: plan.work.len(), bytes });
    // Before any other commit: a run that is killed leaves its logs as not reached.
    writer.begin_run(&report.row(context.program_version, &config_path, None), &to_do)?;

    let inputs = Arc::new(RunInputs {
        config: config.clone(),
        installations,
        plan,
        run_id: report.run_id.clone(),
        program_version: context.program_version.to_owned(),
    });
    let mut ledger = OwnershipLedger::of(&inputs.plan, config);
    work(&inputs, &mut |done| {
        let mut results: Vec<LogResult> = Vec::new();
        for done in done {
            results.extend(ledger.resolve(done, &writer, &mut report)?);
        }
        if !results.is_empty() {
            writer.commit(&results)?;
            (context.watch)(Event::Stored { logs: results.len() });
        }
        Ok(())
    })?;
    writer.commit(&ledger.resolve_waiting(&writer, &mut report)?)?;
    writer.commit(&ledger.moved_samples(&writer)?)?;
    report.not_reached_logs = ledger.not_reached(&inputs.run_id);
    report.not_reached = report.not_reached_logs.len();
    ledger.add_up(&mut report);
    let gone = inputs.plan.gone.values().flatten();
    report.add_coverage(ledger.accounts(), gone, config, &inputs.installations);
    let OwnershipLedger { touched: mut units, renamed, .. } = ledger;
    report.absent = report.absent.saturating_sub(renamed.len());
    let tables = Bookkeeping::new(config, &inputs.installations);
    report.moved = tables.write(&mut writer, &renamed)?;
    let with_records = units.clone();
    units.extend(report.moved.iter().flat_map(|moved| [moved.former_unit(), moved.present_unit()]));

    (context.watch)(Event::Trends { units: units.len() });
    let (findings, states) =
        trends::assess_run(config, &inputs.installations, &store, &units, &with_records, &mut report)?;
    if report.is_partial() {
        // A run that left logs out cannot determine which tails have no data.
        report.quiet.clear();
    }
    report.took_s = clock.elapsed().as_secs_f64();
    let exit_code = report.end(context.stop.load(Ordering::Relaxed)) as i64;
    if store.needs_compaction()? {
        writer.compact()?;
    }
    writer.write_states(&states)?;
    let ended = Some((exit_code, tables.digest()));
    writer.end_run(&report.row(context.program_version, &config_path, ended))?;
    // After the end of the run is stored: what fails from here on loses nothing of it.
    let follow_up = FollowUp {
        config,
        installations: &inputs.installations,
        maintenance: &maintenance,
        run_id: &report.run_id,
        is_partial: report.not_reached + report.left > 0,
        stop: context.stop,
    };
    report.follow_up = follow_up.run(findings, &mut writer);
    Ok(report)
}

/// Names sort as the runs did.
fn run_id(started_utc: Timestamp) -> String {
    format!("{}-{:08x}", started_utc.strftime("%Y%m%dT%H%M%S%3fZ"), std::process::id())
}

/// Keeps freed memory for the next estimate. The GNU allocator returns blocks of 128 KiB or more to the
/// system as soon as they are freed, and each page costs a fault when it is allocated again, until a
/// larger block was freed: its size is the new threshold (mallopt(3), `M_MMAP_THRESHOLD`). Other systems: no effect.
fn raise_mmap_threshold() {
    const BOUND_BYTES: usize = 4 << 20;
    drop(std::hint::black_box(Vec::<u8>::with_capacity(BOUND_BYTES)));
}

/// Inputs of a run; owned, since abandoned workers outlive it.
pub(crate) struct RunInputs {
    pub(crate) config: Config,
    pub(crate) installations: Installations,
    pub(crate) plan: Plan,
    pub(crate) run_id: String,
    pub(crate) program_version: String,
}

impl RunInputs {
    pub(crate) fn failed(&self, work: &WorkItem, diagnostic: Diagnostic) -> ProcessedLog {
        let mut account = summary::of_log(work, &self.run_id);
        account.config_digest = Some(self.plan.unidentified.clone());
        ProcessedLog::in_error(account, diagnostic)
    }

    /// The outcome of a log whose content is known under these settings. Its records are its own, or those of a log that is
    /// gone, whose place it takes.
    pub(crate) fn known(&self, work: &WorkItem, account: &LogRecord) -> Option<ProcessedLog> {
        let digests = plan::digests(account)?;
        if matches!(work.why, WorkReason::Asked | WorkReason::OwnerGone) {
            return None;
        }
        let is_known = |before: &&LogRecord| {
            plan::digests(before).as_ref() == Some(&digests)
                && plan::is_same_flight(before, account)
                && before.flight_id == account.flight_id
        };
        let counts = |before: &LogRecord| (before.estimated, before.refused);
        let own = work.before.as_ref().filter(is_known).map(counts);
        let gone = self.plan.gone.get(&digests.0).into_iter().flatten();
        let (estimated, refused) = own.or_else(|| gone.filter(is_known).map(counts).next())?;
        let known = LogRecord { outcome: LogOutcome::Known, estimated, refused, ..account.clone() };
        Some(ProcessedLog::without_records(known, Vec::new()))
    }
}

fn process_all(
    inputs: &Arc<RunInputs>,
    context: &Context<'_>,
    workers: usize,
    store: &mut StoreLogs<'_>,
) -> Result<(), Error> {
    raise_mmap_threshold();
    let shared = Arc::clone(inputs);
    let process_log = move |log: usize, budget: &MemoryBudget, steps: &StepCount| {
        WorkerContext { inputs: &shared, budget, steps }.process_log(&shared.plan.work[log])
    };
    let run = &inputs.config.document.run;
    let settings = PoolSettings {
        process_log: Arc::new(process_log),
        plan: &inputs.plan,
        workers,
        limit: Duration::try_from_secs_f64(run.log_timeout_s).unwrap_or(Duration::MAX),
        memory_mib: run.memory_mib,
        stop: context.stop,
        watch: context.watch,
        fail: &|work, diagnostic| inputs.failed(work, diagnostic),
    };
    let mut pool = WorkerPool::start(settings)?;
    while let Some(first) = pool.next(None)? {
        let deadline = Instant::now() + BATCH_WAIT;
        let mut finished = vec![*first];
        while finished.len() < BATCH_LOGS
            && let Some(next) = pool.next(Some(deadline))?
        {
            finished.push(*next);
        }
        store(finished)?;
    }
    Ok(())
}

#[derive(Clone, Copy)]
pub(crate) struct WorkerContext<'a> {
    pub(crate) inputs: &'a RunInputs,
    pub(crate) budget: &'a MemoryBudget,
    pub(crate) steps: &'a StepCount,
}

impl WorkerContext<'_> {
    /// One log; when a read of it failed for a cause that may pass, it is read again as a whole.
    pub(crate) fn process_log(&self, work: &WorkItem) -> ProcessedLog {
        for delay in READ_AGAIN_AFTER {
            let done = self.process_once(work);
            if !done.diagnostics.iter().any(|diagnostic| ingest::is_transient(&diagnostic.code)) {
                return done;
            }
            std::thread::sleep(delay);
        }
        self.process_once(work)
    }

    /// One log; a panic in it is an error row like any other.
    fn process_once(&self, work: &WorkItem) -> ProcessedLog {
        let clock = Instant::now();
        let done = catch_panic(&work.log_path, || Ok(self.open(work)));
        let mut done = done.unwrap_or_else(|diagnostic| self.inputs.failed(work, diagnostic));
        if !done.is_known() {
            done.account.duration_s = clock.elapsed().as_secs_f64();
        }
        done
    }

    fn open(&self, work: &WorkItem) -> ProcessedLog {
        if let Some(fault) = &work.fault {
            return self.inputs.failed(work, fault.clone());
        }
        let step = self.steps.begin();
        let RunInputs { config, installations, run_id, .. } = self.inputs;
        let opened = match FlightLog::open(&work.files, &work.log_path, config, installations) {
            Ok(opened) => opened,
            Err(diagnostic) => return self.inputs.failed(work, diagnostic),
        };
        let flight = &opened.identity.flight;
        let names = opened.position_names();
        let mut account = summary::of_log(work, run_id);
        account.config_digest = Some(config_digest(config, installations, flight, &names));
        account.log_digest = Some(opened.digest.clone());
        account.tail_number = Some(flight.tail_number.to_string());
        account.flight_id = Some(flight.flight_id.to_string());
        account.departure_utc = Some(flight.departure_utc);
        account.positions = names.iter().map(ToString::to_string).collect();
        if let Some(known) = self.inputs.known(work, &account) {
            return known;
        }
        drop(step);
        let (records, diagnostics) = self.records(&opened);
        summary::set_error(&mut account, &diagnostics);
        ProcessedLog { account, records, diagnostics }
    }

    /// The records of a log: its actuators are spread over workers that have no log left to take.
    fn records(&self, opened: &FlightLog<'_>) -> (Vec<GapRecord>, Vec<Diagnostic>) {
        let of_run = Provenance {
            run_id: self.inputs.run_id.clone(),
            program_version: self.inputs.program_version.clone(),
            processed_utc: Timestamp::now(),
            ..Provenance::default()
        };
        let actuators: Vec<_> = opened.actuators().collect();
        let bytes = (opened.log.rows() as u64).saturating_mul(BYTES_PER_SAMPLE);
        let process_log = |at: &&Actuator| {
            let _held = self.budget.take(bytes);
            let _step = self.steps.begin();
            opened.record(at, &of_run)
        };
        let (mut records, mut diagnostics) = (Vec::new(), Vec::new());
        for done in actuators.par_iter().with_max_len(1).map(process_log).collect::<Vec<_>>() {
            match done {
                Ok(record) => records.push(record),
                // An error of the whole log is reported once, not for each actuator.
                Err(diagnostic) if diagnostics.contains(&diagnostic) => {}
                Err(diagnostic) => diagnostics.push(diagnostic),
            }
        }
        (records, diagnostics)
    }
}
