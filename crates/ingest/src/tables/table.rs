//! Tables read whole, every cell as text.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};

use arrow::array::RecordBatch;

use crate::error::Error;
use crate::tables::cell::{bad_cell, missing, position};
use crate::tables::column_batches::{StringColumn, TableBatch, batches};

/// A table, every cell text; an empty cell is none.
#[derive(Debug, Clone)]
pub struct Table {
    file: PathBuf,
    header: Vec<String>,
    columns: Vec<StringColumn>,
    rows: usize,
    names: ColumnAliases,
}

/// What a user's table calls the columns that we know: our name → theirs.
pub type ColumnAliases = BTreeMap<String, String>;

impl Table {
    /// Reads a `.parquet` file as Parquet and anything else as CSV.
    ///
    /// # Errors
    /// When the file cannot be read, or its content does not match its extension.
    pub fn read(file: &Path) -> Result<Self, Error> {
        Self::of_parts(file, &batches(file, None)?.collect::<Result<Vec<_>, _>>()?)
    }

    /// The same table from memory; `name` stands for its file in diagnostics.
    ///
    /// # Errors
    /// When a column is neither text, numbers nor times.
    pub fn of_batches(name: &Path, batches: &[RecordBatch]) -> Result<Self, Error> {
        let part = |batch: &RecordBatch| TableBatch::new(name, batch.clone(), 0);
        Self::of_parts(name, &batches.iter().map(part).collect::<Vec<_>>())
    }

    fn of_parts(name: &Path, parts: &[TableBatch]) -> Result<Self, Error> {
        let header = parts.first().map(|part| part.header().to_vec()).unwrap_or_default();
        let column = |column: usize| {
            let texts = parts.iter().map(|part| part.texts(Some(column)));
            let texts = StringColumn::joined(&texts.collect::<Result<Vec<_>, _>>()?);
            texts.map_err(|fault| Error::new(name, fault))
        };
        let columns = (0..header.len()).map(column).collect::<Result<_, _>>()?;
        let rows = parts.iter().map(|part| part.rows().len()).sum();
        Ok(Self { file: name.to_owned(), header, columns, rows, names: ColumnAliases::new() })
    }

    /// The same table, whose columns go by a user's own names.
    #[must_use]
    pub fn with_aliases(mut self, names: &ColumnAliases) -> Self {
        self.names.clone_from(names);
        self
    }

    /// Numbers of its rows.
    pub fn rows(&self) -> Range<usize> {
        0..self.rows
    }

    /// Where a column stands, if it is there under one of its names.
    pub fn find(&self, names: &[&str]) -> Option<usize> {
        let theirs = |name: &str| self.names.get(name).map_or_else(|| name.to_owned(), Clone::clone);
        names.iter().find_map(|name| position(&self.header, &theirs(name)))
    }

    /// Where a column stands.
    ///
    /// # Errors
    /// When it is not there, with the nearest name that is.
    pub fn column(&self, names: &[&str]) -> Result<usize, Error> {
        let wanted = || self.names.get(names[0]).map_or(names[0], String::as_str);
        self.find(names).ok_or_else(|| missing(&self.file, wanted(), &self.header))
    }

    /// Where columns stand; an error for each that is not there.
    pub(super) fn columns<const N: usize>(&self, names: [&str; N]) -> Result<[usize; N], Vec<Error>> {
        let found = names.map(|name| self.column(&[name]));
        if found.iter().all(Result::is_ok) {
            return Ok(found.map(Result::unwrap_or_default));
        }
        Err(found.into_iter().filter_map(Result::err).collect())
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
        let text = self.text(row, column).ok_or_else(|| self.error(row, column, "it is empty".into()))?;
        read(text).map_err(|detail| self.error(row, column, detail))
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
        read(text).map(Some).map_err(|detail| self.error(row, column, detail))
    }

    /// The error of a cell.
    pub(super) fn error(&self, row: usize, column: usize, detail: String) -> Error {
        bad_cell(&self.file, row, self.header.get(column), detail)
    }
}
