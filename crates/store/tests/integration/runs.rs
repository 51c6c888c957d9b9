//! The status of a run is known at any instant, also after it was killed.

use std::slice;

use records::Status;
use store::{LogOutcome, LogRecord, Query, RunRecord, Store, Writer};

use crate::fixtures::{account, fresh, record, result, run, writer};

/// The four logs of a run that means to do flights 0 to 3 of tail 1, and does the first three: estimated,
/// refused in two of its three positions, and broken.
fn cut_short(writer: &mut Writer) {
    let to_do: Vec<LogRecord> = (0..4).map(|flight| not_reached(flight, "run")).collect();
    writer.begin_run(&run("run", "2026-11-20T02:00:00Z", None), &to_do).unwrap();
    let mut refused = result(1, 1, 0.0);
    (refused.account.estimated, refused.account.refused) = (1, 2);
    for record in &mut refused.records[1..] {
        record.estimate.status = Status::Refused;
    }
    let mut broken = account(1, 2);
    (broken.outcome, broken.estimated) = (LogOutcome::Error, 0);
    let broken = store::LogResult { account: broken, records: Vec::new(), moved_from: Vec::new() };
    writer.commit(&[result(1, 0, 30e-6), refused, broken]).unwrap();
}

fn not_reached(flight: i64, run_id: &str) -> LogRecord {
    LogRecord {
        outcome: LogOutcome::NotReached,
        positions: Vec::new(),
        estimated: 0,
        run_id: run_id.into(),
        ..account(1, flight)
    }
}

fn figures(run: &RunRecord) -> [i64; 5] {
    [run.done, run.estimated, run.refused, run.errors, run.not_reached]
}

fn outcomes(store: &Store, run_id: &str) -> Vec<LogOutcome> {
    store.run_logs(run_id).unwrap().iter().map(|log| log.outcome).collect()
}

#[test]
fn a_killed_run_is_accounted_for_log_by_log_and_the_next_run_closes_its_account_for_good() {
    let (_dir, mut writer) = fresh();
    cut_short(&mut writer);
    let runs = writer.store().runs().unwrap();
    assert_eq!(figures(&runs[0]), [3, 4, 2, 1, 1]);
    assert_eq!((runs[0].exit_code, runs[0].has_ended()), (None, false));
    assert_eq!(
        outcomes(writer.store(), "run"),
        [LogOutcome::Done, LogOutcome::Done, LogOutcome::Error, LogOutcome::NotReached]
    );
    assert_eq!(writer.store().info().unwrap().last, Some(runs[0].clone()));
    let closed = writer.close_killed_runs().unwrap();
    assert_eq!(closed.iter().map(figures).collect::<Vec<_>>(), [[3, 4, 2, 1, 1]]);
    assert_eq!((closed[0].has_ended(), closed[0].exit_code), (true, None));
    assert_eq!(writer.close_killed_runs().unwrap(), []);
    // The next run supersedes what the killed one stored; the account of that night stays.
    let mut again = result(1, 0, 31e-6);
    again.account.run_id = "next".into();
    again.records.iter_mut().for_each(|record| record.provenance.run_id = "next".into());
    writer.commit(&[again]).unwrap();
    assert_eq!(writer.store().runs().unwrap(), closed);
    assert_eq!(outcomes(writer.store(), "run").len(), 4);
}

#[test]
fn only_an_outcome_that_settles_a_log_replaces_what_was_known_of_it() {
    let (_dir, mut writer) = fresh();
    writer.commit(&[result(1, 0, 30e-6)]).unwrap();
    for outcome in [LogOutcome::NotReached, LogOutcome::Unaccounted] {
        let open = LogRecord { outcome, ..not_reached(0, "redo") };
        writer.begin_run(&run("redo", "2026-11-20T02:00:00Z", None), &[open]).unwrap();
        assert_eq!(writer.store().accounts().unwrap(), [account(1, 0)]);
    }
    for outcome in [LogOutcome::Known, LogOutcome::Error, LogOutcome::Done] {
        let settled = LogRecord { outcome, ..not_reached(0, "redo") };
        writer.begin_run(&run("redo", "2026-11-20T02:00:00Z", None), slice::from_ref(&settled)).unwrap();
        assert_eq!(writer.store().accounts().unwrap(), [settled]);
    }
}

#[test]
fn runs_are_listed_by_start_with_their_end() {
    let (_dir, mut writer) = fresh();
    let whole = run("a", "2026-11-20T02:00:00Z", Some(1));
    writer.begin_run(&run("a", "2026-11-20T02:00:00Z", None), &[]).unwrap();
    writer.end_run(&whole).unwrap();
    writer.begin_run(&run("b", "2026-11-19T02:00:00Z", None), &[]).unwrap();
    let runs = writer.store().runs().unwrap();
    assert_eq!(runs[0].run_id, "b");
    assert_eq!(runs[1], whole);
}

/// DuckDB is handed the list of files, and fails on an empty one.
#[test]
fn a_table_always_has_a_file() {
    let (_dir, mut writer) = fresh();
    assert_eq!(writer.store().table_files("gaps").unwrap().len(), 1);
    let mut retired = result(1, 0, 30e-6);
    writer.commit(&[retired.clone()]).unwrap();
    writer.compact().unwrap();
    let position = |name| {
        let gone = record(1, 0, name, 0.0);
        (store::RecordKey::of(&gone), gone.provenance.log_digest)
    };
    retired.moved_from = crate::fixtures::POSITIONS.map(position).to_vec();
    retired.records.clear();
    (retired.account.estimated, retired.account.refused) = (0, 0);
    writer.commit(&[retired]).unwrap();
    assert_eq!(writer.store().records(&Query::default()).unwrap(), []);
    assert_eq!(writer.store().table_files("gaps").unwrap().len(), 1);
    writer.compact().unwrap();
    let again = writer.compact().unwrap();
    assert_eq!((again.before, again.after), (3, 3));
    assert_eq!(writer.store().verify(), []);
}

#[test]
fn who_asks_whether_a_store_is_held_holds_nobody_up() {
    let dir = tempfile::tempdir().unwrap();
    let held = writer(dir.path());
    let store = Store::open(dir.path()).unwrap();
    assert!(store.is_held().unwrap());
    drop(held);
    assert!(!store.is_held().unwrap());
    std::thread::scope(|scope| {
        let asking = scope.spawn(|| (0..2_000).for_each(|_| assert!(store.is_held().is_ok())));
        while !asking.is_finished() {
            drop(store.lock(None).unwrap());
        }
    });
}
