//! Worker pool with a time limit for each log, so that one log cannot block the end of a run.
//!
//! No thread can be ended from outside. A log that takes longer than `run.log_timeout_s` is therefore reported as an
//! error, and the threads of its pool are abandoned: they go on at the lowest priority until the process ends. A new
//! pool takes the remaining logs, and the other logs of the abandoned pool: a worker that waits for the actuators of
//! its log processes those of other logs meanwhile, so the log with a step in progress is the late one, and the logs
//! without one wait for it.

use std::collections::{BTreeMap, VecDeque};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use records::Diagnostic;

use crate::logs::plan::{Plan, WorkItem};
use crate::run::flight_ownership::ProcessedLog;
use crate::run::memory_budget::MemoryBudget;
use crate::run::time_limit::log_timeout;
use crate::{Error, Event};

/// Interval at which the time limits are checked while no worker reports.
const TURN: Duration = Duration::from_millis(100);

/// Time for logs in progress to finish after an interrupt: a signal is answered within two seconds.
const STOP_GRACE: Duration = Duration::from_millis(1500);

/// Pools abandoned in a row, without a finished log between, after which a run ends: their disk or share is gone.
const MAX_ABANDONED_IN_A_ROW: usize = 16;

/// Logs that pass their limit in one run at most: what their threads hold is free only when the process ends.
const MAX_LATE: usize = 256;

pub(crate) type ProcessLog = dyn Fn(usize, &MemoryBudget, &StepCount) -> ProcessedLog + Send + Sync;

/// How many steps of a log (its opening, an actuator) threads are at just now.
#[derive(Debug, Default)]
pub(crate) struct StepCount(Arc<()>);

impl StepCount {
    /// Begins a step, which is in progress until the returned value is dropped.
    pub(crate) fn begin(&self) -> Arc<()> {
        Arc::clone(&self.0)
    }
}

/// What a worker reports; the order of one worker's messages is kept.
enum Message {
    Started { log: usize, at: Instant },
    Finished { log: usize, outcome: Box<ProcessedLog> },
}

/// What the threads of a pool share; owned, since an abandoned pool outlives the run.
struct Shared {
    process_log: Arc<ProcessLog>,
    steps: Vec<StepCount>,
    /// Logs that no worker has taken.
    rest: Mutex<VecDeque<usize>>,
    budget: MemoryBudget,
    /// Identifiers of the pool's threads where the operating system has a priority for each.
    threads: Mutex<Vec<i32>>,
}

impl Shared {
    /// Takes the logs that no worker has begun: the workers end after those in progress.
    fn stop(&self) -> VecDeque<usize> {
        std::mem::take(&mut *self.rest.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// One worker: one log at a time, in the threads that all workers share for actuators. A thread that waits for an
    /// actuator may take a log of another worker meanwhile, but never that worker's loop.
    fn worker_loop(&self, actuators: &rayon::ThreadPool, done: &Sender<Message>) {
        let take = || self.rest.lock().unwrap_or_else(PoisonError::into_inner).pop_front();
        while let Some(log) = take() {
            if done.send(Message::Started { log, at: Instant::now() }).is_err() {
                return;
            }
            let outcome =
                actuators.install(|| Box::new((self.process_log)(log, &self.budget, &self.steps[log])));
            if done.send(Message::Finished { log, outcome }).is_err() {
                return;
            }
        }
    }

    fn register_thread(&self) {
        let id = std::fs::read_link("/proc/thread-self").ok();
        let id = id.and_then(|path| path.file_name()?.to_str()?.parse::<i32>().ok());
        self.threads.lock().unwrap_or_else(PoisonError::into_inner).extend(id);
    }

    /// Leaves the processor to the threads of other pools.
    fn lower_priority(&self) {
        for thread in self.threads.lock().unwrap_or_else(PoisonError::into_inner).iter() {
            // A thread that has ended has none.
            #[cfg(unix)]
            let _ = rustix::process::setpriority_process(rustix::process::Pid::from_raw(*thread), 19);
        }
    }
}

struct Workers {
    shared: Arc<Shared>,
    /// Closed when every worker has ended.
    messages: Receiver<Message>,
}

impl Workers {
    fn start(settings: &PoolSettings<'_>, rest: VecDeque<usize>) -> Result<Self, Error> {
        let shared = Arc::new(Shared {
            process_log: Arc::clone(&settings.process_log),
            steps: settings.plan.work.iter().map(|_| StepCount::default()).collect(),
            rest: Mutex::new(rest),
            budget: MemoryBudget::new(settings.memory_mib),
            threads: Mutex::default(),
        });
        let of_threads = Arc::clone(&shared);
        let actuators = rayon::ThreadPoolBuilder::new()
            .num_threads(settings.workers)
            .start_handler(move |_| of_threads.register_thread())
            .build()?;
        let actuators = Arc::new(actuators);
        let (sender, messages) = channel();
        for _ in 0..settings.workers {
            let (shared, actuators, sender) = (Arc::clone(&shared), Arc::clone(&actuators), sender.clone());
            std::thread::Builder::new()
                .spawn(move || shared.worker_loop(&actuators, &sender))
                .map_err(Error::Thread)?;
        }
        Ok(Self { shared, messages })
    }
}

pub(crate) struct PoolSettings<'a> {
    pub(crate) process_log: Arc<ProcessLog>,
    pub(crate) plan: &'a Plan,
    pub(crate) workers: usize,
    pub(crate) limit: Duration,
    pub(crate) memory_mib: Option<u64>,
    pub(crate) stop: &'a AtomicBool,
    pub(crate) watch: &'a (dyn Fn(Event) + Sync),
    /// The outcome of a log that was given up.
    pub(crate) fail: &'a dyn Fn(&WorkItem, Diagnostic) -> ProcessedLog,
}

/// The workers of a run, seen from the thread that writes.
pub(crate) struct WorkerPool<'a> {
    settings: PoolSettings<'a>,
    workers: Workers,
    /// Logs in progress, and since when.
    in_progress: BTreeMap<usize, Instant>,
    /// Logs that passed their limit and are not reported yet.
    late: Vec<usize>,
    late_logs: usize,
    abandoned_in_a_row: usize,
    stop_seen: Option<Instant>,
}

