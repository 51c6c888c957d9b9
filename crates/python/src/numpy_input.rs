//! Numeric input from Python: Arrow and numpy arrays, read without copying.
#![expect(unsafe_code, reason = "numpy provides only the address of its data")]

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

/// Keeps a Python object alive while its buffer is in use.
struct BufferOwner {
    _object: AssertUnwindSafe<Py<PyAny>>,
}

/// Values as `f64`; contiguous `float64` without missing values is not copied.
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

/// Buffer of a contiguous one-dimensional `float64` numpy array; `None` for anything else.
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
    // SAFETY: numpy guarantees `rows` numbers at this address while the array lives, and `owner` keeps it alive.
    let bytes = unsafe { Buffer::from_custom_allocation(start, rows * size_of::<f64>(), owner) };
    Ok(Some(ScalarBuffer::new(bytes, 0, *rows)))
}

/// Address of a column's data after import: equal to Python's address if nothing was copied.
#[pyfunction]
pub(crate) fn data_pointer(column: &Bound<'_, PyAny>) -> PyResult<usize> {
    Ok(numbers(column)?.as_ptr() as usize)
}
