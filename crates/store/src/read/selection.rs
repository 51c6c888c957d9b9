//! Selection: the files and columns that a query needs, and the bookkeeping that is joined to the rows.
//!
//! Part and serial number, and hours, are bookkeeping: a caller that knows the operator's tables joins them when it
//! reads ([`Store::joined`]), so that a corrected table counts at once. What was written with the records is what other
//! programs read.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow::array::{BooleanArray, RecordBatch};
use arrow::compute::{and, filter_record_batch};
use arrow::datatypes::{Field, Schema, SchemaRef};
use arrow::error::ArrowError;
use records::{GapRecord, Status};

use crate::delta::snapshot::Snapshot;
use crate::error::Error;
use crate::handle::Store;
use crate::read::join::Join;
use crate::read::query::Query;
use crate::read::scan::{self, Condition};

/// Columns that bookkeeping supplies.
pub(crate) const JOINED: [&str; 2] = ["part_number", "serial_number"];
/// Columns that a join needs besides those that it supplies.
const NEEDED: [&str; 4] = ["tail_number", "position", "departure_utc", "flight_id"];

/// How the matching rows of some files are read.
#[derive(Debug)]
pub(crate) struct Selection {
    pub(crate) files: Vec<PathBuf>,
    /// Columns of the result.
    wanted: SchemaRef,
    /// Columns that are read: those of the result, and those that the join and the conditions after it need.
    read: SchemaRef,
    /// Conditions on stored columns.
    stored: Vec<Condition>,
    /// Conditions on joined columns.
    joined: Vec<Condition>,
    join: Option<Join>,
}

impl Selection {
    pub(crate) fn of(store: &Store, snapshot: &Snapshot, query: &Query, wanted: &SchemaRef) -> Self {
        let join = store.join.clone();
        let is_joined = |column: &str| join.is_some() && JOINED.contains(&column);
        let (joined, mut stored): (Vec<_>, Vec<_>) =
            query.conditions().into_iter().partition(|condition| is_joined(condition.column));
        let files: Vec<_> = snapshot
            .files
            .iter()
            .filter(|file| file.has_rows() && stored.iter().all(|condition| condition.may_be_in(&file.stats)))
            .collect();
        let withdrawn = Status::Withdrawn.as_str();
        if files.iter().any(|file| file.stats.may_hold("status", withdrawn, withdrawn)) {
            stored.push(not_withdrawn());
        }
        let read = if join.is_some() { widened(wanted) } else { Arc::clone(wanted) };
        let files = files.into_iter().map(|file| file.path.clone()).collect();
        Self { files, wanted: Arc::clone(wanted), read, stored, joined, join }
    }

    /// The matching rows of one of its files.
    pub(crate) fn read_file(&self, path: &Path) -> Result<Vec<RecordBatch>, Error> {
        let rows = scan::read_file(path, &self.read, &self.stored)?;
        rows.iter().map(|batch| Ok(self.finish(batch)?)).collect()
    }

    /// The matching rows of all its files, in one batch or more.
    pub(crate) fn read(&self) -> Result<Vec<RecordBatch>, Error> {
        // A joined condition applies to each file as soon as it is read, or all rows of the store would be held.
        scan::read_each(&self.files, &self.wanted, |path| self.read_file(path))
    }

    /// Joins the bookkeeping, and keeps the matching rows and the wanted columns.
    fn finish(&self, batch: &RecordBatch) -> Result<RecordBatch, ArrowError> {
        let Some(join) = &self.join else { return Ok(batch.clone()) };
        let mut batch = join.apply(batch)?;
        let mut mask: Option<BooleanArray> = None;
        for condition in &self.joined {
            let column = batch.column(batch.schema_ref().index_of(condition.column)?);
            let matches = condition.matches(column)?;
            mask = Some(mask.map_or(Ok(matches.clone()), |mask| and(&mask, &matches))?);
        }
        if let Some(mask) = mask {
            batch = filter_record_batch(&batch, &mask)?;
        }
        let columns: Result<Vec<_>, _> =
            self.wanted.fields().iter().map(|field| batch.schema_ref().index_of(field.name())).collect();
        RecordBatch::try_new(Arc::clone(&self.wanted), batch.project(&columns?)?.columns().to_vec())
    }
}

/// Records that are not withdrawn.
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

impl Store {
    /// The same store, which joins bookkeeping to every record that it reads.
    #[must_use]
    pub fn joined(mut self, join: Join) -> Self {
        self.join = Some(join);
        self
    }
}
