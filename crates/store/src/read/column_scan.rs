//! Scan of selected columns of the records, file by file, for callers that read all records.
//!
//! A whole fleet's records are tens of millions of rows with repeated names, so text columns remain dictionaries as
//! stored, numbers are not copied, and a caller with threads may read several files at once.

use std::collections::BTreeSet;
use std::sync::Arc;

use arrow::array::{AsArray, Float64Array, RecordBatch};
use arrow::compute::kernels::numeric::{add, mul, sub};
use arrow::compute::kernels::zip::zip;
use arrow::compute::{and_kleene, cast, is_not_null};
use arrow::datatypes::DataType;
use arrow::error::ArrowError;
use records::GapRecord;
use records::uncertainty::NORMAL_95;

use crate::error::Error;
use crate::handle::Store;
use crate::read::query::Query;
use crate::read::scan;
use crate::read::selection::Selection;

/// Files that may hold records that fit, of one version of the table.
#[derive(Debug)]
pub struct ColumnScan {
    store: Store,
    selection: Selection,
    version: u64,
}

impl Store {
    /// Some columns of the records that fit, in parts of a file each.
    ///
    /// `query.last` asks for an order and is not heard.
    ///
    /// # Errors
    /// [`Error::Table`] when the log cannot be read, and for a name that no column has.
    pub fn scan_columns(&self, query: &Query, names: &[&str]) -> Result<ColumnScan, Error> {
        let is_replaced = !self.parts_by_largest_gap.is_empty() && names.contains(&"gap_m");
        let needed = LARGEST.into_iter().filter(|name| is_replaced && !names.contains(name));
        let names: Vec<&str> = names.iter().copied().chain(needed).collect();
        let (snapshot, schema) = (self.gaps.snapshot()?, scan::only(&GapRecord::schema(), &names)?);
        let selection = Selection::of(self, &snapshot, query, &schema);
        Ok(ColumnScan { store: self.clone(), selection, version: snapshot.version })
    }
}

impl ColumnScan {
    /// How many there are.
    pub fn len(&self) -> usize {
        self.selection.files.len()
    }

    /// Version of the store that they are of.
    pub fn version(&self) -> u64 {
        self.version
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.selection.files.is_empty()
    }

    /// The rows of one that fit, with the bookkeeping joined: times in µs UTC, texts as dictionaries of `Int32` keys.
    ///
    /// # Errors
    /// [`Error::Damaged`] when the file is not the one that was committed, [`Error::Io`], [`Error::Parquet`] and
    /// [`Error::Arrow`] when it cannot be read.
    pub fn read(&self, part: usize) -> Result<Vec<RecordBatch>, Error> {
        let path = &self.selection.files[part];
        self.store.check(std::slice::from_ref(path))?;
        let rows = self.selection.read_file(path)?;
        let parts = &self.store.parts_by_largest_gap;
        if parts.is_empty() {
            return Ok(rows);
        }
        rows.into_iter().map(|batch| Ok(with_largest_gaps(batch, parts)?)).collect()
    }
}

/// The columns that [`with_largest_gaps`] needs.
const LARGEST: [&str; 3] = ["gap_largest_m", "gap_largest_se_m", "part_number"];

/// Records whose `gap_m`, with its error and bounds, is the largest gap along the stroke: those of some parts in which the gap
/// varies. Others stay as they are.
fn with_largest_gaps(batch: RecordBatch, parts: &BTreeSet<String>) -> Result<RecordBatch, ArrowError> {
    let [Some(largest_m), Some(errors_m), Some(of_part)] = LARGEST.map(|name| batch.column_by_name(name))
    else {
        return Ok(batch);
    };
    let of_part = cast(of_part, &DataType::Utf8)?;
    let is_of_part = of_part.as_string::<i32>().iter().map(|part| part.map(|part| parts.contains(part)));
    let mask = and_kleene(&is_of_part.collect(), &is_not_null(largest_m)?)?;
    let reach_m = mul(errors_m, &Float64Array::new_scalar(NORMAL_95))?;
    let replaced = [
        ("gap_m", Arc::clone(largest_m)),
        ("gap_se_m", Arc::clone(errors_m)),
        ("gap_p05_m", sub(largest_m, &reach_m)?),
        ("gap_p95_m", add(largest_m, &reach_m)?),
    ];
    let mut columns = batch.columns().to_vec();
    for (name, with) in replaced {
        if let Ok(at) = batch.schema_ref().index_of(name) {
            columns[at] = zip(&mask, &with, &columns[at])?;
        }
    }
    RecordBatch::try_new(batch.schema(), columns)
}

impl Store {
    /// The same store, whose [scans](Store::scan_columns) read the largest gap along the stroke as the gap of these parts, where
    /// the gap varies.
    #[must_use]
    pub fn by_largest_gap(mut self, parts: BTreeSet<String>) -> Self {
        self.parts_by_largest_gap = parts;
        self
    }
}
