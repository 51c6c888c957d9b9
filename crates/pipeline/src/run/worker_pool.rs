//! Worker pool with a time limit for each log, so that one log cannot block the end of a run.
//!
//! No thread can be ended from outside. A log that takes longer than `run.log_timeout_s` is therefore reported as an
//! error and its workers are abandoned: they end with the process. New workers take the remaining logs, and the other
//! logs of the abandoned workers: a worker that waits for the actuators of its log processes those of other logs
//! meanwhile, so the log with a step in progress is the late one, and the logs without one wait for it.

use std::collections::{BTreeMap, VecDeque};
use std::ops::Range;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use records::Diagnostic;

use crate::error::Error;
use crate::logs::plan::{Plan, WorkItem};
use crate::run::event::Event;
use crate::run::flight_ownership::LogOutcomeData;
use crate::run::memory_budget::MemoryBudget;
use crate::run::time_limit::log_timeout;

/// Interval at which the time limits are checked while no worker reports.
const TURN: Duration = Duration::from_millis(100);

/// Time for logs in progress to finish after an interrupt: a signal is answered within two seconds.
const STOP_GRACE: Duration = Duration::from_millis(1500);

/// Abandoned workers still use processor time: a run in which more logs than this pass their limit ends.
const MAX_ABANDONED: usize = 16;

/// What does one log, by its index in the plan.
pub(crate) type ProcessLog = dyn Fn(usize, &MemoryBudget, &StepCount) -> LogOutcomeData + Send + Sync;

/// How many steps of a log (its opening, an actuator) threads are at just now.
#[derive(Debug, Default)]
pub(crate) struct StepCount(AtomicUsize);

/// A step in progress until it is dropped.
pub(crate) struct StepGuard<'a>(&'a StepCount);

impl StepCount {
    pub(crate) fn begin(&self) -> StepGuard<'_> {
        self.0.fetch_add(1, Ordering::Relaxed);
        StepGuard(self)
    }
}

impl Drop for StepGuard<'_> {
    fn drop(&mut self) {
        self.0.0.fetch_sub(1, Ordering::Relaxed);
    }
}

/// What a worker reports; the order of one worker's messages is kept.
enum Message {
    Started { log: usize, generation: usize, at: Instant },
    Finished { log: usize, outcome: Box<LogOutcomeData> },
    Ended { generation: usize },
}

/// What comes next.
pub(crate) enum Next {
    /// What came of a log.
    Log(Box<LogOutcomeData>),
    /// Nothing until the deadline.
    Nothing,
    /// Every log is finished or will not be reached.
    End,
}

/// What all workers share; owned, since an abandoned worker outlives the run.
struct Shared {
    process_log: Box<ProcessLog>,
    steps: Vec<StepCount>,
    /// Logs that no worker has taken: those that never failed, and the others.
    rest: Mutex<[Range<usize>; 2]>,
    /// Whether a log passed its limit: the smallest logs come first then, as the least likely to do so.
    has_late: AtomicBool,
    /// Logs to be done again, since their worker may wait for an abandoned one.
    again: Mutex<VecDeque<usize>>,
    is_stopped: AtomicBool,
    /// Workers of an earlier generation take no log.
    generation: AtomicUsize,
}

impl Shared {
    fn take(&self, generation: usize) -> Option<usize> {
        if self.is_stopped.load(Ordering::Relaxed) || self.generation.load(Ordering::Relaxed) != generation {
            return None;
        }
        let again = self.again.lock().unwrap_or_else(PoisonError::into_inner).pop_front();
        again.or_else(|| {
            let mut rest = self.rest.lock().unwrap_or_else(PoisonError::into_inner);
            let [sound, failed] = &mut *rest;
            let is_late = self.has_late.load(Ordering::Relaxed);
            if is_late { sound.next_back() } else { sound.next() }.or_else(|| failed.next())
        })
    }

    /// One worker: one log at a time, in the threads that all workers share for actuators. A thread that waits for an
    /// actuator may take a log of another worker meanwhile, but never that worker's loop.
    fn worker_loop(
        &self,
        generation: usize,
        actuators: &rayon::ThreadPool,
        budget: &MemoryBudget,
        done: &Sender<Message>,
    ) {
        let _ended = EndMessage { generation, done };
        while let Some(log) = self.take(generation) {
            let started = Message::Started { log, generation, at: Instant::now() };
            if done.send(started).is_err() {
                return;
            }
            let outcome = actuators.install(|| Box::new((self.process_log)(log, budget, &self.steps[log])));
            if done.send(Message::Finished { log, outcome }).is_err() {
                return;
            }
        }
    }
}

/// Reports the end of a worker, also by a panic.
struct EndMessage<'a> {
    generation: usize,
    done: &'a Sender<Message>,
}

impl Drop for EndMessage<'_> {
    fn drop(&mut self) {
        // The run may be over already.
        let _ = self.done.send(Message::Ended { generation: self.generation });
    }
}

