//! Tables read whole, every cell as text.

use std::path::Path;
use std::sync::Arc;

use arrow::array::{ArrayRef, AsArray, RecordBatch, RecordBatchOptions, StringArray};
use arrow::compute::concat_batches;
use arrow::datatypes::{DataType, Field, Schema};
use arrow::error::ArrowError;

use crate::error::{Error, bad_table};
use crate::tables::column_batches::{TableBatch, TableSplits, text_at};

impl TableBatch {
    /// Reads a whole table as text, a `.parquet` file as Parquet and anything else as CSV; an empty cell is none.
    ///
    /// # Errors
    /// When the file cannot be read, or its content does not match its extension.
    pub fn read(file: &Path) -> Result<Self, Error> {
        let table = TableSplits::open(file, None, &[])?;
        let parts = table.batches(0..table.len())?.map(|part| Ok(part?.batch));
        Self::as_text(file, &parts.collect::<Result<Vec<_>, Error>>()?)
    }

    /// The same table from memory; `name` stands for its file in diagnostics.
    ///
    /// # Errors
    /// When a column is neither text, numbers nor times.
    pub fn as_text(name: &Path, batches: &[RecordBatch]) -> Result<Self, Error> {
        let fail = |error: ArrowError| bad_table(error).in_file(name);
        let schema = batches.first().map_or_else(|| Arc::new(Schema::empty()), RecordBatch::schema);
        let mut whole = Self::new(name, concat_batches(&schema, batches).map_err(fail)?, 0);
        let texts = (0..whole.header.len()).map(|column| {
            let text = whole.cast(Some(column), &DataType::Utf8)?;
            Ok(if whole.batch.column(column).data_type().is_floating() {
                without_decimals(&text)
            } else {
                text
            })
        });
        let texts = texts.collect::<Result<_, Error>>()?;
        let fields: Vec<_> = whole.header.iter().map(|name| Field::new(name, DataType::Utf8, true)).collect();
        let rows = RecordBatchOptions::new().with_row_count(Some(whole.batch.num_rows()));
        let schema = Arc::new(Schema::new(fields));
        whole.batch = RecordBatch::try_new_with_options(schema, texts, &rows).map_err(fail)?;
        Ok(whole)
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

    /// The text of a cell of a table that was read whole.
    pub fn text(&self, row: usize, column: usize) -> Option<&str> {
        text_at(self.batch.columns().get(column)?.as_string_opt()?, row)
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
        let found = self.optional(row, Some(column), read)?;
        found.ok_or_else(|| self.error(row, Some(column), "it is empty".into()))
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

/// Whole numbers without `.0`, and nothing for NaN: pandas makes floats of names that are numbers where one is missing.
fn without_decimals(numbers: &ArrayRef) -> ArrayRef {
    let texts = numbers.as_string::<i32>().iter();
    let cut = texts.map(|text| text.filter(|text| *text != "NaN").map(|text| text.trim_end_matches(".0")));
    Arc::new(cut.collect::<StringArray>())
}
