//! Parquet tables for tests of more than one crate.

use std::collections::BTreeMap;
use std::path::Path;

use arrow::array::{AsArray, RecordBatch};
use arrow::compute::{cast, concat_batches};
use arrow::datatypes::{DataType, Float64Type};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;

/// A Parquet table, read whole with the plain reader of the Arrow library.
pub(crate) struct Table(RecordBatch);

impl Table {
    pub(crate) fn read(file: &Path) -> Self {
        let reader = ParquetRecordBatchReaderBuilder::try_new(std::fs::File::open(file).unwrap()).unwrap();
        let schema = reader.schema().clone();
        let batches: Vec<RecordBatch> = reader.build().unwrap().map(Result::unwrap).collect();
        Self(concat_batches(&schema, &batches).unwrap())
    }

    pub(crate) fn rows(&self) -> usize {
        self.0.num_rows()
    }

    pub(crate) fn texts(&self, column: &str) -> Vec<String> {
        let text = cast(self.0.column_by_name(column).unwrap(), &DataType::Utf8).unwrap();
        text.as_string::<i32>().iter().map(|v| v.unwrap_or_default().to_owned()).collect()
    }

    pub(crate) fn names(&self) -> Vec<String> {
        self.0.schema().fields().iter().map(|field| field.name().clone()).collect()
    }

    /// A column of numbers of any type as doubles; NaN where null.
    pub(crate) fn numbers(&self, column: &str) -> Vec<f64> {
        let real = cast(self.0.column_by_name(column).unwrap(), &DataType::Float64).unwrap();
        real.as_primitive::<Float64Type>().iter().map(|value| value.unwrap_or(f64::NAN)).collect()
    }

    /// All columns as numbers, by name; texts are NaN.
    pub(crate) fn columns(&self) -> Vec<(String, Vec<f64>)> {
        self.names().into_iter().map(|name| (name.clone(), self.numbers(&name))).collect()
    }

    pub(crate) fn by_flight(&self, column: &str) -> BTreeMap<(String, String, String), f64> {
        let keys =
            self.texts("tail_number").into_iter().zip(self.texts("flight_id")).zip(self.texts("position"));
        keys.zip(self.numbers(column))
            .map(|(((tail, flight), position), v)| ((tail, flight, position), v))
            .collect()
    }
}
