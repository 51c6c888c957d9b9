//! Result table with the Arrow PyCapsule interface.

use std::fmt::Write as _;

use arrow::array::{Array, RecordBatch};
use arrow::error::ArrowError;
use arrow::util::display::{ArrayFormatter, FormatOptions};
use pyo3::exceptions::PyKeyError;
use pyo3::prelude::*;
use pyo3::types::PyCapsule;
use records::Diagnostic;
use records::row_schema::{Row, to_nullable_batch};

use crate::arrow_capsule::{self, arrow_error};
use crate::error::{ExceptionClass, to_exception, to_run_exception};

/// Rows, columns and characters of a cell that a notebook or a prompt shows.
const SHOWN_ROWS: usize = 10;
const SHOWN_COLUMNS: usize = 8;
const SHOWN_CHARS: usize = 26;

records::row! {
    /// An error of a log, or of an actuator in it.
    #[derive(Debug)]
    struct LogErrorRow {
        log: Option<String>,
        code: String,
        what: String,
        column: Option<String>,
        row: Option<i64>,
        found: Option<String>,
        wanted: Option<String>,
        hint: Option<String>,
    }
}

impl LogErrorRow {
    fn of(diagnostic: &Diagnostic) -> Self {
        Self {
            log: diagnostic.file.clone(),
            code: diagnostic.code.clone(),
            what: diagnostic.message.clone(),
            column: diagnostic.column.clone(),
            row: diagnostic.row.and_then(|row| i64::try_from(row).ok()),
            found: diagnostic.found.clone(),
            wanted: diagnostic.expected.clone(),
            hint: diagnostic.hint.clone(),
        }
    }
}

/// Rows with named columns. Hand it to pyarrow, Polars, pandas or DuckDB: none of them copies it.
#[pyclass(frozen, module = "freeplay_ema")]
pub(crate) struct Table {
    batch: RecordBatch,
    diagnostics: Vec<Diagnostic>,
}

impl Table {
    pub(crate) fn of(batch: RecordBatch) -> Self {
        Self::with_errors(batch, Vec::new())
    }

    /// A table, with the errors of logs that gave no rows.
    pub(crate) fn with_errors(batch: RecordBatch, diagnostics: Vec<Diagnostic>) -> Self {
        Self { batch, diagnostics }
    }

    pub(crate) fn of_rows<R: Row>(py: Python<'_>, rows: &[R]) -> PyResult<Self> {
        Ok(Self::of(to_nullable_batch(rows).map_err(|e| to_run_exception(py, e.into()))?))
    }

    fn head(&self) -> String {
        let errors = match self.diagnostics.len() {
            0 => String::new(),
            1 => ", 1 error".to_owned(),
            n => format!(", {n} errors"),
        };
        format!("{} rows, {} columns{errors}", self.num_rows(), self.batch.num_columns())
    }

    /// Names of the first columns that have a value in the first rows, and the cells of these rows.
    fn preview(&self) -> Result<(Vec<String>, Vec<Vec<String>>), ArrowError> {
        let some = self.batch.slice(0, self.batch.num_rows().min(SHOWN_ROWS));
        let has_values = |column: &usize| some.column(*column).null_count() < some.num_rows();
        let columns: Vec<usize> = (0..some.num_columns()).filter(has_values).take(SHOWN_COLUMNS).collect();
        let options = FormatOptions::default().with_null("–");
        let formatters = columns
            .iter()
            .map(|column| ArrayFormatter::try_new(some.column(*column).as_ref(), &options))
            .collect::<Result<Vec<_>, _>>()?;
        let names = columns.iter().map(|column| some.schema_ref().field(*column).name().clone()).collect();
        let cell = |f: &ArrayFormatter<'_>, row| Ok(shortened(f.value(row).try_to_string()?));
        let line = |row| formatters.iter().map(|f| cell(f, row)).collect::<Result<Vec<_>, ArrowError>>();
        Ok((names, (0..some.num_rows()).map(line).collect::<Result<_, _>>()?))
    }
}

