//! Records and accounts made up for tests.

use std::path::Path;

use jiff::{SignedDuration, Timestamp};
use records::{
    Flight, FlightId, GapEstimate, GapRecord, PartNumber, Position, Provenance, SerialNumber, Status,
    TailNumber,
};
use store::{Holder, LogRecord, LogResult, RunRecord, Store, Writer};

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
    GapRecord {
        flight: Flight {
            tail_number: TailNumber::new(format!("N{tail}")).unwrap(),
            flight_id: FlightId::new(format!("F{flight:04}")).unwrap(),
            departure_utc: departure(flight),
            flight_hours: Some(1.5),
            tail_hours_end: None,
        },
        position: Position::new(position).unwrap(),
        part_number: PartNumber::new("EMA-27").unwrap(),
        serial_number: SerialNumber::new(format!("S-{tail}-{position}")).unwrap(),
        unit_hours: None,
        estimate,
        provenance: Provenance {
            log_path: format!("logs/N{tail}/{flight}.parquet"),
            log_digest: "d1".into(),
            config_digest: "c1".into(),
            program_version: "0.1.0".into(),
            run_id: "run".into(),
            processed_utc: time("2026-11-20T02:00:00Z"),
        },
    }
}

/// The account of the log of that flight.
pub(crate) fn account(tail: usize, flight: i64) -> LogRecord {
    LogRecord {
        log_path: format!("logs/N{tail}/{flight}.parquet"),
        size_bytes: 1_000,
        modified_utc_ns: 1_700_000_000_123_456_789,
        file_id: "1:2".into(),
        log_digest: Some("d1".into()),
        tail_number: Some(format!("N{tail}")),
        flight_id: Some(format!("F{flight:04}")),
        departure_utc: Some(departure(flight)),
        positions: POSITIONS.map(str::to_owned).to_vec(),
        estimated: 3,
        duration_s: 0.25,
        run_id: "run".into(),
        processed_utc: time("2026-11-20T02:00:00Z"),
        ..LogRecord::default()
    }
}

/// What comes of the log of that flight: a record for each position.
pub(crate) fn result(tail: usize, flight: i64, gap_m: f64) -> LogResult {
    let records = POSITIONS.iter().map(|position| record(tail, flight, position, gap_m)).collect();
    LogResult { account: account(tail, flight), records, moved_from: Vec::new() }
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
    Store::create_or_open(dir).unwrap().lock(&Holder::this_process(), None).unwrap()
}

/// The writer of a new store in a folder of its own, which is deleted with the first value.
pub(crate) fn fresh() -> (tempfile::TempDir, Writer) {
    let dir = tempfile::tempdir().unwrap();
    let writer = writer(dir.path());
    (dir, writer)
}
