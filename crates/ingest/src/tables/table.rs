//! Tables read whole, every cell as text.

use std::ops::Deref;
use std::path::Path;
use std::sync::Arc;

use arrow::array::RecordBatch;
use arrow::compute::concat_batches;
use arrow::datatypes::Schema;

use crate::error::{Error, ErrorKind};
use crate::tables::column_batches::{ColumnAliases, StringColumn, TableBatch, TableSplits};

/// A table in one batch, every cell text; an empty cell is none.
#[derive(Debug, Clone)]
pub struct Table {
    whole: TableBatch,
    columns: Vec<StringColumn>,
}

impl Table {
    /// Reads a `.parquet` file as Parquet and anything else as CSV.
    ///
    /// # Errors
    /// When the file cannot be read, or its content does not match its extension.
    pub fn read(file: &Path) -> Result<Self, Error> {
        let table = TableSplits::open(file, None, &[])?;
        let parts = table.batches(0..table.len())?.map(|part| Ok(part?.batch));
        Self::of_batches(file, &parts.collect::<Result<Vec<_>, Error>>()?)
    }

    /// The same table from memory; `name` stands for its file in diagnostics.
    ///
    /// # Errors
    /// When a column is neither text, numbers nor times.
    pub fn of_batches(name: &Path, batches: &[RecordBatch]) -> Result<Self, Error> {
        let schema = batches.first().map_or_else(|| Arc::new(Schema::empty()), RecordBatch::schema);
        let whole = concat_batches(&schema, batches).map_err(|e| Error::new(name, ErrorKind::table(e)))?;
        let whole = TableBatch::new(name, whole, 0);
        let columns = (0..whole.header.len()).map(|column| whole.texts(Some(column)));
        Ok(Self { columns: columns.collect::<Result<_, _>>()?, whole })
    }

    /// The same table, whose columns go by a user's own names.
    #[must_use]
    pub(crate) fn with_aliases(mut self, names: &ColumnAliases) -> Self {
        self.whole.names.clone_from(names);
        self
    }

    /// Where columns stand; an error for each that is not there.
    pub(super) fn columns<const N: usize>(&self, names: [&str; N]) -> Result<[usize; N], Vec<Error>> {
        let found = names.map(|name| self.column(&[name]));
        if found.iter().all(Result::is_ok) {
            return Ok(found.map(Result::unwrap_or_default));
        }
        Err(found.into_iter().filter_map(Result::err).collect())
    }

    /// The result of `read` for each row; if some rows cannot be read, an error for each of them.
    pub(super) fn read_rows<T>(
        &self,
        read: impl Fn(usize) -> Result<T, Error>,
    ) -> Result<Vec<T>, Vec<Error>> {
        let mut errors = Vec::new();
        let rows = self.rows().filter_map(|row| read(row).map_err(|error| errors.push(error)).ok()).collect();
        if errors.is_empty() { Ok(rows) } else { Err(errors) }
    }

    /// The text of a cell.
    pub fn text(&self, row: usize, column: usize) -> Option<&str> {
        self.columns.get(column)?.get(row)
    }

    /// A cell that must hold something, read as `T`.
    ///
    /// # Errors
    /// When it is empty or cannot be read.
    pub fn required<T>(
        &self,
        row: usize,
        column: usize,
        read: impl Fn(&str) -> Result<T, String>,
    ) -> Result<T, Error> {
        let text =
            self.text(row, column).ok_or_else(|| self.error(row, Some(column), "it is empty".into()))?;
        read(text).map_err(|detail| self.error(row, Some(column), detail))
    }

    /// A cell of an optional column that may be empty.
    ///
    /// # Errors
    /// When it holds something that cannot be read.
    pub fn optional<T>(
        &self,
        row: usize,
        column: Option<usize>,
        read: impl Fn(&str) -> Result<T, String>,
    ) -> Result<Option<T>, Error> {
        let Some((column, text)) = column.and_then(|c| Some((c, self.text(row, c)?))) else {
            return Ok(None);
        };
        read(text).map(Some).map_err(|detail| self.error(row, Some(column), detail))
    }
}

impl Deref for Table {
    type Target = TableBatch;

    fn deref(&self) -> &TableBatch {
        &self.whole
    }
}