fn shortened(text: String) -> String {
    if text.chars().count() <= SHOWN_CHARS {
        return text;
    }
    text.chars().take(SHOWN_CHARS - 1).chain(['…']).collect()
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[pymethods]
impl Table {
    /// Rows.
    #[getter]
    fn num_rows(&self) -> usize {
        self.batch.num_rows()
    }

    /// Names of the columns, in order.
    #[getter]
    fn column_names(&self) -> Vec<String> {
        self.batch.schema_ref().fields().iter().map(|field| field.name().clone()).collect()
    }

    /// Errors of logs, and of actuators in them, that gave no rows: `log`, `code`, `what`, `hint` and where.
    #[getter]
    fn errors(&self, py: Python<'_>) -> PyResult<Self> {
        let rows: Vec<LogErrorRow> = self.diagnostics.iter().map(LogErrorRow::of).collect();
        Self::of_rows(py, &rows)
    }

    /// Raises `LogError` with all errors, and with this table as its `answer`; returns the table if there is none.
    fn raise_errors(this: Bound<'_, Self>) -> PyResult<Bound<'_, Self>> {
        let (py, diagnostics) = (this.py(), &this.get().diagnostics);
        if diagnostics.is_empty() {
            return Ok(this);
        }
        let error = to_exception(py, ExceptionClass::Log, diagnostics);
        error.value(py).setattr("answer", &this)?;
        Err(error)
    }

    /// The rows as a pyarrow table; nothing is copied.
    fn to_arrow(this: Bound<'_, Self>) -> PyResult<Bound<'_, PyAny>> {
        this.py().import("pyarrow")?.call_method1("table", (this,))
    }

    /// The rows as a Polars data frame.
    fn to_polars(this: Bound<'_, Self>) -> PyResult<Bound<'_, PyAny>> {
        this.py().import("polars")?.call_method1("DataFrame", (this,))
    }

    /// The rows as a pandas data frame; needs pyarrow.
    fn to_pandas(this: Bound<'_, Self>) -> PyResult<Bound<'_, PyAny>> {
        Self::to_arrow(this)?.call_method0("to_pandas")
    }

    fn __len__(&self) -> usize {
        self.num_rows()
    }

    fn __repr__(&self) -> PyResult<String> {
        let (names, rows) = self.preview().map_err(|e| arrow_error(&e))?;
        let mut page = format!("<freeplay_ema.Table: {}>", self.head());
        let width = |column: usize| {
            let cells = rows.iter().map(|row| row[column].chars().count());
            cells.chain([names[column].chars().count()]).max().unwrap_or(0)
        };
        let widths: Vec<usize> = (0..names.len()).map(width).collect();
        for line in [&names].into_iter().chain(&rows).filter(|_| !rows.is_empty()) {
            let cells = line.iter().zip(&widths).map(|(cell, width)| format!("{cell:<width$}"));
            let _ = write!(page, "\n{}", cells.collect::<Vec<_>>().join("  ").trim_end());
        }
        Ok(page)
    }

    fn _repr_html_(&self) -> PyResult<String> {
        let (names, rows) = self.preview().map_err(|e| arrow_error(&e))?;
        let cells = |tag: &str, line: &[String]| -> String {
            let cells = line.iter().map(|cell| format!("<{tag}>{}</{tag}>", escaped(cell)));
            format!("<tr>{}</tr>", cells.collect::<String>())
        };
        let body: String = rows.iter().map(|row| cells("td", row)).collect();
        Ok(format!(
            "<p>{}</p><table><thead>{}</thead><tbody>{body}</tbody></table>",
            self.head(),
            cells("th", &names)
        ))
    }

    /// Address of a numeric column's values, to check that nothing was copied.
    fn buffer_address(&self, column: &str) -> PyResult<usize> {
        let found = self.batch.column_by_name(column);
        let data = found.ok_or_else(|| PyKeyError::new_err(column.to_owned()))?.to_data();
        let values = data.buffers().first().ok_or_else(|| PyKeyError::new_err(column.to_owned()))?;
        Ok(values.as_ptr() as usize)
    }

    fn __arrow_c_schema__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyCapsule>> {
        arrow_capsule::schema(py, &self.batch)
    }

    /// Exports the table; a requested schema is optional in the Arrow protocol and ignored.
    #[pyo3(signature = (requested_schema=None))]
    fn __arrow_c_stream__<'py>(
        &self,
        py: Python<'py>,
        requested_schema: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyCapsule>> {
        drop(requested_schema);
        arrow_capsule::stream(py, self.batch.clone())
    }
}
