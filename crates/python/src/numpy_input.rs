//! Numeric input from Python: columns of numbers, read through numpy.
#![expect(unsafe_code, reason = "numpy provides only the address of its data")]

use std::panic::AssertUnwindSafe;
use std::ptr::NonNull;
use std::sync::Arc;

use arrow::buffer::{Buffer, ScalarBuffer};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

/// Keeps a Python object alive while its buffer is in use.
struct BufferOwner {
    _object: AssertUnwindSafe<Py<PyAny>>,
}

/// Values as `f64`. Numpy shares contiguous `float64` without missing values, of arrays and of Arrow columns alike, and
/// copies everything else.
pub(crate) fn numbers(object: &Bound<'_, PyAny>) -> PyResult<ScalarBuffer<f64>> {
    let numpy = object.py().import("numpy")?;
    let array = numpy.call_method1("ascontiguousarray", (object, "float64"))?;
    let face = array.getattr("__array_interface__")?;
    let shape: Vec<usize> = face.get_item("shape")?.extract()?;
    let (at, _): (usize, bool) = face.get_item("data")?.extract()?;
    let is_aligned = at.is_multiple_of(align_of::<f64>());
    let ([rows], Some(start), true) = (shape.as_slice(), NonNull::new(at as *mut u8), is_aligned) else {
        return Err(PyTypeError::new_err("one column of numbers is wanted"));
    };
    let owner = Arc::new(BufferOwner { _object: AssertUnwindSafe(array.unbind()) });
    // SAFETY: numpy guarantees `rows` numbers at this address while the array lives, and `owner` keeps it alive.
    let bytes = unsafe { Buffer::from_custom_allocation(start, rows * size_of::<f64>(), owner) };
    Ok(ScalarBuffer::new(bytes, 0, *rows))
}

/// Address of a column's data after import: equal to Python's address if nothing was copied.
#[pyfunction]
pub(crate) fn data_pointer(column: &Bound<'_, PyAny>) -> PyResult<usize> {
    Ok(numbers(column)?.as_ptr() as usize)
}
