//! Records and accounts made up for tests.

use std::path::Path;

use jiff::{SignedDuration, Timestamp};
use records::{GapEstimate, GapRecord, Status};
use store::{LogRecord, LogResult, RunRecord, Store, Writer};

use crate::made_up;

pub(crate) const POSITIONS: [&str; 3] = ["aileron_left", "aileron_right", "elevator"];

pub(crate) fn time(text: &str) -> Timestamp {
    text.parse().unwrap()
}

/// The departure of a tail's flight of that number: one a day.
pub(crate) fn departure(flight: i64) -> Timestamp {
    time("2026-01-01T06:00:00Z") + SignedDuration::from_hours(24 * flight)
}

/// A record of tail `N<tail>`'s flight of that number, estimated to be `gap_m`.
pub(crate) fn record(tail: usize, flight: i64, position: &str, gap_m: f64) -> GapRecord {
    let estimate = GapEstimate {
        status: Status::Estimated,
        gap_m: Some(gap_m),
        samples: 30_000,
        flags: vec!["soft_contact".into(), "drift".into()],
        ..GapEstimate::refused("below_detection")
    };
    let [tail, serial] = [format!("N{tail}"), format!("S-{tail}-{position}")];
    let names = [&*tail, position, "EMA-27", &serial, &format!("F{flight:04}")];
    made_up::record(names, departure(flight), 1.5, estimate)
}

pub(crate) fn account(tail: usize, flight: i64) -> LogRecord {
    result(tail, flight, 0.0).account
}

/// What comes of the log of that flight: a record for each position.
pub(crate) fn result(tail: usize, flight: i64, gap_m: f64) -> LogResult {
    made_up::result(POSITIONS.map(|position| record(tail, flight, position, gap_m)).to_vec())
}

pub(crate) fn run(run_id: &str, started: &str, exit_code: Option<i64>) -> RunRecord {
    RunRecord {
        run_id: run_id.into(),
        started_utc: time(started),
        finished_utc: exit_code.map(|_| time(started) + SignedDuration::from_mins(6)),
        program_version: "0.1.0".into(),
        config_path: "pipeline.toml".into(),
        found: 412,
        known: 374,
        done: 38,
        estimated: 271,
        refused: 25,
        errors: 1,
        exit_code,
        ..RunRecord::default()
    }
}

pub(crate) fn writer(dir: &Path) -> Writer {
    Store::create_or_open(dir).unwrap().lock(None).unwrap()
}

/// The writer of a new store in a folder of its own, which is deleted with the first value.
pub(crate) fn fresh() -> (tempfile::TempDir, Writer) {
    let dir = tempfile::tempdir().unwrap();
    let writer = writer(dir.path());
    (dir, writer)
}

/// A new store with some flights of each of the first tails, a commit for each flight number.
pub(crate) fn filled(tails: usize, flights: i64) -> (tempfile::TempDir, Writer) {
    let (dir, mut writer) = fresh();
    for flight in 0..flights {
        let results: Vec<_> = (0..tails).map(|tail| result(tail, flight, 1e-6 * flight as f64)).collect();
        writer.commit(&results).unwrap();
    }
    (dir, writer)
}
