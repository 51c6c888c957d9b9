//! Reference data, whose folders are given from the folder of this crate: an entry of a JSON file, and Parquet columns as
//! `f64` with missing values as NaN.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::Path;

use arrow::array::{Array, AsArray};
use arrow::compute::cast;
use arrow::datatypes::{DataType, Float64Type};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use serde_json::Value;

/// The entry of a name in the JSON file of a folder, and the columns of its Parquet file.
pub(crate) fn load(folder: &str, json: &str, name: &str) -> (Value, BTreeMap<String, Vec<f64>>) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
    let all: Value = serde_json::from_reader(File::open(folder.join(json)).unwrap()).unwrap();
    (all[name].clone(), columns(&folder.join(format!("{name}.parquet"))))
}

/// Every numeric column of a file.
fn columns(path: &Path) -> BTreeMap<String, Vec<f64>> {
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
