//! Answers: each is made from one version of a table, so it shows whole commits only.

use std::collections::BTreeSet;
use std::path::PathBuf;

use arrow::array::RecordBatch;
use records::GapRecord;

use crate::error::Error;
use crate::handle::Store;
use crate::read::frame;
use crate::read::query::Query;
use crate::read::scan::{self, Condition};
use records::RecordKey;
use records::row_schema::from_batch;
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
        let rows = self.select(&self.gaps.snapshot()?, query, &GapRecord::schema()).read_all()?;
        frame::sorted(&rows, &RecordKey::COLUMNS, query.last)
    }

    /// The same as rows.
    ///
    /// # Errors
    /// As [`Store::scan`]; [`Error::Row`] when a cell is not valid in its column.
    pub fn records(&self, query: &Query) -> Result<Vec<GapRecord>, Error> {
        Ok(from_batch(&self.scan(query)?)?)
    }

    /// The different values of a column of texts, in order.
    ///
    /// # Errors
    /// As [`Store::records`]; [`Error::Frame`] when there is no such column.
    pub fn distinct(&self, column: &str) -> Result<BTreeSet<String>, Error> {
        let schema = scan::only(&GapRecord::schema(), &[column])?;
        let rows = self.select(&self.gaps.snapshot()?, &Query::default(), &schema).read_all()?;
        let counts = frame::counts(&frame::frame(&rows, &[column])?, column)?;
        Ok(counts.into_iter().map(|(value, _)| value).collect())
    }

    /// The newest account of every log, by name.
    ///
    /// # Errors
    /// As [`Store::records`].
    pub fn accounts(&self) -> Result<Vec<LogRecord>, Error> {
        // In the order of their words: `done`, `error` and `known` settle a log, `not_reached` and `unaccounted` do not.
        let settled = Condition::texts("outcome", LogOutcome::Done.as_str(), LogOutcome::Known.as_str());
        self.newest(&self.logs, &[settled], |account: &LogRecord| account.log_path.clone())
    }

    /// The data files of a table as of now, for engines that do not read Delta's log; by the name of the table: `gaps`,
    /// `logs`, `runs`, `alerts` or `work`.
    ///
    /// A listing of the folder would find superseded files too. There is always one at least, except of a table that does
    /// not exist.
    ///
    /// # Errors
    /// [`Error::Table`] when the log cannot be read.
    pub fn table_files(&self, name: &str) -> Result<Vec<PathBuf>, Error> {
        let Some(table) = self.existing_tables().into_iter().find(|table| table.name == name) else {
            return Ok(Vec::new());
        };
        Ok(table.snapshot()?.paths().map(|file| self.location.display_path(&file)).collect())
    }
}