/// A log in progress.
struct InProgress {
    since: Instant,
    generation: usize,
}

/// What the workers of a run are started for.
pub(crate) struct PoolSettings<'a> {
    pub(crate) plan: &'a Plan,
    pub(crate) workers: usize,
    /// Time limit of one log.
    pub(crate) limit: Duration,
    pub(crate) memory_mib: Option<u64>,
    pub(crate) stop: &'a AtomicBool,
    pub(crate) watch: &'a (dyn Fn(Event) + Sync),
    /// The outcome of a log that was given up after some seconds.
    pub(crate) fail: &'a dyn Fn(&WorkItem, Diagnostic, f64) -> LogOutcomeData,
}

/// The workers of a run, seen from the thread that writes.
pub(crate) struct WorkerPool<'a> {
    settings: PoolSettings<'a>,
    shared: Arc<Shared>,
    messages: (Sender<Message>, Receiver<Message>),
    in_progress: BTreeMap<usize, InProgress>,
    /// Workers of the current generation that have not ended.
    running: usize,
    is_finished: Vec<bool>,
    abandoned: usize,
    stop_seen: Option<Instant>,
}

impl<'a> WorkerPool<'a> {
    /// Starts the workers.
    ///
    /// # Errors
    /// When threads cannot be started.
    pub(crate) fn start(settings: PoolSettings<'a>, process_log: Box<ProcessLog>) -> Result<Self, Error> {
        let logs = settings.plan.work.len();
        let sound = settings.plan.work.partition_point(|work| !work.failed_before());
        let shared = Shared {
            process_log,
            steps: (0..logs).map(|_| StepCount::default()).collect(),
            rest: Mutex::new([0..sound, sound..logs]),
            has_late: AtomicBool::new(false),
            again: Mutex::default(),
            is_stopped: AtomicBool::new(false),
            generation: AtomicUsize::new(0),
        };
        let mut pool = Self {
            settings,
            shared: Arc::new(shared),
            messages: channel(),
            in_progress: BTreeMap::new(),
            running: 0,
            is_finished: vec![false; logs],
            abandoned: 0,
            stop_seen: None,
        };
        pool.start_generation()?;
        Ok(pool)
    }

    /// Workers with threads and a memory budget of their own.
    fn start_generation(&mut self) -> Result<(), Error> {
        let workers = self.settings.workers;
        let actuators = Arc::new(rayon::ThreadPoolBuilder::new().num_threads(workers).build()?);
        let budget = Arc::new(MemoryBudget::new(self.settings.memory_mib));
        let generation = self.shared.generation.load(Ordering::Relaxed);
        self.running = workers;
        for _ in 0..workers {
            let (shared, sender) = (Arc::clone(&self.shared), self.messages.0.clone());
            let (actuators, budget) = (Arc::clone(&actuators), Arc::clone(&budget));
            std::thread::Builder::new()
                .spawn(move || shared.worker_loop(generation, &actuators, &budget, &sender))
                .map_err(Error::Thread)?;
        }
        Ok(())
    }

    /// Waits for what comes of the next log, until a deadline if there is one.
    ///
    /// # Errors
    /// When abandoned workers cannot be replaced.
    pub(crate) fn next(&mut self, until: Option<Instant>) -> Result<Next, Error> {
        loop {
            let now = Instant::now();
            if self.settings.stop.load(Ordering::Relaxed) {
                self.shared.is_stopped.store(true, Ordering::Relaxed);
                self.stop_seen.get_or_insert(now);
            }
            if self.running == 0 && self.in_progress.is_empty() {
                return Ok(Next::End);
            }
            let turn = until.map_or(TURN, |until| until.saturating_duration_since(now).min(TURN));
            match self.messages.1.recv_timeout(turn) {
                Ok(Message::Started { log, generation, at }) => self.started(log, generation, at),
                Ok(Message::Finished { log, outcome }) => {
                    // Of a log that was done twice, or abandoned, only the first outcome counts.
                    if self.in_progress.remove(&log).is_some() {
                        return Ok(self.finished(log, outcome));
                    }
                }
                Ok(Message::Ended { generation }) => {
                    let is_current = generation == self.shared.generation.load(Ordering::Relaxed);
                    self.running -= usize::from(is_current);
                }
                // `self` holds a sender, so the channel is never closed.
                Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => {
                    if self.stop_seen.is_some_and(|seen| seen.elapsed() > STOP_GRACE) {
                        return Ok(Next::End);
                    }
                    if let Some(log) = self.overdue() {
                        return self.abandon(log);
                    }
                    if until.is_some_and(|until| until <= Instant::now()) {
                        return Ok(Next::Nothing);
                    }
                }
            }
        }
    }

