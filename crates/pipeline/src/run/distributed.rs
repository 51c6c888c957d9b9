//! Distributed run: logs are processed on the machines of an engine such as Spark.
//!
//! This process plans and stores. A log is a [`Task`]; [`process_task`] processes it on the engine and returns one text.
//!
//! Engines run a task at least once, and may lose it. The first result of a task counts; records replace those with the
//! same key; a log without a result is *not reached*, and the next run processes it. Only this process writes, so the
//! guarantees of the store hold.

use std::collections::HashMap;

use job::Config;
use records::Installations;
use serde::{Deserialize, Serialize};

use crate::logs::plan::{Plan, Request, WorkItem};
use crate::run::flight_ownership::ProcessedLog;
use crate::run::memory_budget::MemoryBudget;
use crate::run::scheduler::{Context, RunInputs, WorkerContext, execute_run};
use crate::run::summary::RunSummary;
use crate::run::worker_pool::StepCount;
use crate::{Error, Event};

/// One log to be processed by the engine.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Task {
    /// The log, with its status before.
    pub work: WorkItem,
    /// The run it is done for.
    pub run_id: String,
}

/// Processes tasks and returns their results in any order: texts that [`process_task`] returned.
pub type Engine<'a> = dyn FnMut(&[Task]) -> Result<Vec<String>, String> + 'a;

/// Processes one log on one thread, since the engine gives a task one core. The result is a JSON text with the log's
/// status, records and errors; a log in error has a result like any other.
///
/// # Errors
/// When a thread cannot be started, or the result cannot be written as JSON.
pub fn process_task(
    config: &Config,
    installations: &Installations,
    task: &Task,
    program_version: &str,
) -> Result<String, Error> {
    let unidentified = job::flight_log::digest_without_identity(config, installations);
    let inputs = RunInputs {
        config: config.clone(),
        installations: installations.clone(),
        plan: Plan { unidentified, ..Plan::default() },
        run_id: task.run_id.clone(),
        program_version: program_version.to_owned(),
    };
    let (budget, steps) = (MemoryBudget::new(None), StepCount::default());
    let worker = WorkerContext { inputs: &inputs, budget: &budget, steps: &steps };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let done = pool.install(|| worker.process_log(&task.work));
    serde_json::to_string(&done).map_err(|e| Error::Engine(e.to_string()))
}

/// As [`crate::run()`], with the logs processed by an engine: it receives batches of logs, and the results are stored
/// as they arrive.
///
/// # Errors
/// As [`crate::run()`], and [`Error::Engine`] when the engine fails. Its earlier results are stored.
pub fn run(
    config: &Config,
    request: &Request,
    context: &Context<'_>,
    at_a_time: usize,
    engine: &mut Engine<'_>,
) -> Result<RunSummary, Error> {
    execute_run(config, request, context, 0, |inputs, store| {
        for works in inputs.plan.work.chunks(at_a_time.max(1)) {
            store(process_batch(inputs, works, engine, context.watch)?)?;
        }
        Ok(())
    })
}

/// One batch of logs: those with a known error have it as their outcome, the others go to the engine. Logs that the engine
/// lost have none.
fn process_batch(
    inputs: &RunInputs,
    works: &[WorkItem],
    engine: &mut Engine<'_>,
    watch: &dyn Fn(Event),
) -> Result<Vec<ProcessedLog>, Error> {
    let sound = works.iter().filter(|work| work.fault.is_none());
    let task = |work: &WorkItem| Task { work: work.clone(), run_id: inputs.run_id.clone() };
    let tasks: Vec<Task> = sound.map(task).collect();
    let mut answers =
        if tasks.is_empty() { HashMap::new() } else { read(engine(&tasks).map_err(Error::Engine)?)? };
    let outcome = |work: &WorkItem| {
        let done = match &work.fault {
            Some(fault) => inputs.failed(work, fault.clone()),
            None => answers.remove(&work.log_path)?,
        };
        // The engine knows what the log was before, and this process also what other logs were.
        let done = inputs.known(work, &done.account).unwrap_or(done);
        watch(done.event(work));
        Some(done)
    };
    Ok(works.iter().filter_map(outcome).collect())
}

/// Results by log; the first of several results of a log counts.
fn read(results: Vec<String>) -> Result<HashMap<String, ProcessedLog>, Error> {
    let mut of_logs = HashMap::new();
    for result in results {
        let done: ProcessedLog = serde_json::from_str(&result).map_err(|e| Error::Engine(e.to_string()))?;
        of_logs.entry(done.account.log_path.clone()).or_insert(done);
    }
    Ok(of_logs)
}
