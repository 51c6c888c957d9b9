//! Any numeric Arrow array as `f64`.

use arrow::array::{Array, ArrayRef, AsArray, PrimitiveArray};
use arrow::compute::cast;
use arrow::datatypes::{ArrowPrimitiveType, DataType, Float32Type, Float64Type};

use crate::error::ErrorKind;

/// Appends a whole array; nulls become NaN.
pub(crate) fn append(column: &str, array: &ArrayRef, into: &mut impl Extend<f64>) -> Result<(), ErrorKind> {
    match array.data_type() {
        DataType::Float64 => append_primitive(array.as_primitive::<Float64Type>(), into),
        DataType::Float32 => append_primitive(array.as_primitive::<Float32Type>(), into),
        _ => append_primitive(real(column, array)?.as_primitive::<Float64Type>(), into),
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

fn append_primitive<T: ArrowPrimitiveType>(array: &PrimitiveArray<T>, into: &mut impl Extend<f64>)
where
    T::Native: Into<f64>,
{
    if array.null_count() == 0 {
        into.extend(array.values().iter().map(|&v| v.into()));
    } else {
        into.extend(array.iter().map(|v| v.map_or(f64::NAN, Into::into)));
    }
}
