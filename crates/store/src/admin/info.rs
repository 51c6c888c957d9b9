//! Contents of the store, and its last run.

use jiff::Timestamp;
use polars::prelude::ChunkAgg;
use records::{GapRecord, LogOutcome, RunRecord};

use crate::error::Error;
use crate::handle::Store;
use crate::read::query::Query;
use crate::read::{frame, scan};

/// A store in numbers; flights, units and aircraft are those with a record.
#[derive(Debug, Clone, PartialEq)]
#[expect(missing_docs, reason = "each field is named for what it holds")]
pub struct Info {
    pub records: usize,
    pub flights: usize,
    pub serials: usize,
    pub tails: usize,
    pub first_departure_utc: Option<Timestamp>,
    pub last_departure_utc: Option<Timestamp>,
    /// Logs with an account.
    pub logs: usize,
    /// Logs whose processing failed.
    pub failed_logs: usize,
    /// Data files of the records.
    pub files: usize,
    /// Their bytes; superseded files, which are kept for a while, are not counted.
    pub bytes: u64,
    /// The Delta version of the records.
    pub version: u64,
    /// The newest run that ended with code 0 or 1.
    pub last_completed: Option<RunRecord>,
    /// The newest run, however it ended.
    pub last: Option<RunRecord>,
}

impl Store {
    /// Counts.
    ///
    /// # Errors
    /// As [`Store::scan`].
    pub fn info(&self) -> Result<Info, Error> {
        let snapshot = self.gaps.snapshot()?;
        let names = ["departure_utc", "tail_number", "flight_id", "part_number", "serial_number"];
        let columns = scan::only(&GapRecord::schema(), &names)?;
        let rows = frame::frame(&self.select(&snapshot, &Query::default(), &columns).read_all()?, &names)?;
        let departures = rows.column(names[0])?.i64()?;
        let at = |micros: Option<i64>| micros.and_then(|us| Timestamp::from_microsecond(us).ok());
        let runs = self.runs()?;
        let accounts = self.accounts()?;
        Ok(Info {
            records: rows.height(),
            flights: frame::distinct(&rows, &names[..3])?,
            serials: frame::distinct(&rows, &names[3..])?,
            tails: frame::distinct(&rows, &names[1..2])?,
            first_departure_utc: at(departures.min()),
            last_departure_utc: at(departures.max()),
            logs: accounts.len(),
            failed_logs: accounts.iter().filter(|log| log.outcome == LogOutcome::Error).count(),
            files: snapshot.files.len(),
            bytes: snapshot.files.iter().map(|file| file.size_bytes).sum(),
            version: snapshot.version,
            last_completed: last_completed(&runs, Timestamp::now()).cloned(),
            last: runs.last().cloned(),
        })
    }
}

/// The completed run that ended last. A clock that was ahead when a run ended hides no other run: one that ended after
/// `now` counts only where there is no other.
fn last_completed(runs: &[RunRecord], now: Timestamp) -> Option<&RunRecord> {
    let key = |run: &&RunRecord| (run.finished_utc <= Some(now), run.finished_utc);
    runs.iter().filter(|run| matches!(run.exit_code, Some(0 | 1))).max_by_key(key)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(run_id: &str, finished_utc: &str) -> RunRecord {
        let at: Timestamp = finished_utc.parse().unwrap();
        RunRecord {
            run_id: run_id.to_owned(),
            started_utc: at,
            finished_utc: Some(at),
            program_version: "0".to_owned(),
            exit_code: Some(0),
            ..RunRecord::default()
        }
    }

    #[test]
    fn a_run_under_a_clock_that_was_ahead_does_not_hide_the_runs_after_it() {
        let now: Timestamp = "2026-03-03T06:00:00Z".parse().unwrap();
        let ahead = run("ahead", "2031-01-01T04:00:00Z");
        let runs = [ahead.clone(), run("old", "2026-03-01T04:00:00Z"), run("new", "2026-03-03T04:00:00Z")];
        assert_eq!(last_completed(&runs, now).unwrap().run_id, "new");
        assert_eq!(last_completed(&[ahead], now).unwrap().run_id, "ahead");
        let back = run("ten years back", "2016-03-03T05:00:00Z");
        assert_eq!(last_completed(&[runs[1].clone(), back], now).unwrap().run_id, "old");
    }
}
