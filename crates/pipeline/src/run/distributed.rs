//! Distributed run: logs are processed on the machines of an engine such as Spark.
//!
//! This process plans and stores. A log is a [`Task`]; [`process_task`] processes it on the engine and returns rows.
//!
//! Engines run a task at least once, and may lose it. The first result of a task counts; records replace those with the
//! same key; a log without a result is *not reached*, and the next run processes it. Only this process writes, so the
//! guarantees of the store hold.

use std::collections::{BTreeMap, HashMap};
use std::path::PathBuf;
use std::sync::Arc;

use arrow::array::{Array, ArrayRef, AsArray, RecordBatch, StringArray, new_null_array};
use arrow::compute::{cast, concat_batches, filter_record_batch, is_null};
use arrow::datatypes::{DataType, Field, Schema, SchemaRef};
use ingest::LogFiles;
use job::Config;
use records::row_schema::{from_batch, to_batch};
use records::{GapRecord, Installations};
use serde::{Deserialize, Serialize};
use store::{LogOutcome, LogRecord, RecordKey};

use crate::error::Error;
use crate::logs::plan::{Plan, Request, WorkItem, WorkReason};
use crate::run::event::Event;
use crate::run::flight_ownership::ProcessedLog;
use crate::run::memory_budget::MemoryBudget;
use crate::run::scheduler::{Context, RunInputs, WorkerContext, execute_run};
use crate::run::summary::{self, RunSummary};
use crate::run::worker_pool::StepCount;

/// One log to be processed by the engine.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Task {
    /// Its name in records and messages.
    pub log_path: String,
    /// Its files, the main log's first.
    pub main: Vec<PathBuf>,
    /// Files of other kinds, by the name of their group.
    pub groups: BTreeMap<String, Vec<PathBuf>>,
    /// The run it is done for.
    pub run_id: String,
}

/// Processes tasks and returns their results in any order.
pub type Engine<'a> = dyn FnMut(&[Task]) -> Result<Vec<RecordBatch>, String> + 'a;

/// The columns of a result: those of a record, and three more. Each log has one row with its status
/// (`account`, and `error_code` with `error_detail` where it failed), and one row for each record.
pub fn schema() -> SchemaRef {
    let records = GapRecord::schema();
    let record = records.fields().iter().map(|field| field.as_ref().clone().with_nullable(true));
    let text = |name: &&str| Field::new(*name, DataType::Utf8, true);
    Arc::new(Schema::new(record.chain(OURS.iter().map(text)).collect::<Vec<_>>()))
}

const OURS: [&str; 3] = ["error_code", "error_detail", "account"];

/// Processes one log on one thread: the engine gives a task one core.
///
/// A log in error has a result like any other.
///
/// # Errors
/// When a thread cannot be started, or the result does not fit its columns.
pub fn process_task(
    config: &Config,
    installations: &Installations,
    task: &Task,
    program_version: &str,
) -> Result<RecordBatch, Error> {
    // Content can be known only to a plan that has accounts, and this one has none.
    let inputs = RunInputs {
        config: config.clone(),
        installations: installations.clone(),
        plan: Plan::default(),
        run_id: task.run_id.clone(),
        program_version: program_version.to_owned(),
    };
    let (budget, steps) = (MemoryBudget::new(config.document.run.memory_mib), StepCount::default());
    let worker = WorkerContext { inputs: &inputs, budget: &budget, steps: &steps };
    let files = LogFiles { main: task.main.clone(), groups: task.groups.clone() };
    let log_path = task.log_path.clone();
    let work = WorkItem { files, fault: None, log_path, stat: None, why: WorkReason::New, before: None };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    encode_result(&pool.install(|| worker.process_log(&work)))
}

