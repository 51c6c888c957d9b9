//! Arrow PyCapsule interface: import and export of tables without copying.
//!
//! With [`crate::numpy_input`] the only unsafe code of this crate; each use states its safety argument.
#![expect(unsafe_code, reason = "the C interface is made of raw structures")]

use std::ffi::CStr;

use arrow::array::{RecordBatch, RecordBatchIterator, RecordBatchReader};
use arrow::error::ArrowError;
use arrow::ffi::FFI_ArrowSchema;
use arrow::ffi_stream::{ArrowArrayStreamReader, FFI_ArrowArrayStream};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyCapsule;

const STREAM: &CStr = c"arrow_array_stream";
const SCHEMA: &CStr = c"arrow_schema";

/// Converts an Arrow error to a `ValueError`.
pub(crate) fn arrow_error(error: &ArrowError) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// Exports rows as an Arrow stream capsule.
pub(crate) fn stream(py: Python<'_>, batch: RecordBatch) -> PyResult<Bound<'_, PyCapsule>> {
    let schema = batch.schema();
    let reader = RecordBatchIterator::new([Ok(batch)], schema);
    PyCapsule::new_with_value(py, FFI_ArrowArrayStream::new(Box::new(reader)), STREAM)
}

/// Exports the schema of rows as a capsule.
pub(crate) fn schema<'py>(py: Python<'py>, batch: &RecordBatch) -> PyResult<Bound<'py, PyCapsule>> {
    let schema = FFI_ArrowSchema::try_from(batch.schema_ref().as_ref()).map_err(|e| arrow_error(&e))?;
    PyCapsule::new_with_value(py, schema, SCHEMA)
}

/// Imports the batches of any Arrow table: at least one, since a table without rows has columns too.
pub(crate) fn batches(table: &Bound<'_, PyAny>) -> PyResult<Vec<RecordBatch>> {
    if !table.hasattr("__arrow_c_stream__")? {
        let kind = table.get_type();
        return Err(PyTypeError::new_err(format!("{kind} is no Arrow table: it lacks __arrow_c_stream__")));
    }
    let capsule = table.call_method0("__arrow_c_stream__")?.cast_into::<PyCapsule>()?;
    let raw = capsule.pointer_checked(Some(STREAM))?.cast::<FFI_ArrowArrayStream>();
    // SAFETY: the capsule's name guarantees its type; `from_raw` moves the stream out and leaves a released one.
    let reader = unsafe { ArrowArrayStreamReader::from_raw(raw.as_ptr()) }.map_err(|e| arrow_error(&e))?;
    let none = RecordBatch::new_empty(reader.schema());
    let found = reader.collect::<Result<Vec<_>, _>>().map_err(|e| arrow_error(&e))?;
    Ok(if found.is_empty() { vec![none] } else { found })
}
