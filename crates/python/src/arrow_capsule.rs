//! Arrow PyCapsule interface: import and export of tables without copying.
//!
//! With [`crate::numpy_input`] the only unsafe code of this crate; each use states its safety argument.
#![expect(unsafe_code, reason = "the C interface is made of raw structures")]

use std::ffi::CStr;
use std::sync::Arc;

use arrow::array::{ArrayData, ArrayRef, RecordBatch, RecordBatchIterator, StructArray, make_array};
use arrow::datatypes::{Field, Schema, SchemaRef};
use arrow::error::ArrowError;
use arrow::ffi::{FFI_ArrowArray, FFI_ArrowSchema, from_ffi};
use arrow::ffi_stream::FFI_ArrowArrayStream;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyCapsule, PyTuple};

const STREAM: &CStr = c"arrow_array_stream";
const SCHEMA: &CStr = c"arrow_schema";
const ARRAY: &CStr = c"arrow_array";

/// Converts an Arrow error to a `ValueError`.
pub(crate) fn arrow_error(error: &ArrowError) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// Exports batches as an Arrow stream capsule.
pub(crate) fn stream<'py>(
    py: Python<'py>,
    schema: &SchemaRef,
    batches: Vec<RecordBatch>,
) -> PyResult<Bound<'py, PyCapsule>> {
    let each = batches.into_iter().map(Ok);
    let reader = RecordBatchIterator::new(each, Arc::clone(schema));
    PyCapsule::new_with_value(py, FFI_ArrowArrayStream::new(Box::new(reader)), STREAM)
}

/// Exports a schema capsule.
pub(crate) fn schema<'py>(py: Python<'py>, schema: &SchemaRef) -> PyResult<Bound<'py, PyCapsule>> {
    let schema = FFI_ArrowSchema::try_from(schema.as_ref()).map_err(|e| arrow_error(&e))?;
    PyCapsule::new_with_value(py, schema, SCHEMA)
}

/// Imports the batches of any Arrow table.
pub(crate) fn batches(table: &Bound<'_, PyAny>) -> PyResult<Vec<RecordBatch>> {
    let chunks = arrays(table)?.ok_or_else(|| {
        let kind = table.get_type();
        PyTypeError::new_err(format!("{kind} is no Arrow table: it lacks __arrow_c_stream__"))
    })?;
    let batch = |array: ArrayRef| {
        let rows = array.as_any().downcast_ref::<StructArray>();
        rows.map(RecordBatch::from)
            .ok_or_else(|| PyTypeError::new_err("an Arrow table is wanted, not an array"))
    };
    chunks.into_iter().map(batch).collect()
}

/// Imports the chunks of any object with the Arrow interface; `None` without it.
pub(crate) fn arrays(object: &Bound<'_, PyAny>) -> PyResult<Option<Vec<ArrayRef>>> {
    if object.hasattr("__arrow_c_stream__")? {
        let capsule = object.call_method0("__arrow_c_stream__")?.cast_into::<PyCapsule>()?;
        let raw = capsule.pointer_checked(Some(STREAM))?.cast::<FFI_ArrowArrayStream>();
        // SAFETY: the capsule's name guarantees its type; `from_raw` moves the stream out and leaves a released one.
        let stream = unsafe { FFI_ArrowArrayStream::from_raw(raw.as_ptr()) };
        return Stream(stream).collect().map(Some);
    }
    if object.hasattr("__arrow_c_array__")? {
        let pair = object.call_method0("__arrow_c_array__")?.cast_into::<PyTuple>()?;
        let schema = pair.get_item(0)?.cast_into::<PyCapsule>()?;
        let schema = schema.pointer_checked(Some(SCHEMA))?.cast::<FFI_ArrowSchema>();
        let array = pair.get_item(1)?.cast_into::<PyCapsule>()?;
        let array = array.pointer_checked(Some(ARRAY))?.cast::<FFI_ArrowArray>();
        // SAFETY: as above, for the two structures of a single array.
        let (schema, array) =
            unsafe { (FFI_ArrowSchema::from_raw(schema.as_ptr()), FFI_ArrowArray::from_raw(array.as_ptr())) };
        return Ok(Some(vec![import_array(array, &schema)?]));
    }
    Ok(None)
}

/// Imports an array without copying its buffers.
fn import_array(array: FFI_ArrowArray, schema: &FFI_ArrowSchema) -> PyResult<ArrayRef> {
    // SAFETY: the producer guarantees a valid array; Arrow releases it.
    let mut data: ArrayData = unsafe { from_ffi(array, schema) }.map_err(|e| arrow_error(&e))?;
    data.align_buffers();
    Ok(make_array(data))
}

/// A stream of arrays of one type. Arrow's own reader takes streams of tables only.
struct Stream(FFI_ArrowArrayStream);

impl Stream {
    fn collect(mut self) -> PyResult<Vec<ArrayRef>> {
        let schema = self.schema()?;
        let mut found = Vec::new();
        while let Some(array) = self.next()? {
            found.push(import_array(array, &schema)?);
        }
        if found.is_empty() {
            // A table without rows still has columns.
            let field = Field::try_from(&schema).map_err(|e| arrow_error(&e))?;
            if let Ok(schema) = Schema::try_from(&schema) {
                let none = RecordBatch::new_empty(Arc::new(schema));
                return Ok(vec![Arc::new(StructArray::from(none))]);
            }
            found.push(arrow::array::new_empty_array(field.data_type()));
        }
        Ok(found)
    }

    fn schema(&mut self) -> PyResult<FFI_ArrowSchema> {
        let mut schema = FFI_ArrowSchema::empty();
        let get = self.0.get_schema.ok_or_else(|| PyValueError::new_err("the Arrow stream is released"))?;
        // SAFETY: `get_schema` of a stream that is not released fills the structure it is estimate_batches.
        let code = unsafe { get(&raw mut self.0, &raw mut schema) };
        self.check_status(code)?;
        Ok(schema)
    }

    fn next(&mut self) -> PyResult<Option<FFI_ArrowArray>> {
        let mut array = FFI_ArrowArray::empty();
        let get = self.0.get_next.ok_or_else(|| PyValueError::new_err("the Arrow stream is released"))?;
        // SAFETY: as above; a released array marks the end.
        let code = unsafe { get(&raw mut self.0, &raw mut array) };
        self.check_status(code)?;
        Ok((!array.is_released()).then_some(array))
    }

    fn check_status(&mut self, code: i32) -> PyResult<()> {
        if code == 0 {
            return Ok(());
        }
        // SAFETY: after a failure `get_last_error` returns the stream's message, or null.
        let text = self.0.get_last_error.map(|tell| unsafe { tell(&raw mut self.0) });
        let text = text.filter(|text| !text.is_null());
        // SAFETY: the message is null-terminated and valid until the next call on the stream.
        let text =
            text.map_or_else(String::new, |text| unsafe { CStr::from_ptr(text) }.to_string_lossy().into());
        Err(PyValueError::new_err(format!("the Arrow stream failed with code {code}: {text}")))
    }
}