/// Result of one log as rows: its status first, then its records.
fn encode_result(done: &ProcessedLog) -> Result<RecordBatch, Error> {
    let json = serde_json::to_string(done).map_err(|e| Error::Engine(e.to_string()))?;
    let account = &done.account;
    let schema = schema();
    let head = |field: &Arc<Field>| -> ArrayRef {
        let text = match field.name().as_str() {
            "log_path" => Some(account.log_path.as_str()),
            "error_code" => account.error_code.as_deref(),
            "error_detail" => account.error_detail.as_deref(),
            "account" => Some(json.as_str()),
            _ => return new_null_array(field.data_type(), 1),
        };
        Arc::new(StringArray::from(vec![text]))
    };
    let first = RecordBatch::try_new(Arc::clone(&schema), schema.fields().iter().map(head).collect())?;
    let records = to_batch(&done.records)?;
    let rest = |field: &Arc<Field>| {
        let column = records.column_by_name(field.name()).cloned();
        column.unwrap_or_else(|| new_null_array(field.data_type(), records.num_rows()))
    };
    let rest = RecordBatch::try_new(Arc::clone(&schema), schema.fields().iter().map(rest).collect())?;
    Ok(concat_batches(&schema, [&first, &rest])?)
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
    let tasks: Vec<Task> = sound.map(|work| task(work, &inputs.run_id)).collect();
    let mut answers =
        if tasks.is_empty() { HashMap::new() } else { read(&engine(&tasks).map_err(Error::Engine)?)? };
    let outcome = |work: &WorkItem| {
        let done = match &work.fault {
            Some(fault) => inputs.failed(work, fault.clone()),
            None => to_log_result(inputs, work, answers.remove(&work.log_path)?),
        };
        watch(done.event(work));
        Some(done)
    };
    Ok(works.iter().filter_map(outcome).collect())
}

fn task(work: &WorkItem, run_id: &str) -> Task {
    Task {
        log_path: work.log_path.clone(),
        main: work.files.main.clone(),
        groups: work.files.groups.clone(),
        run_id: run_id.to_owned(),
    }
}

/// Outcome of a log, as if it had been processed by this process.
fn to_log_result(inputs: &RunInputs, work: &WorkItem, answer: ProcessedLog) -> ProcessedLog {
    // The engine has seen the log, and this process its file.
    let LogRecord { size_bytes, modified_utc_ns, file_id, log_path, .. } =
        summary::of_log(work, &inputs.run_id);
    let ProcessedLog { account, records, diagnostics } = answer;
    let mut account = LogRecord { size_bytes, modified_utc_ns, file_id, log_path, ..account };
    if let Some((estimated, refused)) = inputs.already_recorded(work, &account) {
        let already_recorded = LogRecord { outcome: LogOutcome::Known, estimated, refused, ..account };
        return ProcessedLog::without_records(already_recorded, Vec::new());
    }
    summary::set_error(&mut account, &diagnostics);
    ProcessedLog { account, records, diagnostics }
}

/// Results by log, with rows in any order. The first of equal rows counts; a result
/// that lacks records is ignored.
fn read(batches: &[RecordBatch]) -> Result<HashMap<String, ProcessedLog>, Error> {
    let mut results: HashMap<String, ProcessedLog> = HashMap::new();
    let mut records: HashMap<String, BTreeMap<RecordKey, GapRecord>> = HashMap::new();
    for batch in batches {
        let batch = typed(batch)?;
        let text =
            |name: &str| Ok::<_, Error>(batch.column(batch.schema_ref().index_of(name)?).as_string::<i32>());
        let (logs, accounts) = (text("log_path")?, text("account")?);
        for row in (0..batch.num_rows()).filter(|row| accounts.is_valid(*row)) {
            let process_log =
                serde_json::from_str(accounts.value(row)).map_err(|e| Error::Engine(e.to_string()))?;
            results.entry(logs.value(row).to_owned()).or_insert(process_log);
        }
        let rest = filter_record_batch(&batch, &is_null(accounts)?)?;
        for record in from_batch::<GapRecord>(&rest)? {
            let of_log = records.entry(record.provenance.log_path.clone()).or_default();
            of_log.entry(RecordKey::of(&record)).or_insert(record);
        }
    }
    let whole = results.into_iter().filter_map(|(log, answer)| {
        let records: Vec<GapRecord> = records.remove(&log).unwrap_or_default().into_values().collect();
        (records.len() as i64 == answer.account.estimated + answer.account.refused)
            .then_some((log, ProcessedLog { records, ..answer }))
    });
    Ok(whole.collect())
}

/// A batch in the types of the schema: engines return text and lists in types of their own.
fn typed(batch: &RecordBatch) -> Result<RecordBatch, Error> {
    let schema = schema();
    let column = |field: &Arc<Field>| {
        let found = batch.column_by_name(field.name());
        let found = found.ok_or_else(|| Error::Engine(format!("an answer lacks `{}`", field.name())))?;
        Ok(cast(found, field.data_type())?)
    };
    let columns = schema.fields().iter().map(column).collect::<Result<Vec<_>, Error>>()?;
    Ok(RecordBatch::try_new(schema, columns)?)
}
