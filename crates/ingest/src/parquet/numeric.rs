//! Any numeric Arrow array as `f64`.

use arrow::array::{Array, ArrayRef, AsArray};
use arrow::compute::cast;
use arrow::datatypes::{DataType, Float64Type};

use crate::error::{Fault, column_type};

/// Appends a whole array; nulls become NaN.
pub(crate) fn append(column: &str, array: &ArrayRef, into: &mut impl Extend<f64>) -> Result<(), Fault> {
    let real = real(column, array)?;
    let real = real.as_primitive::<Float64Type>();
    if real.null_count() == 0 {
        into.extend(real.values().iter().copied());
    } else {
        into.extend(real.iter().map(|value| value.unwrap_or(f64::NAN)));
    }
    Ok(())
}

/// Numbers, truth values, or texts of numbers; a blank text is missing.
fn real(column: &str, array: &ArrayRef) -> Result<ArrayRef, Fault> {
    let kind = match array.data_type() {
        DataType::Dictionary(_, kind) => kind,
        kind => kind,
    };
    let real = cast(array, &DataType::Float64).map_err(|_| wrong_type(column, array, "numbers"))?;
    if kind.is_numeric() || *kind == DataType::Boolean {
        return Ok(real);
    }
    // The cast makes null of a text that is no number.
    let texts = as_text(column, array)?;
    let is_number = |row: usize, text: &str| real.is_valid(row) || text.trim().is_empty();
    let mut rows = texts.as_string::<i32>().iter().enumerate();
    match rows.find_map(|(row, text)| text.filter(|text| !is_number(row, text))) {
        Some(text) => Err(column_type(column, &format!("texts such as `{text}`"), "numbers")),
        None => Ok(real),
    }
}

/// The fault of a column whose type does not serve.
pub(crate) fn wrong_type(column: &str, array: &ArrayRef, wanted: &str) -> Fault {
    column_type(column, &array.data_type().to_string(), wanted)
}

pub(crate) fn as_text(column: &str, array: &ArrayRef) -> Result<ArrayRef, Fault> {
    cast(array, &DataType::Utf8).map_err(|_| wrong_type(column, array, "text or numbers"))
}
