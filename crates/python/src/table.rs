//! Result table with the Arrow PyCapsule interface.

use arrow::array::{Array, RecordBatch};
use arrow::datatypes::SchemaRef;
use pyo3::exceptions::PyKeyError;
use pyo3::prelude::*;
use pyo3::types::PyCapsule;

use crate::arrow_capsule;

/// Rows with named columns. Hand it to pyarrow, Polars, pandas or DuckDB: none of them copies it.
#[pyclass(frozen, module = "freeplay_ema")]
pub(crate) struct Table {
    schema: SchemaRef,
    batches: Vec<RecordBatch>,
}

impl Table {
    pub(crate) fn of(batch: RecordBatch) -> Self {
        Self { schema: batch.schema(), batches: vec![batch] }
    }
}

#[pymethods]
impl Table {
    /// Rows.
    #[getter]
    fn num_rows(&self) -> usize {
        self.batches.iter().map(RecordBatch::num_rows).sum()
    }

    /// Names of the columns, in order.
    #[getter]
    fn column_names(&self) -> Vec<String> {
        self.schema.fields().iter().map(|field| field.name().clone()).collect()
    }

    fn __len__(&self) -> usize {
        self.num_rows()
    }

    fn __repr__(&self) -> String {
        format!("<freeplay_ema.Table: {} rows, {} columns>", self.num_rows(), self.schema.fields().len())
    }

    /// Address of a numeric column's values, to check that nothing was copied.
    fn buffer_address(&self, column: &str) -> PyResult<usize> {
        let found = self.batches.first().and_then(|batch| batch.column_by_name(column));
        let data = found.ok_or_else(|| PyKeyError::new_err(column.to_owned()))?.to_data();
        let values = data.buffers().first().ok_or_else(|| PyKeyError::new_err(column.to_owned()))?;
        Ok(values.as_ptr() as usize)
    }

    fn __arrow_c_schema__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyCapsule>> {
        arrow_capsule::schema(py, &self.schema)
    }

    /// Exports the table; a requested schema is optional in the Arrow protocol and ignored.
    #[pyo3(signature = (requested_schema=None))]
    fn __arrow_c_stream__<'py>(
        &self,
        py: Python<'py>,
        requested_schema: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyCapsule>> {
        drop(requested_schema);
        arrow_capsule::stream(py, &self.schema, self.batches.clone())
    }
}
