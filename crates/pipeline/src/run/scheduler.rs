//! The run: one flight per worker, longest first, each stored as soon as it is finished.
//!
//! Workers pull the next log from one list, so the longest are begun first and no worker waits for
//! another. What they finish goes to the one thread that writes: it commits whatever has gathered,
//! whole flights at a time, so an interrupted run keeps what it finished. Workers without a log left
//! take actuators of the logs that are still in work.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

use ingest::ActuatorColumns;
use jiff::Timestamp;
use job::flight_log::{FlightLog, catch_panic, config_digest, digest_without_identity};
use job::{Config, ProvenanceStamp};
use rayon::prelude::*;
use records::{Diagnostic, GapRecord, Installations, Status};
use store::{Holder, LogOutcome, LogRecord, LogResult, RunRecord, Store, Writer};

use crate::error::Error;
use crate::fleet_trends::assess;
use crate::run::discover;
use crate::run::event::Event;
use crate::run::flight_ownership::{LogOutcomeData, OwnershipLedger};
use crate::run::memory_budget::MemoryBudget;
use crate::run::plan::{self, Plan, Request, WorkItem, WorkReason};
use crate::run::summary::{self, KilledRun, RunSummary};

/// Finished flights wait this long at most for company in a commit: each commit is a file and a log entry.
const BATCH_WAIT: Duration = Duration::from_millis(500);
/// So many finished logs are committed without waiting.
const BATCH_LOGS: usize = 256;

/// Inputs of a run in addition to its configuration.
pub struct Context<'a> {
    /// The version written into every record.
    pub program_version: &'a str,
    /// Who holds the store meanwhile.
    pub holder: Holder,
    /// How long to wait for another run that holds it.
    pub wait: Option<Duration>,
    /// Set from outside to end the run after the flights in progress.
    pub stop: &'a AtomicBool,
    /// Receives every event.
    pub watch: &'a (dyn Fn(Event) + Sync),
}

