//! Scan of selected columns of the records, file by file, for callers that read all records.
//!
//! A whole fleet's records are tens of millions of rows with repeated names, so text columns remain dictionaries as
//! stored, numbers are not copied, and a caller with threads may read several files at once.

use arrow::array::RecordBatch;
use records::GapRecord;

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
        let (snapshot, schema) = (self.gaps.snapshot()?, scan::only(&GapRecord::schema(), names)?);
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
        self.selection.read_file(path)
    }
}
