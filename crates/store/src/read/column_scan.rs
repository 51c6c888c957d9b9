//! Scan of the matching records, file by file: the columns that a query needs, with the bookkeeping joined to the rows.
//!
//! A whole fleet's records are tens of millions of rows with repeated names, so text columns remain dictionaries as
//! stored, numbers are not copied, and a caller with threads may read several files at once.
//!
//! Part and serial number, and hours, are bookkeeping: a caller that knows the operator's tables joins them when it
//! reads ([`Store::joined`]), so that a corrected table counts at once. What was written with the records is what other
//! programs read.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow::array::RecordBatch;
use arrow::compute::filter_record_batch;
use arrow::datatypes::{Field, Schema, SchemaRef};
use arrow::error::ArrowError;
use records::{GapRecord, Status};

use crate::delta::snapshot::Snapshot;
use crate::error::Error;
use crate::handle::Store;
use crate::read::query::Query;
use crate::read::scan::{self, Condition};

/// Columns that bookkeeping supplies, and those of them that a query has conditions on.
const BOOKED: [&str; 5] = ["part_number", "serial_number", "unit_hours", "flight_hours", "tail_hours_end"];
const JOINED: [&str; 2] = ["part_number", "serial_number"];
/// Columns that a join needs besides those that it supplies.
const NEEDED: [&str; 4] = ["tail_number", "position", "departure_utc", "flight_id"];

/// Scan of the files that may hold matching records, in one version of the table.
#[derive(Debug, Clone)]
pub struct ColumnScan {
    store: Store,
    files: Vec<PathBuf>,
    version: u64,
    wanted: SchemaRef,
    /// Columns that are read: those of the result, and those that the join and the conditions after it need.
    read: SchemaRef,
    stored: Vec<Condition>,
    joined: Vec<Condition>,
}

impl Store {
    /// Some columns of the matching records, file by file. `query.last` has no effect, since a scan has no order.
    ///
    /// # Errors
    /// [`Error::Table`] when the log cannot be read, and for a name that no column has.
    pub fn scan_columns(&self, query: &Query, names: &[&str]) -> Result<ColumnScan, Error> {
        Ok(self.select(&self.gaps.snapshot()?, query, &scan::only(&GapRecord::schema(), names)?))
    }

    pub(crate) fn select(&self, snapshot: &Snapshot, query: &Query, wanted: &SchemaRef) -> ColumnScan {
        let is_joined = |column: &str| self.join.is_some() && JOINED.contains(&column);
        let (joined, mut stored): (Vec<_>, Vec<_>) =
            query.conditions().into_iter().partition(|condition| is_joined(condition.column));
        let files = snapshot.paths_where(|stats| stored.iter().all(|condition| condition.may_be_in(stats)));
        let withdrawn = Status::Withdrawn.as_str();
        if snapshot.files.iter().any(|file| file.stats.may_hold("status", withdrawn, withdrawn)) {
            stored.push(not_withdrawn());
        }
        let read = if self.join.is_some() { widened(wanted) } else { Arc::clone(wanted) };
        let (store, version) = (self.clone(), snapshot.version);
        ColumnScan { store, files, version, wanted: Arc::clone(wanted), read, stored, joined }
    }

    /// The same store, which joins bookkeeping to every record that it reads. `join` replaces the bookkeeping columns among
    /// a batch's columns; the batch also has tail number, position, departure and flight.
    #[must_use]
    pub fn joined(
        mut self,
        join: impl Fn(&RecordBatch) -> Result<RecordBatch, ArrowError> + Send + Sync + 'static,
    ) -> Self {
        self.join = Some(Arc::new(join));
        self
    }
}

impl ColumnScan {
    /// Other columns of the same rows, in the same order.
    ///
    /// # Errors
    /// For a name that no column has.
    pub fn with_columns(&self, names: &[&str]) -> Result<Self, Error> {
        let mut scan = Self { wanted: scan::only(&GapRecord::schema(), names)?, ..self.clone() };
        if self.joined.is_empty() && !BOOKED.iter().any(|name| names.contains(name)) {
            // The join costs as much as all columns.
            scan.store.join = None;
        }
        scan.read = if scan.store.join.is_some() { widened(&scan.wanted) } else { Arc::clone(&scan.wanted) };
        Ok(scan)
    }

    /// Number of files to read.
    pub fn file_count(&self) -> usize {
        self.files.len()
    }

    /// Version of the table that is read.
    pub fn version(&self) -> u64 {
        self.version
    }

    /// The matching rows of one file, with the bookkeeping joined: times in µs UTC, texts as dictionaries of `Int32` keys.
    ///
    /// # Errors
    /// [`Error::Damaged`] when the file is not the one that was committed, [`Error::Io`], [`Error::Parquet`] and
    /// [`Error::Arrow`] when it cannot be read.
    pub fn read(&self, part: usize) -> Result<Vec<RecordBatch>, Error> {
        self.read_file(&self.files[part])
    }

    pub(crate) fn read_all(&self) -> Result<Vec<RecordBatch>, Error> {
        // A joined condition applies to each file as soon as it is read, or all rows of the store would be held.
        scan::read_each(&self.files, &self.wanted, |file| self.read_file(file))
    }

    fn read_file(&self, file: &Path) -> Result<Vec<RecordBatch>, Error> {
        let rows = self.store.read_file(file, &self.read, &self.stored)?;
        let Some(join) = &self.store.join else { return Ok(rows) };
        rows.iter().map(|batch| Ok(self.finish(&join(batch)?)?)).collect()
    }

    fn finish(&self, batch: &RecordBatch) -> Result<RecordBatch, ArrowError> {
        let batch = filter_record_batch(batch, &scan::matches(batch, &self.joined)?)?;
        let columns = self.wanted.fields().iter().map(|field| batch.schema_ref().index_of(field.name()));
        let columns = batch.project(&columns.collect::<Result<Vec<_>, _>>()?)?.columns().to_vec();
        RecordBatch::try_new(Arc::clone(&self.wanted), columns)
    }
}

pub(crate) fn not_withdrawn() -> Condition {
    Condition::texts("status", Status::Estimated.as_str(), Status::Refused.as_str())
}

/// The columns and those that a join needs; the latter as dictionaries where they are text.
fn widened(wanted: &SchemaRef) -> SchemaRef {
    let all = GapRecord::schema();
    let missing = NEEDED.iter().chain(&JOINED).filter(|name| wanted.field_with_name(name).is_err());
    let missing = missing.filter_map(|name| all.field_with_name(name).ok()).map(scan::coded);
    let fields: Vec<Field> =
        wanted.fields().iter().map(|field| field.as_ref().clone()).chain(missing).collect();
    Arc::new(Schema::new(fields))
}