/// Reads the installations table that the configuration names.
///
/// # Errors
/// [`Error::Refused`] with every diagnostic about it.
pub fn installations(config: &Config) -> Result<Installations, Error> {
    let file = config.path(&config.document.logs.installations);
    ingest::tables::installations(&file, &config.document.columns.installations)
        .map_err(|found| Error::Refused(found.iter().map(ingest::Error::diagnostic).collect()))
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

/// Runs every log not yet accounted for, stores what it finds, and states the trends of the units it touched.
///
/// # Errors
/// [`Error::Refused`] when nothing could be run; [`Error::Store`] when the store fails in the middle:
/// what was committed before is intact, and the rest runs next time.
pub fn run(config: &Config, request: &Request, context: &Context<'_>) -> Result<RunSummary, Error> {
    let workers = workers(request);
    execute_run(config, request, context, workers, |worker_context, intent, writer, report| {
        worker_context.work(workers, intent, writer, report)
    })
}

/// A run from plan to summary; `work` processes the logs.
pub(crate) fn execute_run(
    config: &Config,
    request: &Request,
    context: &Context<'_>,
    workers: usize,
    work: impl FnOnce(
        &WorkerContext<'_>,
        &RunPlanRows,
        &mut Writer,
        &mut RunSummary,
    ) -> Result<Vec<assess::Unit>, Error>,
) -> Result<RunSummary, Error> {
    let clock = Instant::now();
    let installations = installations(config)?;
    // Before a store is made: a refused run leaves nothing behind.
    let found = discover::discover(config)?;
    let store = Store::create_or_open(config.store())?;
    let mut writer = acquire_lock(&store, context)?;
    let killed = writer.close_killed_runs()?;
    let plan = plan::plan(config, &installations, found, store.accounts()?, request);
    let started_utc = Timestamp::now();
    let mut report = RunSummary::begin(run_id(started_utc), started_utc, &plan, workers);
    report.cut_short = killed.into_iter().map(KilledRun::from).collect();
    let config_path = config.file.display().to_string();
    let to_do: Vec<LogRecord> =
        plan.work.iter().map(|work| summary::not_reached(work, &report.run_id)).collect();
    let bytes = plan.work.iter().filter_map(|w| w.stat.as_ref()).map(|s| s.size_bytes as u64).sum();
    (context.watch)(Event::Planned { logs: plan.work.len(), bytes });

    // Records that are computed again replace those by which the present states are known.
    let is_again = |work: &WorkItem| {
        work.before.is_some() && !matches!(work.why, WorkReason::Retry | WorkReason::Unfetched)
    };
    let before = if plan.work.iter().any(is_again) {
        assess::states(config, &installations, &store)?
    } else {
        assess::States::new()
    };
    let run_id = report.run_id.clone();
    let budget = MemoryBudget::new(config.document.run.memory_mib);
    let intent = RunPlanRows { run: report.row(context.program_version, &config_path, None), to_do };
    let worker_context = WorkerContext {
        config,
        installations: &installations,
        context,
        plan: &plan,
        run_id: &run_id,
        budget,
    };
    let touched = work(&worker_context, &intent, &mut writer, &mut report)?;

    (context.watch)(Event::Trends { units: touched.len() });
    let assessments = assess::assess_run(config, &installations, &store, &touched, &report.run_id, &before)?;
    report.add_assessments(assessments);
    if report.is_partial() {
        // A run that left logs out cannot determine which tails have no data.
        report.quiet.clear();
    }
    report.close(clock.elapsed().as_secs_f64());
    let exit_code = exit_code(&report, context.stop.load(Ordering::Relaxed));
    if store.needs_compaction()? {
        writer.compact()?;
    }
    writer.end_run(&report.row(context.program_version, &config_path, Some(exit_code)))?;
    Ok(report)
}

/// The store's lock, waited for in short turns so that a signal is heard meanwhile.
fn acquire_lock(store: &Store, context: &Context<'_>) -> Result<Writer, Error> {
    const TURN: Duration = Duration::from_millis(200);
    let deadline = context.wait.map(|wait| Instant::now() + wait);
    loop {
        let left = deadline.map(|d| d.saturating_duration_since(Instant::now()));
        match store.lock(&context.holder, left.map(|left| left.min(TURN))) {
            Err(store::Error::Held { .. })
                if left.is_some_and(|left| left > TURN) && !context.stop.load(Ordering::Relaxed) => {}
            ended => return Ok(ended?),
        }
    }
}

fn exit_code(report: &RunSummary, stopped: bool) -> i64 {
    match (stopped && report.not_reached > 0, report.errors.is_empty() && !report.has_mapping_fault()) {
        (true, _) => 130,
        (false, false) => 1,
        (false, true) => 0,
    }
}

/// Number of workers: one per core, also for one log, whose actuators are spread over them.
fn workers(request: &Request) -> usize {
    request
        .jobs
        .unwrap_or_else(|| std::thread::available_parallelism().map_or(1, std::num::NonZero::get))
        .max(1)
}

/// Names sort as the runs did.
fn run_id(started_utc: Timestamp) -> String {
    format!("{}-{:08x}", started_utc.strftime("%Y%m%dT%H%M%S%3fZ"), std::process::id())
}

/// Planned log rows of a run, which are stored before its first result.
pub(crate) struct RunPlanRows {
    run: RunRecord,
    to_do: Vec<LogRecord>,
}

impl RunPlanRows {
    /// Writes it down: before any other commit.
    pub(crate) fn state(&self, writer: &mut Writer) -> Result<(), Error> {
        Ok(writer.begin_run(&self.run, &self.to_do)?)
    }
}

/// Keeps freed memory for the next estimate. The GNU allocator returns blocks of 128 KiB or more to the
/// system as soon as they are freed, and each page costs a fault when it is allocated again, until a
/// larger block was freed: its size is the new threshold (mallopt(3), `M_MMAP_THRESHOLD`). Other systems: no effect.
fn raise_mmap_threshold() {
    const BOUND_BYTES: usize = 4 << 20;
    drop(std::hint::black_box(Vec::<u8>::with_capacity(BOUND_BYTES)));
}

/// Everything a worker may look at.
pub(crate) struct WorkerContext<'a> {
    pub(crate) config: &'a Config,
    pub(crate) installations: &'a Installations,
    pub(crate) context: &'a Context<'a>,
    pub(crate) plan: &'a Plan,
    pub(crate) run_id: &'a str,
    pub(crate) budget: MemoryBudget,
}

