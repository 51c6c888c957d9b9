//! What the store holds, and when it was last fed.

use std::collections::{BTreeSet, HashSet};
use std::path::PathBuf;

use arrow::array::AsArray;
use arrow::datatypes::TimestampMicrosecondType;
use jiff::Timestamp;

use crate::error::Error;
use crate::handle::Store;
use crate::read::polars_scan::{self, ScanRequest};
use crate::rows::accounts::{LogOutcome, RunRecord};
use crate::rows::gap_columns;

/// A store in numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct Info {
    /// Records.
    pub records: usize,
    /// Flights with a record.
    pub flights: usize,
    /// Units with a record.
    pub serials: usize,
    /// Aircraft with a record.
    pub tails: usize,
    /// The earliest departure.
    pub first_departure_utc: Option<Timestamp>,
    /// The latest departure.
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
        let files: Vec<PathBuf> = snapshot.files.iter().map(|file| file.path.clone()).collect();
        self.check(&files)?;
        let names = ["departure_utc", "tail_number", "flight_id", "part_number", "serial_number"];
        let schema = polars_scan::only(&gap_columns::schema(), &names)?;
        let batch =
            ScanRequest { files: &files, schema, condition: None, order: &[], last: None }.collect()?;
        let departures = batch.column(0).as_primitive::<TimestampMicrosecondType>();
        let text = |column: usize| batch.column(column).as_string::<i32>().iter().flatten();
        let at = |micros: Option<i64>| micros.and_then(|us| Timestamp::from_microsecond(us).ok());
        let runs = self.runs()?;
        let accounts = self.accounts()?;
        Ok(Info {
            records: batch.num_rows(),
            flights: departures.values().iter().zip(text(1).zip(text(2))).collect::<HashSet<_>>().len(),
            serials: text(3).zip(text(4)).collect::<HashSet<_>>().len(),
            tails: text(1).collect::<BTreeSet<_>>().len(),
            first_departure_utc: at(arrow::compute::min(departures)),
            last_departure_utc: at(arrow::compute::max(departures)),
            logs: accounts.len(),
            failed_logs: accounts.iter().filter(|log| log.outcome == LogOutcome::Error).count(),
            files: files.len(),
            bytes: snapshot.files.iter().map(|file| file.size_bytes).sum(),
            version: snapshot.version,
            last_completed: runs
                .iter()
                .filter(|run| completed(run))
                .max_by_key(|run| run.finished_utc)
                .cloned(),
            last: runs.last().cloned(),
        })
    }
}

fn completed(run: &RunRecord) -> bool {
    matches!(run.exit_code, Some(0 | 1))
}
