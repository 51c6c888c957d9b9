//! Data files as rows that fit a condition: read by Polars, handed on as Arrow.

use std::path::PathBuf;
use std::sync::Arc;

use arrow::array::{
    ArrayRef, Float64Array, Int64Array, ListBuilder, RecordBatch, StringArray, StringBuilder,
    TimestampMicrosecondArray,
};
use arrow::datatypes::{DataType, Field, Schema, SchemaRef};
use polars::prelude::{
    Column, DataFrame, Expr, LazyFrame, PlRefPath, PolarsResult, ScanArgsParquet, SortMultipleOptions, col,
};

use crate::error::Error;
use crate::tabled::element;

/// What is read of data files.
pub(crate) struct Read<'a> {
    /// The files, of one table.
    pub(crate) files: &'a [PathBuf],
    /// The columns wanted.
    pub(crate) schema: SchemaRef,
    /// The rows wanted; all without one.
    pub(crate) condition: Option<Expr>,
    /// The columns to sort by; rows stay as they are stored without any.
    pub(crate) order: &'a [&'a str],
    /// So many rows at most, the last.
    pub(crate) last: Option<usize>,
}

impl Read<'_> {
    /// Reads.
    ///
    /// Row groups whose statistics rule out the condition are not decoded.
    ///
    /// # Errors
    /// [`Error::Frame`] when a file is gone or cannot be decoded; [`Error::Column`] when a column has
    /// another type than wanted.
    pub(crate) fn collect(self) -> Result<RecordBatch, Error> {
        if self.files.is_empty() {
            return Ok(RecordBatch::new_empty(self.schema));
        }
        let mut frame = scan(self.files)?;
        if let Some(condition) = self.condition {
            frame = frame.filter(condition);
        }
        if !self.order.is_empty() {
            let order: Vec<Expr> = self.order.iter().map(|name| col(*name)).collect();
            frame = frame.sort_by_exprs(order, SortMultipleOptions::default().with_maintain_order(true));
        }
        if let Some(last) = self.last {
            frame = frame.tail(last.try_into().unwrap_or(u32::MAX));
        }
        let names: Vec<Expr> = self.schema.fields().iter().map(|field| col(field.name().as_str())).collect();
        to_arrow(&frame.select(names).collect()?, &self.schema)
    }
}

fn scan(files: &[PathBuf]) -> PolarsResult<LazyFrame> {
    let paths: Vec<PlRefPath> =
        files.iter().map(|f| PlRefPath::try_from_path(f)).collect::<PolarsResult<_>>()?;
    // Folders may be called anything: their names are not patterns.
    let options = ScanArgsParquet { glob: false, ..ScanArgsParquet::default() };
    LazyFrame::scan_parquet_files(paths.into(), options)
}

/// Polars keeps text as views; whoever asks gets plain `Utf8`.
fn to_arrow(frame: &DataFrame, schema: &SchemaRef) -> Result<RecordBatch, Error> {
    let arrays = schema.fields().iter().map(|field| array(frame.column(field.name())?, field));
    Ok(RecordBatch::try_new(Arc::clone(schema), arrays.collect::<Result<_, _>>()?)?)
}

fn array(column: &Column, field: &Field) -> Result<ArrayRef, Error> {
    Ok(match field.data_type() {
        DataType::Utf8 => Arc::new(column.str()?.iter().collect::<StringArray>()),
        DataType::Float64 => Arc::new(column.f64()?.iter().collect::<Float64Array>()),
        DataType::Int64 => Arc::new(column.i64()?.iter().collect::<Int64Array>()),
        DataType::Timestamp(..) => {
            let micros = column.datetime()?.physical().iter();
            Arc::new(micros.collect::<TimestampMicrosecondArray>().with_timezone("UTC"))
        }
        DataType::List(_) => lists(column)?,
        other => {
            let problem = format!("has type {other}, which no table of the store has");
            return Err(Error::Column { column: field.name().clone(), problem });
        }
    })
}

fn lists(column: &Column) -> Result<ArrayRef, Error> {
    let mut lists = ListBuilder::new(StringBuilder::new()).with_field(element());
    for texts in column.list()?.amortized_iter() {
        match texts {
            Some(texts) => lists.append_value(texts.as_ref().str()?.iter()),
            None => lists.append_null(),
        }
    }
    Ok(Arc::new(lists.finish()))
}

/// Some of a schema's columns.
pub(crate) fn only(schema: &Schema, names: &[&str]) -> Result<SchemaRef, Error> {
    let fields = names.iter().map(|name| Ok(schema.field_with_name(name)?.clone()));
    Ok(Arc::new(Schema::new(fields.collect::<Result<Vec<_>, Error>>()?)))
}