impl<'a> WorkerPool<'a> {
    pub(crate) fn start(settings: PoolSettings<'a>) -> Result<Self, Error> {
        let workers = Workers::start(&settings, (0..settings.plan.work.len()).collect())?;
        Ok(Self {
            settings,
            workers,
            in_progress: BTreeMap::new(),
            late: Vec::new(),
            late_logs: 0,
            abandoned_in_a_row: 0,
            stop_seen: None,
        })
    }

    /// Waits for what comes of the next log, until a deadline if there is one; none after it, and when every log is finished
    /// or will not be reached.
    ///
    /// # Errors
    /// When abandoned workers cannot be replaced.
    pub(crate) fn next(&mut self, until: Option<Instant>) -> Result<Option<Box<ProcessedLog>>, Error> {
        loop {
            if let Some(log) = self.late.pop() {
                let work = &self.settings.plan.work[log];
                let limit_s = self.settings.limit.as_secs_f64();
                let mut outcome = (self.settings.fail)(work, log_timeout(&work.log_path, limit_s));
                outcome.account.duration_s = limit_s;
                (self.settings.watch)(outcome.event(work));
                return Ok(Some(Box::new(outcome)));
            }
            let now = Instant::now();
            if self.settings.stop.load(Ordering::Relaxed) {
                self.stop();
            }
            let turn = until.map_or(TURN, |until| until.saturating_duration_since(now).min(TURN));
            match self.workers.messages.recv_timeout(turn) {
                Ok(Message::Started { log, at }) => {
                    self.in_progress.insert(log, at);
                    let log = self.settings.plan.work[log].log_path.clone();
                    (self.settings.watch)(Event::Started { log });
                }
                Ok(Message::Finished { log, outcome }) => {
                    if self.in_progress.remove(&log).is_some() {
                        self.abandoned_in_a_row = 0;
                        (self.settings.watch)(outcome.event(&self.settings.plan.work[log]));
                        return Ok(Some(outcome));
                    }
                }
                Err(RecvTimeoutError::Disconnected) => return Ok(None),
                Err(RecvTimeoutError::Timeout) => {
                    if self.stop_seen.is_some_and(|seen| seen.elapsed() > STOP_GRACE) {
                        return Ok(None);
                    }
                    self.abandon_late()?;
                    if until.is_some_and(|until| until <= Instant::now()) {
                        return Ok(None);
                    }
                }
            }
        }
    }

    fn stop(&mut self) {
        self.stop_seen.get_or_insert_with(Instant::now);
        self.workers.shared.stop();
    }

    /// Looks for logs that have passed their limit, when all messages are read, and replaces their workers. A log that
    /// only waits for another log is late when it has waited twice as long.
    fn abandon_late(&mut self) -> Result<(), Error> {
        let limit = self.settings.limit;
        let over = |log: usize, since: Instant| {
            let is_at_work = Arc::strong_count(&self.workers.shared.steps[log].0) > 1;
            since.elapsed().checked_sub(limit.saturating_mul(if is_at_work { 1 } else { 2 }))
        };
        let over: Vec<(usize, Duration)> =
            self.in_progress.iter().filter_map(|(log, since)| Some((*log, over(*log, *since)?))).collect();
        // Logs that began together are late together, within some turns.
        let patience = (limit / 4).min(5 * TURN);
        if over.iter().all(|(_, by)| *by < patience) {
            return Ok(());
        }
        self.late = over.into_iter().map(|(log, _)| log).collect();
        self.late_logs += self.late.len();
        self.abandoned_in_a_row += 1;
        self.in_progress.retain(|log, _| !self.late.contains(log));
        let rest = self.workers.shared.stop();
        self.workers.shared.lower_priority();
        if self.stop_seen.is_some()
            || self.abandoned_in_a_row >= MAX_ABANDONED_IN_A_ROW
            || self.late_logs >= MAX_LATE
        {
            self.stop();
            return Ok(());
        }
        let mut rest: Vec<usize> = self.in_progress.keys().copied().chain(rest).collect();
        // Logs that failed before stay last. The others are mixed by a multiplicative hash (Knuth 1998, section 6.4), so
        // that logs of similar size, which may all be late, do not follow one another.
        let mixed = |log: &usize| (*log as u32).wrapping_mul(0x9E37_79B9);
        rest.sort_by_key(|log| (self.settings.plan.work[*log].failed_before(), mixed(log)));
        self.in_progress.clear();
        self.workers = Workers::start(&self.settings, rest.into())?;
        Ok(())
    }
}

