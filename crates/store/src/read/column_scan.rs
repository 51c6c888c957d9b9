//! Scan of selected columns of the records, file by file, for callers that read all records.
//!
//! A whole fleet's records are tens of millions of rows with repeated names, so text columns remain dictionaries as
//! stored, numbers are not copied, and a caller with threads may read several files at once.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow::array::{ArrayRef, AsArray, BooleanArray, RecordBatch, new_null_array};
use arrow::compute::{and, cast, nullif};
use arrow::datatypes::{DataType, Field, Float64Type, Schema, SchemaRef};
use arrow::error::ArrowError;
use parquet::arrow::ProjectionMask;
use parquet::arrow::arrow_reader::{
    ArrowPredicateFn, ArrowReaderMetadata, ArrowReaderOptions, ParquetRecordBatchReaderBuilder, RowFilter,
};
use records::GapRecord;

use crate::delta::data_file::GROUP_ROWS;
use crate::error::Error;
use crate::handle::Store;
use crate::read::polars_scan;
use crate::read::query::Query;

/// Files that may hold records that fit, of one version of the table.
#[derive(Debug)]
pub struct ColumnScan {
    store: Store,
    files: Vec<PathBuf>,
    query: Query,
    schema: SchemaRef,
    version: u64,
}

impl Store {
    /// Some columns of the records that fit, in parts of a file each.
    ///
    /// `query.last` asks for an order and is not heard.
    ///
    /// # Errors
    /// [`Error::Table`] when the log cannot be read, and for a name that no column has.
    pub fn scan_columns(&self, query: &Query, names: &[&str]) -> Result<ColumnScan, Error> {
        let snapshot = self.gaps.snapshot()?;
        let files = Self::candidate_files(&snapshot, query);
        let (store, query, version) = (self.clone(), query.clone(), snapshot.version);
        Ok(ColumnScan { store, files, query, schema: schema_of(names)?, version })
    }
}

impl ColumnScan {
    /// How many there are.
    pub fn len(&self) -> usize {
        self.files.len()
    }

    /// Version of the store that they are of.
    pub fn version(&self) -> u64 {
        self.version
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.files.is_empty()
    }

    /// The rows of one that fit, as they are stored: times in µs UTC, texts as dictionaries of `Int32` keys.
    ///
    /// # Errors
    /// [`Error::Damaged`] when the file is not the one that was committed, [`Error::Io`], [`Error::Parquet`] and
    /// [`Error::Arrow`] when it cannot be read.
    pub fn read(&self, part: usize) -> Result<Vec<RecordBatch>, Error> {
        let path = &self.files[part];
        self.store.check(std::slice::from_ref(path))?;
        let mut builder = opened(path)?;
        if let Some(filter) = self.filter(&builder)? {
            builder = builder.with_row_filter(filter);
        }
        let mask = mask(&builder, self.schema.fields().iter().map(|field| field.name().as_str()));
        // A group's dictionary serves its rows alone.
        let rows = builder.with_projection(mask).with_batch_size(GROUP_ROWS).build()?;
        rows.map(|batch| Ok(without_infinities(&cast_to_schema(&batch?, &self.schema)?)?)).collect()
    }

    /// Row filter on the selected columns.
    fn filter(&self, builder: &ParquetRecordBatchReaderBuilder<File>) -> Result<Option<RowFilter>, Error> {
        let asked: Vec<&str> = self.query.columns().collect();
        if asked.is_empty() {
            return Ok(None);
        }
        let (query, schema) = (self.query.clone(), schema_of(&asked)?);
        let fits = ArrowPredicateFn::new(mask(builder, asked.into_iter()), move |batch| {
            fits(&query, &cast_to_schema(&batch, &schema)?)
        });
        Ok(Some(RowFilter::new(vec![Box::new(fits)])))
    }
}

/// Some columns of the records, in the form they have in a part.
fn schema_of(names: &[&str]) -> Result<SchemaRef, Error> {
    let wanted = polars_scan::only(&GapRecord::schema(), names)?;
    Ok(Arc::new(Schema::new(wanted.fields().iter().map(|field| coded(field)).collect::<Vec<_>>())))
}

/// A batch's columns in the form wanted, whatever form another program gave them: one that came with a later release
/// is empty.
pub(crate) fn cast_to_schema(batch: &RecordBatch, schema: &SchemaRef) -> Result<RecordBatch, ArrowError> {
    let column = |field: &Arc<Field>| match batch.column_by_name(field.name()) {
        Some(column) => cast(column, field.data_type()),
        None => Ok(new_null_array(field.data_type(), batch.num_rows())),
    };
    let columns = schema.fields().iter().map(column).collect::<Result<Vec<ArrayRef>, _>>()?;
    RecordBatch::try_new(Arc::clone(schema), columns)
}