impl WorkerContext<'_> {
    /// Lets the workers loose and writes what they bring; returns the units whose records changed.
    fn work(
        &self,
        workers: usize,
        intent: &RunPlanRows,
        writer: &mut Writer,
        report: &mut RunSummary,
    ) -> Result<Vec<assess::Unit>, Error> {
        raise_mmap_threshold();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(workers).build()?;
        let (next, taken) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let halt = AtomicBool::new(false);
        let (sender, receiver) = channel();
        std::thread::scope(|scope| {
            let (next, taken, halt) = (&next, &taken, &halt);
            scope.spawn(move || {
                pool.scope(|pool_scope| {
                    for _ in 0..workers {
                        let sender = sender.clone();
                        pool_scope.spawn(move |_| self.worker_loop(next, taken, halt, &sender));
                    }
                });
            });
            // The workers read meanwhile; what they bring waits.
            let written = intent.state(writer).and_then(|()| self.write(&receiver, writer, report));
            // A store that fails must stop the workers early.
            halt.store(written.is_err(), Ordering::Relaxed);
            drop(receiver);
            // Logs are taken in order, so those after the last one taken were not reached.
            let reached = taken.load(Ordering::Relaxed).min(self.plan.work.len());
            report.not_reached_logs =
                self.plan.work[reached..].iter().map(|work| work.shown.clone()).collect();
            report.not_reached = report.not_reached_logs.len();
            written
        })
    }

    /// One worker: takes the next log until there is none, or until it is stopped.
    fn worker_loop(
        &self,
        next: &AtomicUsize,
        taken: &AtomicUsize,
        halt: &AtomicBool,
        done: &Sender<LogOutcomeData>,
    ) {
        while !(halt.load(Ordering::Relaxed) || self.context.stop.load(Ordering::Relaxed)) {
            let Some(work) = self.plan.work.get(next.fetch_add(1, Ordering::Relaxed)) else { return };
            taken.fetch_add(1, Ordering::Relaxed);
            (self.context.watch)(Event::Started { log: work.shown.clone() });
            let finished = self.process_log(work);
            (self.context.watch)(finished.event(work));
            if done.send(finished).is_err() {
                return;
            }
        }
    }

    /// One log; a panic in it is an error row like any other.
    pub(crate) fn process_log(&self, work: &WorkItem) -> LogOutcomeData {
        let clock = Instant::now();
        let done = catch_panic(&work.shown, || Ok(self.open(work)));
        let done = done.unwrap_or_else(|diagnostic| self.failed(work, diagnostic));
        match done {
            LogOutcomeData::Read { mut account, records, diagnostics } => {
                account.duration_s = clock.elapsed().as_secs_f64();
                LogOutcomeData::Read { account, records, diagnostics }
            }
            same @ LogOutcomeData::Same(_) => same,
        }
    }

    fn failed(&self, work: &WorkItem, diagnostic: Diagnostic) -> LogOutcomeData {
        let mut account = summary::of_log(work, self.run_id);
        account.config_digest = Some(digest_without_identity(self.config, self.installations));
        summary::complain(&mut account, std::slice::from_ref(&diagnostic));
        LogOutcomeData::Read {
            account: Box::new(account),
            records: Vec::new(),
            diagnostics: vec![diagnostic],
        }
    }

    fn open(&self, work: &WorkItem) -> LogOutcomeData {
        if let Some(fault) = &work.fault {
            return self.failed(work, fault.clone());
        }
        let opened = match FlightLog::open(&work.files, &work.shown, self.config, self.installations) {
            Ok(opened) => opened,
            Err(diagnostic) => return self.failed(work, diagnostic),
        };
        let flight = opened.flight();
        let names = opened.position_names();
        let mut account = summary::of_log(work, self.run_id);
        account.config_digest = Some(config_digest(self.config, self.installations, &flight, &names));
        account.log_digest = Some(opened.digest.clone());
        account.tail_number = Some(flight.tail_number.to_string());
        account.flight_id = Some(flight.flight_id.to_string());
        account.departure_utc = Some(flight.departure_utc);
        account.positions = names.iter().map(ToString::to_string).collect();
        if let Some(already_recorded) = self.already_recorded(work, &account) {
            (account.estimated, account.refused) = already_recorded;
            account.outcome = LogOutcome::Known;
            return LogOutcomeData::Same(Box::new(account));
        }
        self.read(&opened, account)
    }

    /// The records that are known of this content under these settings: its own, those of a log that
    /// is gone, whose place it takes, or none, when another log that is there speaks for them.
    pub(crate) fn already_recorded(&self, work: &WorkItem, account: &LogRecord) -> Option<(i64, i64)> {
        let digests = plan::digests(account)?;
        if matches!(work.why, WorkReason::Asked | WorkReason::OwnerGone) {
            return None;
        }
        let own = work.before.as_ref().filter(|before| plan::digests(before).as_ref() == Some(&digests));
        own.map(|before| (before.estimated, before.refused))
            .or_else(|| self.plan.here.contains(&digests).then_some((0, 0)))
            .or_else(|| self.plan.gone.get(&digests).copied())
    }

    fn read(&self, opened: &FlightLog, mut account: LogRecord) -> LogOutcomeData {
        let stamp = ProvenanceStamp {
            run_id: self.run_id.to_owned(),
            program_version: self.context.program_version.to_owned(),
            processed_utc: Timestamp::now(),
        };
        let (records, diagnostics) = self.records(opened, &stamp);
        let refused = records.iter().filter(|r| r.estimate.status == Status::Refused).count();
        account.refused = refused as i64;
        account.estimated = (records.len() - refused) as i64;
        summary::complain(&mut account, &diagnostics);
        LogOutcomeData::Read { account: Box::new(account), records, diagnostics }
    }

    /// The records of a log: its actuators are spread over workers that have no log left to take.
    fn records(&self, opened: &FlightLog, stamp: &ProvenanceStamp) -> (Vec<GapRecord>, Vec<Diagnostic>) {
        let actuators: Vec<_> = opened.actuators(self.installations).collect();
        let bytes = MemoryBudget::actuator_bytes(opened.rows());
        let process_log = |at: &&ActuatorColumns| {
            let _held = self.budget.take(bytes);
            opened.record(at, self.config, self.installations, stamp)
        };
        let (mut records, mut diagnostics) = (Vec::new(), Vec::new());
        for done in actuators.par_iter().with_max_len(1).map(process_log).collect::<Vec<_>>() {
            match done {
                Ok(record) => records.push(record),
                Err(diagnostic) => diagnostics.push(diagnostic),
            }
        }
        (records, diagnostics)
    }

    /// The writer's side: gathers, settles who owns a flight, commits.
    fn write(
        &self,
        done: &Receiver<LogOutcomeData>,
        writer: &mut Writer,
        report: &mut RunSummary,
    ) -> Result<Vec<assess::Unit>, Error> {
        let mut book = OwnershipLedger::of(self.plan, self.config, self.installations);
        while let Ok(first) = done.recv() {
            let gathered = collect_batch(first, done).into_iter();
            let results: Vec<LogResult> = gathered.flat_map(|done| book.resolve(done, report)).collect();
            if !results.is_empty() {
                writer.commit(&results)?;
                (self.context.watch)(Event::Stored { logs: results.len() });
            }
        }
        report.quiet = summary::quiet(book.accounts(), self.config.document.trend.stale_after_days);
        Ok(book.touched.into_iter().collect())
    }
}

/// What is finished within a short while, or nothing but the first when nothing follows.
fn collect_batch(first: LogOutcomeData, done: &Receiver<LogOutcomeData>) -> Vec<LogOutcomeData> {
    let deadline = Instant::now() + BATCH_WAIT;
    let mut gathered = vec![first];
    while gathered.len() < BATCH_LOGS {
        let left = deadline.saturating_duration_since(Instant::now());
        match done.recv_timeout(left) {
            Ok(next) => gathered.push(next),
            Err(_) => break,
        }
    }
    gathered
}
