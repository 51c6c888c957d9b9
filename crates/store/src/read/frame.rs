//! Sorts and groups rows with Polars.
//!
//! Only the columns that rows are sorted or grouped by become Polars columns. Polars returns the rows' numbers, and the
//! rows themselves remain in Arrow.

use arrow::array::{ArrayRef, AsArray, RecordBatch};
use arrow::compute::{cast, interleave_record_batch};
use arrow::datatypes::{DataType, Int64Type};
use polars::prelude::{
    Column, DataFrame, Int64Chunked, IntoColumn, NewChunkedArray, SortMultipleOptions, StringChunked,
};

use crate::error::Error;

const ROW: &str = "row";

/// The named columns of batches of one schema as a Polars frame; times are microseconds.
pub(crate) fn frame(batches: &[RecordBatch], names: &[&str]) -> Result<DataFrame, Error> {
    let height = batches.iter().map(RecordBatch::num_rows).sum();
    let columns = names.iter().map(|name| column(batches, name));
    Ok(DataFrame::new(height, columns.collect::<Result<_, _>>()?)?)
}

fn column(batches: &[RecordBatch], name: &str) -> Result<Column, Error> {
    let array = |batch: &RecordBatch| {
        let array = batch.column(batch.schema_ref().index_of(name)?);
        let is_number = matches!(array.data_type(), DataType::Int64 | DataType::Timestamp(..));
        cast(array, if is_number { &DataType::Int64 } else { &DataType::Utf8 })
    };
    let arrays: Vec<ArrayRef> = batches.iter().map(array).collect::<Result<_, _>>()?;
    if arrays.first().is_some_and(|array| array.data_type() == &DataType::Int64) {
        let numbers = arrays.iter().flat_map(AsArray::as_primitive::<Int64Type>);
        return Ok(Int64Chunked::from_iter_options(name.into(), numbers).into_column());
    }
    let texts = arrays.iter().flat_map(AsArray::as_string::<i32>);
    Ok(StringChunked::from_iter_options(name.into(), texts).into_column())
}

/// The rows of all batches, sorted by the columns of `order`; rows that are equal in these keep their order. If `last` is
/// given, only this number of rows from the end.
pub(crate) fn sorted(
    batches: &[RecordBatch],
    order: &[&str],
    last: Option<usize>,
) -> Result<RecordBatch, Error> {
    let by = SortMultipleOptions::default().with_maintain_order(true);
    let sorted = frame(batches, order)?.with_row_index(ROW.into(), None)?.sort(order, by)?;
    let rows = sorted.tail(Some(last.unwrap_or(usize::MAX)));
    let mut starts = vec![0];
    starts.extend(batches.iter().scan(0, |rows, batch| {
        *rows += batch.num_rows();
        Some(*rows)
    }));
    let place = |row: u32| {
        let batch = starts.partition_point(|&start| start <= row as usize) - 1;
        (batch, row as usize - starts[batch])
    };
    let places: Vec<(usize, usize)> = rows.column(ROW)?.idx()?.iter().flatten().map(place).collect();
    Ok(interleave_record_batch(&batches.iter().collect::<Vec<_>>(), &places)?)
}

pub(crate) fn counts(frame: &DataFrame, name: &str) -> Result<Vec<(String, usize)>, Error> {
    let groups = frame.group_by([name])?;
    let (values, rows) = (groups.keys(), groups.get_groups().iter().map(|group| group.len()));
    let texts = values.first().map(|values| values.str()).transpose()?;
    let texts = texts.into_iter().flat_map(StringChunked::iter);
    Ok(texts.zip(rows).filter_map(|(text, rows)| Some((text?.to_owned(), rows))).collect())
}

pub(crate) fn distinct(frame: &DataFrame, names: &[&str]) -> Result<usize, Error> {
    Ok(frame.group_by(names.iter().copied())?.get_groups().len())
}
