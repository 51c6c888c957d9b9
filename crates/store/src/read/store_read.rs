//! Answers: each is made from one version of a table, so it shows whole commits only.

use std::path::PathBuf;

use arrow::array::RecordBatch;
use arrow::datatypes::SchemaRef;
use polars::prelude::{SortMultipleOptions, UniqueKeepStrategy};
use records::{GapRecord, PartNumber, SerialNumber};

use crate::delta::file_stats::Stats;
use crate::delta::snapshot::Snapshot;
use crate::delta::table::Table;
use crate::error::Error;
use crate::handle::Store;
use crate::read::latest_rows::{LatestRows, TextFilter};
use crate::read::query::Query;
use crate::read::{frame, scan};
use records::RecordKey;
use records::row_schema::{FromCells, Row, from_batch};
use records::{LogOutcome, LogRecord};

impl Store {
    /// The records that fit, as columns, by departure, tail, flight and position.
    ///
    /// Files whose bounds rule them out are not opened; those that are opened are compared with their
    /// digests first.
    ///
    /// # Errors
    /// [`Error::Table`] when the log cannot be read, [`Error::Damaged`] when a file is not the one that
    /// was committed, [`Error::Parquet`] when it cannot be decoded.
    pub fn scan(&self, query: &Query) -> Result<RecordBatch, Error> {
        self.select(&self.gaps.snapshot()?, query, GapRecord::schema())
    }

    /// The same as rows.
    ///
    /// # Errors
    /// As [`Store::scan`]; [`Error::Value`] when a cell is not valid in its column.
    pub fn records(&self, query: &Query) -> Result<Vec<GapRecord>, Error> {
        Ok(from_batch(&self.scan(query)?)?)
    }

    /// Every unit with a record, by part and serial number.
    ///
    /// # Errors
    /// As [`Store::records`].
    pub fn serials(&self) -> Result<Vec<(PartNumber, SerialNumber)>, Error> {
        let files = files_of(&self.gaps)?;
        self.check(&files)?;
        let names = ["part_number", "serial_number"];
        let rows = scan::read_files(&files, &scan::only(&GapRecord::schema(), &names)?, &[])?;
        let units = frame::frame(&rows, &names)?.unique_stable(None, UniqueKeepStrategy::Any, None)?;
        let units = units.sort(names, SortMultipleOptions::default())?;
        let [parts, serials] = [units.column(names[0])?.str()?, units.column(names[1])?.str()?];
        let named = |(part, serial): (Option<&str>, Option<&str>)| {
            Some((PartNumber::new(part?).ok()?, SerialNumber::new(serial?).ok()?))
        };
        Ok(parts.iter().zip(serials.iter()).filter_map(named).collect())
    }

    /// The newest account of every log, by name.
    ///
    /// # Errors
    /// As [`Store::records`].
    pub fn accounts(&self) -> Result<Vec<LogRecord>, Error> {
        let is_settled = |outcome: &str| LogOutcome::UNSETTLED.iter().all(|open| open.as_str() != outcome);
        self.newest(
            &self.logs,
            Some(TextFilter { column: "outcome", is_wanted: &is_settled }),
            |stats| {
                !LogOutcome::UNSETTLED.iter().any(|outcome| stats.holds_only("outcome", outcome.as_str()))
            },
            |account: &LogRecord| account.log_path.clone(),
        )
    }

    /// The data files of the records as of now, for engines that do not read Delta's log.
    ///
    /// A listing of the folder would find superseded files too. There is always one at least.
    ///
    /// # Errors
    /// [`Error::Table`] when the log cannot be read.
    pub fn files(&self) -> Result<Vec<PathBuf>, Error> {
        self.named_files(&self.gaps)
    }

    /// The same of the accounts of logs.
    ///
    /// # Errors
    /// As [`Store::files`].
    pub fn log_files(&self) -> Result<Vec<PathBuf>, Error> {
        self.named_files(&self.logs)
    }

    /// The same of the accounts of runs.
    ///
    /// # Errors
    /// As [`Store::files`].
    pub fn run_files(&self) -> Result<Vec<PathBuf>, Error> {
        self.named_files(&self.runs)
    }

    /// The same of alerts; empty where none has been written.
    ///
    /// # Errors
    /// As [`Store::files`].
    pub fn alert_files(&self) -> Result<Vec<PathBuf>, Error> {
        if self.alerts.exists()? { self.named_files(&self.alerts) } else { Ok(Vec::new()) }
    }

    /// The same of events of work requests.
    ///
    /// # Errors
    /// As [`Store::files`].
    pub fn work_files(&self) -> Result<Vec<PathBuf>, Error> {
        if self.work.exists()? { self.named_files(&self.work) } else { Ok(Vec::new()) }
    }

    fn named_files(&self, table: &Table) -> Result<Vec<PathBuf>, Error> {
        Ok(files_of(table)?.iter().map(|file| self.location.display_path(file)).collect())
    }

    pub(crate) fn select(
        &self,
        snapshot: &Snapshot,
        query: &Query,
        schema: SchemaRef,
    ) -> Result<RecordBatch, Error> {
        let files = Self::candidate_files(snapshot, query);
        self.check(&files)?;
        let rows = scan::read_files(&files, &schema, &query.conditions())?;
        frame::sorted(&rows, &RecordKey::COLUMNS, query.last)
    }

    /// Files that may hold matching rows.
    pub(crate) fn candidate_files(snapshot: &Snapshot, query: &Query) -> Vec<PathBuf> {
        let files = snapshot.files.iter().filter(|file| file.has_rows() && query.may_be_in(&file.stats));
        files.map(|file| file.path.clone()).collect()
    }

    /// Of the rows that fit, the newest of each name, by name; files that cannot hold one are passed over.
    pub(crate) fn newest<R: Row + FromCells>(
        &self,
        table: &Table,
        wanted: Option<TextFilter<'_>>,
        may_hold: impl Fn(&Stats) -> bool,
        name: impl Fn(&R) -> String,
    ) -> Result<Vec<R>, Error> {
        let snapshot = table.snapshot()?;
        let files = snapshot.files.iter().filter(|file| file.has_rows() && may_hold(&file.stats));
        let files: Vec<PathBuf> = files.map(|file| file.path.clone()).collect();
        self.check(&files)?;
        let mut newest = LatestRows::new();
        files.iter().try_for_each(|file| newest.take(file, wanted, &name))?;
        Ok(newest.into_rows())
    }
}

pub(crate) fn files_of(table: &Table) -> Result<Vec<PathBuf>, Error> {
    Ok(table.snapshot()?.files.iter().map(|file| file.path.clone()).collect())
}
