//! Scan of data files by a condition: read by Polars, returned as Arrow.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Arc;

use arrow::array::{
    ArrayRef, Float64Array, Int64Array, ListBuilder, RecordBatch, StringArray, StringBuilder,
    TimestampMicrosecondArray,
};
use arrow::datatypes::{DataType, Field, Schema, SchemaRef};
use polars::prelude::{
    Column, DataFrame, Expr, LazyFrame, NULL, PlRefPath, PolarsResult, ScanArgsParquet, SortMultipleOptions,
    UnionArgs, col, concat, lit,
};

use crate::error::Error;
use records::row_schema::list_element;

/// What is read of data files.
pub(crate) struct ScanRequest<'a> {
    /// The files, of one table.
    pub(crate) files: &'a [PathBuf],
    /// The columns wanted.
    pub(crate) schema: SchemaRef,
    /// The rows wanted; all without one.
    pub(crate) condition: Option<Expr>,
    /// The columns to sort by; none keeps the stored order.
    pub(crate) order: &'a [&'a str],
    /// Only the last N rows.
    pub(crate) last: Option<usize>,
}

impl ScanRequest<'_> {
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
        // Files of one release have one schema, and are read together. Where some lack columns that came later, or have
        // some that we do not know, Polars refuses, and each is read by itself.
        let together = scan(self.files).and_then(|frame| self.concat_collect(vec![self.with_filter(frame)]));
        let frame = match together {
            Ok(frame) => frame,
            Err(_) => self.concat_collect(
                self.files.iter().map(|file| self.scan_one(file)).collect::<PolarsResult<_>>()?,
            )?,
        };
        to_arrow(&frame, &self.schema)
    }

    fn with_filter(&self, frame: LazyFrame) -> LazyFrame {
        match &self.condition {
            Some(condition) => frame.filter(condition.clone()),
            None => frame,
        }
    }

    /// The rows of frames with the same columns, put together in order.
    fn concat_collect(&self, frames: Vec<LazyFrame>) -> PolarsResult<DataFrame> {
        let mut frame = concat(frames, UnionArgs::default())?;
        if !self.order.is_empty() {
            let order: Vec<Expr> = self.order.iter().map(|name| col(*name)).collect();
            frame = frame.sort_by_exprs(order, SortMultipleOptions::default().with_maintain_order(true));
        }
        if let Some(last) = self.last {
            frame = frame.tail(last.try_into().unwrap_or(u32::MAX));
        }
        let names: Vec<Expr> = self.schema.fields().iter().map(|field| col(field.name().as_str())).collect();
        frame.select(names).collect()
    }

    /// A file as if it had the columns wanted: those of a later release are empty.
    fn scan_one(&self, file: &PathBuf) -> PolarsResult<LazyFrame> {
        let mut frame = scan(std::slice::from_ref(file))?;
        let has = frame.collect_schema()?;
        let lacks =
            self.schema.fields().iter().filter(|field| field.is_nullable() && !has.contains(field.name()));
        let empty = lacks.map(|field| lit(NULL).cast(kind(field.data_type())).alias(field.name().as_str()));
        let empty: Vec<Expr> = empty.collect();
        // Columns that this release does not know are left behind, or frames could not be put together.
        let wanted = self.schema.fields().iter().map(|field| field.name().as_str());
        let kept: BTreeSet<&str> = wanted.chain(self.order.iter().copied()).collect();
        let kept: Vec<Expr> = kept.into_iter().map(col).collect();
        Ok(self.with_filter(frame).with_columns(empty).select(kept))
    }
}

/// Polars' name for a column's type.
fn kind(kind: &DataType) -> polars::prelude::DataType {
    use polars::prelude::{DataType as Kind, TimeUnit, TimeZone};
    match kind {
        DataType::Float64 => Kind::Float64,
        DataType::Int64 => Kind::Int64,
        DataType::Timestamp(..) => Kind::Datetime(TimeUnit::Microseconds, Some(TimeZone::UTC)),
        DataType::List(_) => Kind::List(Box::new(Kind::String)),
        _ => Kind::String,
    }
}

fn scan(files: &[PathBuf]) -> PolarsResult<LazyFrame> {
    let paths: Vec<PlRefPath> =
        files.iter().map(|f| PlRefPath::try_from_path(f)).collect::<PolarsResult<_>>()?;
    // Folders may be called anything: their names are not patterns.
    let options = ScanArgsParquet { glob: false, ..ScanArgsParquet::default() };
    LazyFrame::scan_parquet_files(paths.into(), options)
}

/// Polars keeps text as views; callers get plain `Utf8`.
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
    let mut lists = ListBuilder::new(StringBuilder::new()).with_field(list_element());
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

#[cfg(test)]
mod tests {
    use std::fs::File;

    use arrow::array::AsArray;
    use arrow::datatypes::{Float64Type, TimeUnit};
    use jiff::Timestamp;
    use parquet::arrow::ArrowWriter;

    use super::*;
    use crate::read::query::Query;

    /// Files of an earlier release lack a column, and one may be asked for by time: whatever the order of the files, the
    /// missing values are empty.
    #[test]
    fn files_without_a_later_column_are_read_by_time_with_empty_values() {
        let dir = tempfile::tempdir().unwrap();
        let time = DataType::Timestamp(TimeUnit::Microsecond, Some("UTC".into()));
        let schema = Arc::new(Schema::new(vec![
            Field::new("departure_utc", time, false),
            Field::new("later", DataType::Float64, true),
        ]));
        let times = Arc::new(TimestampMicrosecondArray::from(vec![10, 20]).with_timezone("UTC"));
        let batch =
            RecordBatch::try_new(schema.clone(), vec![times, Arc::new(Float64Array::from(vec![1.0, 2.0]))]);
        let batch = batch.unwrap();
        let [new, old] = ["new", "old"].map(|name| dir.path().join(format!("{name}.parquet")));
        for (file, batch) in [(&new, batch.clone()), (&old, batch.project(&[0]).unwrap())] {
            let mut writer = ArrowWriter::try_new(File::create(file).unwrap(), batch.schema(), None).unwrap();
            writer.write(&batch).unwrap();
            writer.close().unwrap();
        }
        for files in [[old.clone(), new.clone()], [new, old]] {
            let since_utc = Timestamp::from_microsecond(15).ok();
            let wanted = ScanRequest {
                files: &files,
                schema: schema.clone(),
                condition: Query { since_utc, ..Query::default() }.condition(),
                order: &[],
                last: None,
            };
            let found = wanted.collect().unwrap();
            let mut later: Vec<_> = found.column(1).as_primitive::<Float64Type>().iter().collect();
            later.sort_by(|a, b| a.partial_cmp(b).unwrap());
            assert_eq!(later, [None, Some(2.0)]);
        }
    }
}