/// A batch whose numbers are finite or missing: an infinite diagnostic of one refused flight, written by a release
/// before 2026-11-23, must not refuse the whole table.
fn without_infinities(batch: &RecordBatch) -> Result<RecordBatch, ArrowError> {
    let column = |(field, column): (&Arc<Field>, &ArrayRef)| {
        let numbers = column.as_primitive_opt::<Float64Type>().filter(|_| field.is_nullable());
        match numbers.filter(|numbers| numbers.values().iter().any(|value| !value.is_finite())) {
            Some(numbers) => nullif(column, &BooleanArray::from_unary(numbers, |value| !value.is_finite())),
            None => Ok(Arc::clone(column)),
        }
    };
    let schema = batch.schema();
    let columns = schema.fields().iter().zip(batch.columns()).map(column).collect::<Result<_, _>>()?;
    RecordBatch::try_new(schema, columns)
}

/// A column's form in a part.
fn coded(field: &Field) -> Field {
    match field.data_type() {
        DataType::Utf8 => field.clone().with_data_type(dictionary()),
        _ => field.clone(),
    }
}

fn dictionary() -> DataType {
    DataType::Dictionary(Box::new(DataType::Int32), Box::new(DataType::Utf8))
}

/// A file whose text columns remain dictionaries.
fn opened(path: &Path) -> Result<ParquetRecordBatchReaderBuilder<File>, Error> {
    let file = File::open(path).map_err(Error::io(path, "opened"))?;
    let found = ArrowReaderMetadata::load(&file, ArrowReaderOptions::new())?;
    let fields: Vec<Field> = found.schema().fields().iter().map(|field| coded(field)).collect();
    let options = ArrowReaderOptions::new().with_schema(Arc::new(Schema::new(fields)));
    let read_so = ArrowReaderMetadata::try_new(Arc::clone(found.metadata()), options)?;
    Ok(ParquetRecordBatchReaderBuilder::new_with_metadata(file, read_so))
}

/// The columns of those names that a file has.
pub(crate) fn mask<'a>(
    builder: &ParquetRecordBatchReaderBuilder<File>,
    names: impl Iterator<Item = &'a str>,
) -> ProjectionMask {
    let roots: Vec<usize> = names.filter_map(|name| builder.schema().index_of(name).ok()).collect();
    ProjectionMask::roots(builder.parquet_schema(), roots)
}

fn fits(query: &Query, batch: &RecordBatch) -> Result<BooleanArray, ArrowError> {
    let mut all = BooleanArray::from(vec![true; batch.num_rows()]);
    for one in query.fits(batch) {
        all = and(&all, &one?)?;
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use arrow::array::{Float64Array, LargeStringArray, TimestampNanosecondArray};
    use jiff::Timestamp;

    use super::*;

    /// Files that another program wrote may hold long texts and nanoseconds, and lack what came later.
    #[test]
    fn a_column_is_asked_and_handed_over_in_one_form_whatever_form_a_file_has() {
        let texts: ArrayRef = Arc::new(LargeStringArray::from(vec!["N1", "N2", "N1"]));
        let times = TimestampNanosecondArray::from(vec![1_000_000_000, 2_000_000_000, 3_000_000_000]);
        let times: ArrayRef = Arc::new(times.with_timezone("UTC"));
        let batch = RecordBatch::try_from_iter([("tail_number", texts), ("departure_utc", times)]).unwrap();
        let found =
            cast_to_schema(&batch, &schema_of(&["departure_utc", "tail_number", "skew_se_s"]).unwrap())
                .unwrap();
        assert_eq!(found.column(1).data_type(), &dictionary());
        assert_eq!(found.column(2).null_count(), 3);
        let query = Query {
            tail_number: Some("N1".into()),
            since_utc: Some(Timestamp::from_second(2).unwrap()),
            ..Query::default()
        };
        assert_eq!(fits(&query, &found).unwrap(), BooleanArray::from(vec![false, false, true]));
        assert!(cast_to_schema(&batch, &schema_of(&["serial_number"]).unwrap()).is_err());
    }

    /// A NIS that overflowed, of a log with samples of 1e300, was stored as infinity: every trend ended with exit code 2.
    #[test]
    fn an_infinite_number_is_read_as_missing() {
        let schema = schema_of(&["nis"]).unwrap();
        let nis: ArrayRef = Arc::new(Float64Array::from(vec![
            Some(1.0),
            Some(f64::INFINITY),
            None,
            Some(f64::NAN),
            Some(2.0),
        ]));
        let found = without_infinities(&RecordBatch::try_new(schema, vec![nis]).unwrap()).unwrap();
        let wanted = Float64Array::from(vec![Some(1.0), None, None, None, Some(2.0)]);
        assert_eq!(found.column(0).as_primitive::<Float64Type>(), &wanted);
    }
}
