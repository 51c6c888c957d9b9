//! Export: the records as one file others read, the same bytes for the same records.

use std::borrow::Cow;
use std::io::Write;

use arrow::array::{Array, ArrayRef, AsArray, RecordBatch, StringArray};
use arrow::datatypes::{DataType, Field, Schema, TimestampMicrosecondType};
use arrow::error::ArrowError;
use arrow::json::writer::{JsonArray, WriterBuilder};
use jiff::Timestamp;
use parquet::arrow::ArrowWriter;
use records::GapRecord;
use records::sanitize::csv_cell;
use std::sync::Arc;

use crate::delta::snapshot::Snapshot;
use crate::error::Error;
use crate::handle::Store;
use crate::read::query::Query;
use crate::read::{frame, scan};

/// Rows held in memory at a time; flights of one instant stay together.
const WINDOW_ROWS: usize = 500_000;

/// The form of an export.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Comma-separated with a header; flags in one cell, joined by semicolons.
    Csv,
    /// An array of objects that name every column, empty ones as `null`.
    Json,
    /// Parquet with the columns of [`GapRecord`].
    Parquet,
}

impl Store {
    /// Writes the matching records by departure, tail, flight and position, and returns their number.
    ///
    /// Written numbers read back bitwise identical. Two stores of the same logs
    /// differ in `run_id`, `processed_utc` and `log_path` only.
    ///
    /// # Errors
    /// As [`Store::scan`]; [`Error::Arrow`] and [`Error::Parquet`] when `to` cannot be written.
    pub fn export(&self, query: &Query, format: Format, to: impl Write + Send) -> Result<usize, Error> {
        let snapshot = self.gaps.snapshot()?;
        let mut sink = ExportWriter::new(format, to)?;
        let mut rows = 0;
        for window in self.windows(&snapshot, query)? {
            let batch = self.select(&snapshot, &window)?;
            rows += batch.num_rows();
            sink.write(&batch)?;
        }
        sink.close()?;
        Ok(rows)
    }

    /// The query split into consecutive spans of departures with about equal numbers of rows.
    fn windows(&self, snapshot: &Snapshot, query: &Query) -> Result<Vec<Query>, Error> {
        if query.last.is_some() {
            return Ok(vec![query.clone()]);
        }
        let order = ["departure_utc"];
        let rows = self.read_rows(snapshot, query, &scan::only(&GapRecord::schema(), &order)?)?;
        let departures = frame::sorted(&rows, &order, None)?;
        let departures = departures.column(0).as_primitive::<TimestampMicrosecondType>();
        let edges = (1..departures.len().div_ceil(WINDOW_ROWS)).map(|i| departures.value(i * WINDOW_ROWS));
        let mut windows = vec![query.clone()];
        for edge in edges.filter_map(|micros| Timestamp::from_microsecond(micros).ok()) {
            let mut rest = query.clone();
            rest.since_utc = Some(edge);
            if let Some(before) = windows.last_mut() {
                before.until_utc = Some(edge);
            }
            windows.push(rest);
        }
        Ok(windows)
    }
}

enum ExportWriter<W: Write + Send> {
    Csv(arrow::csv::Writer<W>),
    Json(arrow::json::Writer<W, JsonArray>),
    Parquet(ArrowWriter<W>),
}

impl<W: Write + Send> ExportWriter<W> {
    fn new(format: Format, to: W) -> Result<Self, Error> {
        Ok(match format {
            Format::Csv => Self::Csv(arrow::csv::Writer::new(to)),
            Format::Json => Self::Json(WriterBuilder::new().with_explicit_nulls(true).build(to)),
            Format::Parquet => Self::Parquet(ArrowWriter::try_new(to, GapRecord::schema(), None)?),
        })
    }

    fn write(&mut self, batch: &RecordBatch) -> Result<(), Error> {
        match self {
            Self::Csv(writer) => writer.write(&csv_safe(&joined(batch)?)?)?,
            Self::Json(writer) => writer.write(batch)?,
            Self::Parquet(writer) => writer.write(batch)?,
        }
        Ok(())
    }

    fn close(self) -> Result<(), Error> {
        match self {
            Self::Csv(_) => {}
            Self::Json(mut writer) => writer.finish()?,
            Self::Parquet(writer) => drop(writer.close()?),
        }
        Ok(())
    }
}

/// The same rows with text that no spreadsheet takes for a formula, for a CSV file.
///
/// # Errors
/// Never for a batch that holds together.
pub fn csv_safe(batch: &RecordBatch) -> Result<RecordBatch, ArrowError> {
    let safe = |array: &ArrayRef| -> ArrayRef {
        let Some(texts) = array.as_string_opt::<i32>() else { return Arc::clone(array) };
        let is_changed = |text: &str| matches!(csv_cell(text), Cow::Owned(_));
        if !texts.iter().flatten().any(is_changed) {
            return Arc::clone(array);
        }
        Arc::new(texts.iter().map(|text| text.map(csv_cell)).collect::<StringArray>())
    };
    RecordBatch::try_new(batch.schema(), batch.columns().iter().map(safe).collect())
}

/// A list has no form in CSV: its texts become one, joined by semicolons.
fn joined(batch: &RecordBatch) -> Result<RecordBatch, Error> {
    let cells = batch.schema_ref().fields().iter().zip(batch.columns()).map(|(field, array)| {
        match array.data_type() {
            DataType::List(_) => (Field::new(field.name(), DataType::Utf8, true), one_text(array)),
            other => (Field::new(field.name(), other.clone(), field.is_nullable()), Arc::clone(array)),
        }
    });
    let (fields, arrays): (Vec<Field>, Vec<ArrayRef>) = cells.unzip();
    Ok(RecordBatch::try_new(Arc::new(Schema::new(fields)), arrays)?)
}

fn one_text(lists: &ArrayRef) -> ArrayRef {
    let join = |texts: ArrayRef| texts.as_string::<i32>().iter().flatten().collect::<Vec<_>>().join(";");
    Arc::new(lists.as_list::<i32>().iter().map(|list| list.map(join)).collect::<StringArray>())
}
