//! A column of numbers as Python holds it: an Arrow array or a numpy array, read where it lies.
#![expect(unsafe_code, reason = "numpy tells where its numbers lie, and only that")]

use std::panic::AssertUnwindSafe;
use std::ptr::NonNull;
use std::sync::Arc;

use arrow::array::{Array, ArrayRef, AsArray};
use arrow::buffer::{Buffer, ScalarBuffer};
use arrow::compute::{cast, concat};
use arrow::datatypes::{DataType, Float64Type};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

use crate::arrow_capsule;

/// Keeps a Python object alive for as long as its numbers are read.
struct BufferOwner {
    _object: AssertUnwindSafe<Py<PyAny>>,
}

/// Numbers; where they are not missing and already `float64` in one piece, the very bytes of Python.
pub(crate) fn numbers(object: &Bound<'_, PyAny>) -> PyResult<ScalarBuffer<f64>> {
    if let Some(chunks) = arrow_capsule::arrays(object)? {
        return of_arrow(&chunks);
    }
    if let Some(found) = of_numpy(object)? {
        return Ok(found);
    }
    let numpy = object.py().import("numpy")?;
    let plain = numpy.call_method1("ascontiguousarray", (object, "float64"))?;
    of_numpy(&plain)?.ok_or_else(|| PyTypeError::new_err("one column of numbers is wanted"))
}

fn of_arrow(chunks: &[ArrayRef]) -> PyResult<ScalarBuffer<f64>> {
    let to_py_error = |e| arrow_capsule::arrow_error(&e);
    let parts: Vec<&dyn Array> = chunks.iter().map(AsRef::as_ref).collect();
    let one = if let [one] = chunks { Arc::clone(one) } else { concat(&parts).map_err(to_py_error)? };
    let one = cast(&one, &DataType::Float64).map_err(to_py_error)?;
    let reals = one.as_primitive::<Float64Type>();
    if reals.null_count() == 0 {
        return Ok(reals.values().clone());
    }
    Ok(reals.iter().map(|value| value.unwrap_or(f64::NAN)).collect::<Vec<_>>().into())
}

/// The bytes of a numpy array of one dimension that lie one after the other; none of anything else.
fn of_numpy(object: &Bound<'_, PyAny>) -> PyResult<Option<ScalarBuffer<f64>>> {
    let Ok(face) = object.getattr("__array_interface__") else { return Ok(None) };
    let shape: Vec<usize> = face.get_item("shape")?.extract()?;
    let kind: String = face.get_item("typestr")?.extract()?;
    let strides = face.call_method1("get", ("strides",))?;
    let (at, _): (usize, bool) = face.get_item("data")?.extract()?;
    let own = if cfg!(target_endian = "little") { "<f8" } else { ">f8" };
    let ([rows], true, true) = (shape.as_slice(), strides.is_none(), kind == own) else { return Ok(None) };
    let Some(start) =
        NonNull::new(at as *mut u8).filter(|_| *rows > 0 && at.is_multiple_of(align_of::<f64>()))
    else {
        return Ok(None);
    };
    let owner = Arc::new(BufferOwner { _object: AssertUnwindSafe(object.clone().unbind()) });
    // SAFETY: numpy vouches for so many numbers at that place for as long as the array lives, and `owner` keeps it.
    let bytes = unsafe { Buffer::from_custom_allocation(start, rows * size_of::<f64>(), owner) };
    Ok(Some(ScalarBuffer::new(bytes, 0, *rows)))
}

/// Where the numbers of a column lie once they are here: equal to where Python has them when none was copied.
#[pyfunction]
pub(crate) fn data_pointer(column: &Bound<'_, PyAny>) -> PyResult<usize> {
    Ok(numbers(column)?.as_ptr() as usize)
}