impl Drop for WorkerPool<'_> {
    /// A store that fails must not keep the workers reading.
    fn drop(&mut self) {
        self.workers.shared.stop();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::logs::plan::WorkReason;
    use crate::run::summary::not_reached;

    /// A run of as many logs by two workers with a time limit, and how many logs are finished and late.
    fn run_pool(
        logs: usize,
        limit: Duration,
        process: impl Fn(usize, &StepCount) + Send + Sync + 'static,
    ) -> (usize, usize) {
        let work = |k: usize| WorkItem {
            files: ingest::LogFiles::one(format!("{k}.parquet")),
            fault: None,
            log_path: k.to_string(),
            stat: None,
            why: WorkReason::New,
            before: None,
        };
        let plan = Plan { work: (0..logs).map(work).collect(), ..Plan::default() };
        let outcome = |work: &WorkItem| ProcessedLog::without_records(not_reached(work, "run"), Vec::new());
        let accounts = plan.work.clone();
        let process_log = move |log: usize, _: &MemoryBudget, steps: &StepCount| {
            process(log, steps);
            outcome(&accounts[log])
        };
        let late = std::cell::Cell::new(0);
        let settings = PoolSettings {
            process_log: Arc::new(process_log),
            plan: &plan,
            workers: 2,
            limit,
            memory_mib: None,
            stop: &AtomicBool::new(false),
            watch: &|_| {},
            fail: &|work, _| {
                late.set(late.get() + 1);
                outcome(work)
            },
        };
        let mut pool = WorkerPool::start(settings).unwrap();
        let mut outcomes = 0;
        while pool.next(None).unwrap().is_some() {
            outcomes += 1;
        }
        (outcomes - late.get(), late.get())
    }

    thread_local! {
        /// Logs that this thread has begun.
        static BEGUN: std::cell::Cell<usize> = const { std::cell::Cell::new(0) };
    }

    /// A worker that waits for an actuator helps other workers by a log or two, and does not do the rest of the run. Logs are
    /// counted, since their times depend on what else the machine does.
    #[test]
    fn no_log_waits_for_the_rest_of_the_run() {
        for _ in 0..5 {
            let most = Arc::new(Mutex::new(0));
            let seen = Arc::clone(&most);
            let process = move |_, _: &StepCount| {
                let before = BEGUN.replace(BEGUN.get() + 1);
                let actuator = || std::thread::sleep(Duration::from_millis(2));
                rayon::join(actuator, || rayon::join(actuator, actuator));
                let mut most = seen.lock().unwrap();
                *most = (BEGUN.get() - before - 1).max(*most);
            };
            assert_eq!(run_pool(60, Duration::from_mins(1), process), (60, 0));
            let most = *most.lock().unwrap();
            assert!(most < 15, "a log waited for {most} of 60");
        }
    }

    /// A run finishes every sound log next to 20 that never end and keep a processor busy: the largest, or some of the
    /// largest and of the smallest. Logs of a share that is gone end the run. On a busy machine a sound log may be late, too:
    /// then it gets more time.
    #[test]
    fn logs_that_never_end_keep_no_other_log_from_its_turn() {
        let cases: [fn(usize) -> bool; 2] = [|log| log < 20, |log| !(10..40).contains(&log)];
        for is_endless in cases {
            let process = move |log: usize, steps: &StepCount| {
                let _step = steps.begin();
                let begun = Instant::now();
                while is_endless(log) && begun.elapsed() < Duration::from_secs(20) {}
                std::thread::sleep(Duration::from_millis(5));
            };
            let finishes_all = |ms| run_pool(50, Duration::from_millis(ms), process) == (30, 20);
            assert!([150, 1_000, 4_000].into_iter().any(finishes_all), "a sound log was late");
        }
        let (finished, late) = run_pool(100, Duration::from_millis(20), |_, _| {
            loop {
                std::thread::park();
            }
        });
        assert!(finished == 0 && (16..=32).contains(&late), "{late} late");
    }
}
