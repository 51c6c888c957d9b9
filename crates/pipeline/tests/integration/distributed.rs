//! Logs done elsewhere: whatever an engine does with its tasks, the store holds each record once, and those that a run
//! on one machine makes.

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

use job::Config;
use pipeline::run::distributed::{self, Task};
use pipeline::run::scheduler::{self, Context};
use pipeline::{Error, Request, RunSummary};
use records::GapRecord;
use store::{Query, Store};
use tempfile::TempDir;

/// Six logs of one aircraft of the small fleet, and a store of their own.
fn fleet() -> (TempDir, Config) {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/three-aircraft");
    let dir = tempfile::tempdir().unwrap();
    std::fs::create_dir_all(dir.path().join("sample-data/logs")).unwrap();
    for file in ["pipeline.toml", "sample-data/installations.csv"] {
        std::fs::copy(root.join(file), dir.path().join(file)).unwrap();
    }
    let logs = std::fs::read_dir(root.join("sample-data/logs/N412FP")).unwrap();
    let mut logs: Vec<PathBuf> = logs.map(|log| log.unwrap().path()).collect();
    logs.sort();
    for log in &logs[..6] {
        std::fs::copy(log, dir.path().join("sample-data/logs").join(log.file_name().unwrap())).unwrap();
    }
    let config = Config::read_layers(&[dir.path().join("pipeline.toml")]).unwrap();
    (dir, config)
}

fn with_context<T>(ask: impl FnOnce(&Context<'_>) -> T) -> T {
    let stop = AtomicBool::new(false);
    ask(&Context { program_version: "0", wait: None, stop: &stop, watch: &|_| {} })
}

/// Does tasks as a worker would, and hands the answers to `spoil` on their way.
fn run(
    config: &Config,
    at_a_time: usize,
    mut spoil: impl FnMut(Vec<String>) -> Result<Vec<String>, String>,
) -> Result<RunSummary, Error> {
    let installations = scheduler::installations(config).unwrap();
    let mut engine = |tasks: &[Task]| {
        let answer = |task: &Task| distributed::process_task(config, &installations, task, "0").unwrap();
        spoil(tasks.iter().map(answer).collect())
    };
    with_context(|context| distributed::run(config, &Request::default(), context, at_a_time, &mut engine))
}

/// All that is stored of records, without what names the run.
fn stored(config: &Config) -> Vec<GapRecord> {
    let mut records = Store::open(config.store()).unwrap().records(&Query::default()).unwrap();
    for record in &mut records {
        record.provenance.run_id = String::new();
        record.provenance.processed_utc = jiff::Timestamp::UNIX_EPOCH;
    }
    records
}

fn on_one_machine() -> Vec<GapRecord> {
    let (_dir, config) = fleet();
    with_context(|context| scheduler::run(&config, &Request::default(), context)).unwrap();
    stored(&config)
}

#[test]
fn answers_that_come_twice_in_any_order_make_the_store_of_one_machine() {
    let (_dir, config) = fleet();
    let report =
        run(&config, 4, |answers| Ok(answers.iter().chain(&answers).rev().cloned().collect())).unwrap();
    assert_eq!((report.done, report.estimated, report.not_reached), (6, 24, 0));
    assert_eq!(stored(&config), on_one_machine());
    // One machine knows what was done elsewhere.
    let next = with_context(|context| scheduler::run(&config, &Request::default(), context)).unwrap();
    assert_eq!((next.found, next.known, next.done), (6, 6, 0));
    assert!(Store::open(config.store()).unwrap().verify().is_empty());
}

#[test]
fn a_lost_answer_is_done_by_the_next_run() {
    let (_dir, config) = fleet();
    let report = run(&config, 10, |answers| Ok(answers[1..].to_vec())).unwrap();
    assert_eq!((report.done, report.not_reached), (5, 1));
    let again = run(&config, 10, Ok).unwrap();
    assert_eq!((again.known, again.done, again.not_reached), (5, 1, 0));
    assert_eq!(stored(&config), on_one_machine());
}

#[test]
fn what_was_answered_before_the_engine_failed_is_stored() {
    let (_dir, config) = fleet();
    let mut calls = 0;
    let failed = run(&config, 2, |answers| {
        calls += 1;
        if calls == 2 { Err("the cluster is gone".to_owned()) } else { Ok(answers) }
    });
    assert!(matches!(failed, Err(Error::Engine(what)) if what == "the cluster is gone"));
    assert_eq!(stored(&config).len(), 8);
    let again = run(&config, 2, Ok).unwrap();
    assert_eq!((again.known, again.done, again.cut_short.len()), (2, 4, 1));
    assert_eq!(stored(&config), on_one_machine());
}

/// A log cut in the middle is an answer with its code, and the account of the run names it.
#[test]
fn a_broken_log_is_an_answer() {
    let (dir, config) = fleet();
    let log = std::fs::read_dir(dir.path().join("sample-data/logs")).unwrap().next().unwrap().unwrap().path();
    let bytes = std::fs::read(&log).unwrap();
    std::fs::write(&log, &bytes[..bytes.len() / 2]).unwrap();
    let report = run(&config, 10, Ok).unwrap();
    let codes: Vec<&str> = report.errors.iter().map(|error| error.diagnostic.code.as_str()).collect();
    assert_eq!((report.done, codes), (6, vec!["not_parquet"]));
    let accounts = Store::open(config.store()).unwrap().accounts().unwrap();
    let in_error = accounts.iter().filter(|account| account.error_code.is_some()).count();
    assert_eq!(in_error, 1);
    // The next run has nothing new, and still names the log and the units that need attention.
    let next = with_context(|context| scheduler::run(&config, &Request::default(), context)).unwrap();
    assert_eq!((next.done, next.errors.len(), next.standing_errors.len()), (0, 0, 1));
    assert_eq!(next.standing_errors[0].code, "not_parquet");
    assert!(next.standing_errors[0].log.ends_with(&*log.file_name().unwrap().to_string_lossy()));
    let urgent: usize =
        next.states.iter().filter(|(state, _)| **state != "normal").map(|(_, count)| count).sum();
    assert_eq!((next.trends.len(), next.work_list.len()), (0, urgent));
}