    fn started(&mut self, log: usize, generation: usize, since: Instant) {
        if self.is_finished[log] {
            return;
        }
        if self.in_progress.insert(log, InProgress { since, generation }).is_none() {
            (self.settings.watch)(Event::Started { log: self.settings.plan.work[log].log_path.clone() });
        }
    }

    fn finished(&mut self, log: usize, outcome: Box<LogOutcomeData>) -> Next {
        self.is_finished[log] = true;
        (self.settings.watch)(outcome.event(&self.settings.plan.work[log]));
        Next::Log(outcome)
    }

    /// A log that has passed its limit; searched when all messages are read. One that only waits for another log
    /// is late when it has waited twice as long.
    fn overdue(&self) -> Option<usize> {
        let is_late = |(log, held): &(&usize, &InProgress)| {
            let is_at_work = self.shared.steps[**log].0.load(Ordering::Relaxed) > 0;
            held.since.elapsed() > self.settings.limit.saturating_mul(if is_at_work { 1 } else { 2 })
        };
        self.in_progress.iter().find(is_late).map(|(log, _)| *log)
    }

    /// Reports a log as an error and replaces the workers of its generation.
    fn abandon(&mut self, log: usize) -> Result<Next, Error> {
        let late = self.in_progress.remove(&log);
        self.abandoned += 1;
        self.shared.has_late.store(true, Ordering::Relaxed);
        let current = self.shared.generation.load(Ordering::Relaxed);
        if self.abandoned >= MAX_ABANDONED {
            self.shared.is_stopped.store(true, Ordering::Relaxed);
            self.stop_seen.get_or_insert_with(Instant::now);
        } else if late.is_some_and(|late| late.generation == current) {
            let mut again = self.shared.again.lock().unwrap_or_else(PoisonError::into_inner);
            for (other, held) in self.in_progress.iter_mut().filter(|(_, held)| held.generation == current) {
                again.push_back(*other);
                *held = InProgress { since: Instant::now(), generation: current + 1 };
            }
            drop(again);
            self.shared.generation.store(current + 1, Ordering::Relaxed);
            self.start_generation()?;
        }
        let work = &self.settings.plan.work[log];
        let diagnostic = log_timeout(&work.log_path, self.settings.limit.as_secs_f64());
        let outcome = (self.settings.fail)(work, diagnostic, self.settings.limit.as_secs_f64());
        Ok(self.finished(log, Box::new(outcome)))
    }

    /// Logs without an outcome, by name.
    pub(crate) fn not_reached(&self) -> Vec<String> {
        let logs = self.settings.plan.work.iter().zip(&self.is_finished);
        logs.filter(|(_, is_finished)| !**is_finished).map(|(work, _)| work.log_path.clone()).collect()
    }
}

impl Drop for WorkerPool<'_> {
    /// A store that fails must not keep the workers reading.
    fn drop(&mut self) {
        self.shared.is_stopped.store(true, Ordering::Relaxed);
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]
mod tests {
    use super::*;
    use crate::logs::plan::WorkReason;
    use crate::run::summary::not_reached;

    /// A worker that waits for an actuator helps other workers by a log or two, and does not do the rest of the run.
    #[test]
    fn no_log_waits_for_the_rest_of_the_run() {
        const LOGS: usize = 60;
        let work = |k: usize| WorkItem {
            files: ingest::LogFiles::one(format!("{k}.parquet")),
            fault: None,
            log_path: k.to_string(),
            stat: None,
            why: WorkReason::New,
            before: None,
        };
        let plan = Plan { work: (0..LOGS).map(work).collect(), ..Plan::default() };
        for _ in 0..5 {
            let longest = Arc::new(Mutex::new(Duration::ZERO));
            let (accounts, seen) = (plan.work.clone(), Arc::clone(&longest));
            let process_log = move |log: usize, _: &MemoryBudget, _: &StepCount| {
                let begun = Instant::now();
                let actuator = || std::thread::sleep(Duration::from_millis(2));
                rayon::join(actuator, || rayon::join(actuator, actuator));
                let mut longest = seen.lock().unwrap();
                *longest = begun.elapsed().max(*longest);
                LogOutcomeData::Same(Box::new(not_reached(&accounts[log], "run")))
            };
            let fail = |_: &WorkItem, _: Diagnostic, _: f64| unreachable!("no log is late");
            let settings = PoolSettings {
                plan: &plan,
                workers: 2,
                limit: Duration::from_mins(1),
                memory_mib: None,
                stop: &AtomicBool::new(false),
                watch: &|_| {},
                fail: &fail,
            };
            let begun = Instant::now();
            let mut pool = WorkerPool::start(settings, Box::new(process_log)).unwrap();
            let mut done = 0;
            while let Next::Log(_) = pool.next(None).unwrap() {
                done += 1;
            }
            let (longest, whole) = (*longest.lock().unwrap(), begun.elapsed());
            assert_eq!(done, LOGS);
            assert!(4 * longest < whole, "a log took {longest:?} of {whole:?}");
        }
    }
}
