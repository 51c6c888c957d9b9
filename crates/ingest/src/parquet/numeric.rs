//! Any numeric Arrow array as `f64`.

use arrow::array::{Array, ArrayRef, AsArray};
use arrow::compute::cast;
use arrow::datatypes::{DataType, Float64Type};

use crate::error::ErrorKind;

/// Appends a whole array; nulls become NaN.
pub(crate) fn append(column: &str, array: &ArrayRef, into: &mut impl Extend<f64>) -> Result<(), ErrorKind> {
    let real = real(column, array)?;
    let real = real.as_primitive::<Float64Type>();
    if real.null_count() == 0 {
        into.extend(real.values().iter().copied());
    } else {
        into.extend(real.iter().map(|value| value.unwrap_or(f64::NAN)));
    }
    Ok(())
}

fn real(column: &str, array: &ArrayRef) -> Result<ArrayRef, ErrorKind> {
    let kind = array.data_type();
    let is_number = kind.is_numeric() || matches!(kind, DataType::Boolean | DataType::Dictionary(..));
    match cast(array, &DataType::Float64) {
        Ok(real) if is_number => Ok(real),
        _ => Err(wrong_type(column, array, "numbers")),
    }
}

/// The fault of a column whose type does not serve.
pub(crate) fn wrong_type(column: &str, array: &ArrayRef, wanted: &'static str) -> ErrorKind {
    ErrorKind::ColumnType { column: column.to_owned(), found: array.data_type().to_string(), wanted }
}

/// A column as text.
pub(crate) fn as_text(column: &str, array: &ArrayRef) -> Result<ArrayRef, ErrorKind> {
    cast(array, &DataType::Utf8).map_err(|_| wrong_type(column, array, "text or numbers"))
}
