//! Withdrawal: records that no command reads any more, and their return.
//!
//! A withdrawn record keeps all its columns except its status, so nothing is lost, and other programs that select by status
//! leave it out too.

use std::collections::BTreeSet;
use std::sync::Arc;

use arrow::array::{Array, ArrayRef, AsArray, RecordBatch, StringArray};
use arrow::datatypes::TimestampMicrosecondType;
use arrow::error::ArrowError;
use records::Status;

use crate::error::Error;
use crate::read::query::Query;
use crate::read::scan::{self, Condition};
use crate::write::writer::Writer;

const COLUMNS: [&str; 7] =
    ["status", "gap_m", "tail_number", "flight_id", "position", "departure_utc", "log_path"];

/// The records that were withdrawn or brought back.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Withdrawal {
    /// Their number.
    pub records: usize,
    /// Their flights: tail, and departure in µs since 1970 UTC.
    pub flights: BTreeSet<(String, i64)>,
}

impl Writer {
    /// Withdraws the matching records, or brings withdrawn ones back, in one commit.
    ///
    /// A query selects by tail, flight, position and departure, and `log_path` the records of one log.
    ///
    /// # Errors
    /// As [`Writer::rewrite`].
    pub fn withdraw(
        &mut self,
        query: &Query,
        log_path: Option<&str>,
        undo: bool,
    ) -> Result<Withdrawal, Error> {
        let of_log = log_path.map(|path| Condition::texts("log_path", path, path));
        let conditions: Vec<Condition> = query.conditions().into_iter().chain(of_log).collect();
        let mut flights = BTreeSet::new();
        let records = self.rewrite(&COLUMNS, |batch| with_status(batch, &conditions, undo, &mut flights))?;
        Ok(Withdrawal { records, flights })
    }
}

/// A batch of [`COLUMNS`] in which the matching rows have their new status; the flights of those that change are added.
fn with_status(
    batch: &RecordBatch,
    conditions: &[Condition],
    undo: bool,
    flights: &mut BTreeSet<(String, i64)>,
) -> Result<RecordBatch, ArrowError> {
    let matches = scan::matches(batch, conditions)?;
    let (statuses, gaps) = (batch.column(0).as_string::<i32>(), batch.column(1));
    let status = |row: usize| match (matches.value(row), undo) {
        (true, false) => Status::Withdrawn.as_str(),
        (true, true) if statuses.value(row) == Status::Withdrawn.as_str() => {
            if gaps.is_valid(row) {
                Status::Estimated.as_str()
            } else {
                Status::Refused.as_str()
            }
        }
        _ => statuses.value(row),
    };
    let new: StringArray = (0..batch.num_rows()).map(|row| Some(status(row))).collect();
    let tails = batch.column(2).as_string::<i32>();
    let departures = batch.column(5).as_primitive::<TimestampMicrosecondType>();
    let changed = (0..batch.num_rows()).filter(|&row| new.value(row) != statuses.value(row));
    flights.extend(changed.map(|row| (tails.value(row).to_owned(), departures.value(row))));
    let mut columns: Vec<ArrayRef> = batch.columns().to_vec();
    columns[0] = Arc::new(new);
    RecordBatch::try_new(batch.schema(), columns)
}
