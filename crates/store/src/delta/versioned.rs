//! Rows of which the newest counts: each carries the number of the commit that brought it.

use std::sync::Arc;

use arrow::array::{Int64Array, RecordBatch};
use arrow::datatypes::{DataType, Field, Schema, SchemaRef};
use records::row_schema::{self, FromCells, Row};

use crate::error::Error;

/// The column that orders versions of a row; clocks may go back, commit numbers do not.
pub(crate) const COMMIT: &str = "commit";

pub(crate) fn schema<R: Row + FromCells>() -> SchemaRef {
    let columns = row_schema::schema::<R>();
    let fields =
        columns.fields().iter().cloned().chain([Arc::new(Field::new(COMMIT, DataType::Int64, false))]);
    Arc::new(Schema::new(fields.collect::<Vec<_>>()))
}

pub(crate) fn to_batch<R: Row + FromCells>(rows: &[R], commit: u64) -> Result<RecordBatch, Error> {
    let batch = row_schema::to_batch(rows)?;
    let mut arrays = batch.columns().to_vec();
    arrays.push(Arc::new(Int64Array::from(vec![commit as i64; rows.len()])));
    Ok(RecordBatch::try_new(schema::<R>(), arrays)?)
}
