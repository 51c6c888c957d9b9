//! Contents of the store, and its last run.

use jiff::Timestamp;
use polars::prelude::ChunkAgg;
use records::{GapRecord, LogOutcome, RunRecord};

use crate::error::Error;
use crate::handle::Store;
use crate::read::query::Query;
use crate::read::{frame, scan};

/// Contents of a store in numbers; flights, units and tails are counted if they have a record.
#[derive(Debug, Clone, PartialEq)]
#[expect(missing_docs, reason = "each field is named for what it holds")]
pub struct Info {
    pub records: usize,
    pub flights: usize,
    pub serials: usize,
    pub tails: usize,
    pub first_departure_utc: Option<Timestamp>,
    pub last_departure_utc: Option<Timestamp>,
    pub logs: usize,
    pub failed_logs: usize,
    /// Data files of the records.
    pub files: usize,
    /// Size of these files, bytes, without superseded files, which are kept for a while.
    pub bytes: u64,
    /// The Delta version of the records.
    pub version: u64,
    /// The newest run that ended with code 0 or 1.
    pub last_completed: Option<RunRecord>,
    /// The newest run, however it ended.
    pub last: Option<RunRecord>,
}

impl Store {
    /// Figures about the newest version of the store.
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
        let (runs, accounts, now) = (self.runs()?, self.accounts()?, Some(Timestamp::now()));
        let completed = runs.iter().filter(|run| matches!(run.exit_code, Some(0 | 1)));
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
            // A run whose clock was ahead would hide all later runs: it counts only if there is no other.
            last_completed: completed.max_by_key(|run| (run.finished_utc <= now, run.finished_utc)).cloned(),
            last: runs.last().cloned(),
        })
    }
}
