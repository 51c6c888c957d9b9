//! Parquet columns as `f64`, missing values as NaN.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::Path;

use arrow::array::{Array, AsArray};
use arrow::compute::cast;
use arrow::datatypes::{DataType, Float64Type};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;

/// Every numeric column of a file.
pub(crate) fn columns(path: &Path) -> BTreeMap<String, Vec<f64>> {
    let reader =
        ParquetRecordBatchReaderBuilder::try_new(File::open(path).unwrap()).unwrap().build().unwrap();
    let mut columns = BTreeMap::<String, Vec<f64>>::new();
    for batch in reader.map(Result::unwrap) {
        for (field, column) in batch.schema().fields().iter().zip(batch.columns()) {
            let Ok(values) = cast(column, &DataType::Float64) else { continue };
            let values = values.as_primitive::<Float64Type>();
            let present =
                (0..values.len()).map(|i| if values.is_null(i) { f64::NAN } else { values.value(i) });
            columns.entry(field.name().clone()).or_default().extend(present);
        }
    }
    columns
}
