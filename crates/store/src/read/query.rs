//! Queries: the selection of gap records, and answers. Each answer is made from one version of a table, so it shows whole
//! commits only.

use std::collections::BTreeSet;
use std::path::PathBuf;

use arrow::array::RecordBatch;
use jiff::Timestamp;
use records::row_schema::from_batch;
use records::{GapRecord, LogOutcome, LogRecord, RecordKey};

use crate::error::Error;
use crate::handle::Store;
use crate::read::frame;
use crate::read::scan::{self, Condition};

/// Selection of records; a field that is `None` does not restrict it.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
#[expect(missing_docs, reason = "each field is named for what it holds")]
pub struct Query {
    pub tail_number: Option<String>,
    /// Unit, on any tail; unique only together with its part number.
    pub serial_number: Option<String>,
    pub part_number: Option<String>,
    pub flight_id: Option<String>,
    pub position: Option<String>,
    pub run_id: Option<String>,
    /// Departures at or after this time.
    pub since_utc: Option<Timestamp>,
    /// Departures before this time.
    pub until_utc: Option<Timestamp>,
    /// At most this many records, the latest.
    pub last: Option<usize>,
}

impl Query {
    pub(crate) fn conditions(&self) -> Vec<Condition> {
        let texts = [
            ("tail_number", &self.tail_number),
            ("serial_number", &self.serial_number),
            ("part_number", &self.part_number),
            ("flight_id", &self.flight_id),
            ("position", &self.position),
            ("run_id", &self.run_id),
        ];
        let text = |(column, value): (_, &Option<String>)| {
            Some(Condition::texts(column, value.as_ref()?, value.as_ref()?))
        };
        // A departure is cut to whole microseconds in the table, so a bound between two of them rounds up.
        let (first, last) = (self.since_utc.map(until_us), self.until_utc.map(|until| until_us(until) - 1));
        let is_timed = first.or(last).is_some();
        let (first, last) = (first.unwrap_or(i64::MIN), last.unwrap_or(i64::MAX));
        texts
            .into_iter()
            .filter_map(text)
            .chain(is_timed.then(|| Condition::times("departure_utc", first, last)))
            .collect()
    }
}

/// The first whole microsecond at or after a time.
fn until_us(time: Timestamp) -> i64 {
    let whole_us = time.as_microsecond();
    let rest = time.as_nanosecond() - i128::from(whole_us) * 1_000;
    whole_us + i64::from(rest > 0)
}

impl Store {
    /// The records that fit, as columns, by departure, tail, flight and position.
    ///
    /// Files whose bounds rule them out are not opened; those that are opened are compared with their digests first.
    ///
    /// # Errors
    /// [`Error::Table`] when the log cannot be read, [`Error::Damaged`] when a file is not the one that was committed,
    /// [`Error::Parquet`] when it cannot be decoded.
    pub fn scan(&self, query: &Query) -> Result<RecordBatch, Error> {
        let rows = self.select(&self.gaps.snapshot()?, query, &GapRecord::schema()).read_all()?;
        frame::sorted(&rows, &RecordKey::COLUMNS, query.last)
    }

    /// The records that fit as rows, in the order of [`Store::scan`].
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

    /// The data files of the newest version of a table, for engines that do not read Delta's log. The tables are `gaps`,
    /// `logs`, `runs`, `alerts`, `work` and `states`.
    ///
    /// A listing of the folder would find superseded files too. A table has one file at least; a table that does not exist has
    /// none.
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
