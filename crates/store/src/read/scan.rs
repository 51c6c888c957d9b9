//! Scan of data files: the wanted columns of the matching rows, as Arrow.
//!
//! A column of a later release is empty, and a column that this release does not know is not read.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::thread::ScopedJoinHandle;

use arrow::array::{
    Array, ArrayRef, AsArray, BooleanArray, RecordBatch, Scalar, StringArray, TimestampMicrosecondArray,
    new_null_array,
};
use arrow::compute::kernels::cmp::{gt_eq, lt_eq};
use arrow::compute::{and, cast, nullif};
use arrow::datatypes::{DataType, Field, Float64Type, Schema, SchemaRef, TimestampMicrosecondType};
use arrow::error::ArrowError;
use parquet::arrow::ProjectionMask;
use parquet::arrow::arrow_reader::{
    ArrowPredicate, ArrowPredicateFn, ArrowReaderMetadata, ArrowReaderOptions,
    ParquetRecordBatchReaderBuilder, RowFilter,
};

use crate::delta::data_file::GROUP_ROWS;
use crate::delta::file_stats::Stats;
use crate::error::Error;
use crate::handle::Store;

type Builder = ParquetRecordBatchReaderBuilder<File>;

/// Rows whose value in a column lies between two values, both included.
#[derive(Debug, Clone)]
pub(crate) struct Condition {
    pub(crate) column: &'static str,
    /// The first and the last value: two texts, or two times in µs UTC.
    bounds: ArrayRef,
}

impl Condition {
    /// Texts from `first` to `last`, byte by byte.
    pub(crate) fn texts(column: &'static str, first: &str, last: &str) -> Self {
        Self { column, bounds: Arc::new(StringArray::from(vec![first, last])) }
    }

    pub(crate) fn times(column: &'static str, first_us: i64, last_us: i64) -> Self {
        let bounds = TimestampMicrosecondArray::from(vec![first_us, last_us]).with_timezone("UTC");
        Self { column, bounds: Arc::new(bounds) }
    }

    /// Whether a file may hold a matching row, by its statistics.
    pub(crate) fn may_be_in(&self, file: &Stats) -> bool {
        if let Some(texts) = self.bounds.as_string_opt::<i32>() {
            return file.may_hold(self.column, texts.value(0), texts.value(1));
        }
        let times = self.bounds.as_primitive::<TimestampMicrosecondType>();
        let (earliest, latest) = file.times_us(self.column);
        times.value(0) <= latest && earliest <= times.value(1)
    }

    pub(crate) fn matches(&self, values: &ArrayRef) -> Result<BooleanArray, ArrowError> {
        // Another program may have given the values another form.
        let is_coded = values.data_type() == &dictionary();
        let values = if is_coded { Arc::clone(values) } else { cast(values, self.bounds.data_type())? };
        let [first, last] = [0, 1].map(|at| Scalar::new(self.bounds.slice(at, 1)));
        and(&gt_eq(&values, &first)?, &lt_eq(&values, &last)?)
    }

    fn predicate(&self, builder: &Builder) -> Box<dyn ArrowPredicate> {
        let condition = self.clone();
        let mask = mask(builder, [self.column].into_iter());
        Box::new(ArrowPredicateFn::new(mask, move |batch| match batch.columns() {
            [values] => condition.matches(values),
            _ => Ok(vec![false; batch.num_rows()].into()),
        }))
    }
}

pub(crate) fn matches(batch: &RecordBatch, conditions: &[Condition]) -> Result<BooleanArray, ArrowError> {
    let all = BooleanArray::from(vec![true; batch.num_rows()]);
    conditions.iter().try_fold(all, |mask, condition| {
        let column = batch.column(batch.schema_ref().index_of(condition.column)?);
        and(&mask, &condition.matches(column)?)
    })
}

impl Store {
    /// The wanted columns of a file's matching rows, once the file's digest is verified.
    ///
    /// # Errors
    /// [`Error::Damaged`] when the file is not the one that was committed, and as [`read_file`].
    pub(crate) fn read_file(
        &self,
        path: &Path,
        schema: &SchemaRef,
        conditions: &[Condition],
    ) -> Result<Vec<RecordBatch>, Error> {
        self.check(path)?;
        read_file(path, schema, conditions)
    }

    /// The wanted columns of the matching rows of several files of one table, in the order of the files. As many threads read
    /// them as the machine has processors.
    pub(crate) fn read_files(
        &self,
        files: &[PathBuf],
        schema: &SchemaRef,
        conditions: &[Condition],
    ) -> Result<Vec<RecordBatch>, Error> {
        read_each(files, schema, |file| self.read_file(file, schema, conditions))
    }
}

/// What a function reads of each file, in the order of the files, one empty batch where that is nothing; or its first error.
pub(crate) fn read_each(
    files: &[PathBuf],
    schema: &SchemaRef,
    read_file: impl Fn(&Path) -> Result<Vec<RecordBatch>, Error> + Sync,
) -> Result<Vec<RecordBatch>, Error> {
    let threads = std::thread::available_parallelism().map_or(1, std::num::NonZero::get).min(files.len());
    let parts: Vec<OnceLock<Vec<RecordBatch>>> = files.iter().map(|_| OnceLock::new()).collect();
    let left = Mutex::new(files.iter().zip(&parts));
    let next = || left.lock().unwrap_or_else(PoisonError::into_inner).next();
    let read = || -> Result<(), Error> {
        while let Some((file, part)) = next() {
            let batches = read_file(file)?;
            part.get_or_init(|| batches);
        }
        Ok(())
    };
    std::thread::scope(|scope| {
        let others: Vec<_> = (1..threads).map(|_| scope.spawn(read)).collect();
        read()?;
        let join =
            |other: ScopedJoinHandle<'_, _>| other.join().unwrap_or_else(|e| std::panic::resume_unwind(e));
        others.into_iter().try_for_each(join)
    })?;
    let batches: Vec<RecordBatch> = parts.into_iter().filter_map(OnceLock::into_inner).flatten().collect();
    Ok(if batches.is_empty() { vec![RecordBatch::new_empty(Arc::clone(schema))] } else { batches })
}

/// The wanted columns of a file's matching rows.
///
/// # Errors
/// [`Error::Io`], [`Error::Parquet`] and [`Error::Arrow`] when the file cannot be read, or lacks a column that is never
/// empty.
pub(crate) fn read_file(
    path: &Path,
    schema: &SchemaRef,
    conditions: &[Condition],
) -> Result<Vec<RecordBatch>, Error> {
    let builder = opened(path, schema)?;
    let predicates = conditions.iter().map(|one| one.predicate(&builder)).collect();
    let mask = mask(&builder, schema.fields().iter().map(|field| field.name().as_str()));
    // A group's dictionary serves its rows alone.
    let rows = builder.with_projection(mask).with_batch_size(GROUP_ROWS);
    let rows = rows.with_row_filter(RowFilter::new(predicates)).build()?;
    rows.map(|batch| Ok(cast_to_schema(&batch?, schema)?)).collect()
}

/// A file whose text columns remain dictionaries, except those that are wanted as plain text.
fn opened(path: &Path, schema: &Schema) -> Result<Builder, Error> {
    let file = File::open(path).map_err(Error::io(path, "opened"))?;
    let found = ArrowReaderMetadata::load(&file, ArrowReaderOptions::new())?;
    let is_plain =
        |name: &str| schema.field_with_name(name).is_ok_and(|field| field.data_type() == &DataType::Utf8);
    let field =
        |field: &Arc<Field>| if is_plain(field.name()) { field.as_ref().clone() } else { coded(field) };
    let fields: Vec<Field> = found.schema().fields().iter().map(field).collect();
    let options = ArrowReaderOptions::new().with_schema(Arc::new(Schema::new(fields)));
    let metadata = ArrowReaderMetadata::try_new(Arc::clone(found.metadata()), options)?;
    Ok(ParquetRecordBatchReaderBuilder::new_with_metadata(file, metadata))
}

fn mask<'a>(builder: &Builder, names: impl Iterator<Item = &'a str>) -> ProjectionMask {
    let roots: Vec<usize> = names.filter_map(|name| builder.schema().index_of(name).ok()).collect();
    ProjectionMask::roots(builder.parquet_schema(), roots)
}

fn cast_to_schema(batch: &RecordBatch, schema: &SchemaRef) -> Result<RecordBatch, ArrowError> {
    let column = |field: &Arc<Field>| match batch.column_by_name(field.name()) {
        Some(column) if field.is_nullable() => without_infinities(cast(column, field.data_type())?),
        Some(column) => cast(column, field.data_type()),
        None => Ok(new_null_array(field.data_type(), batch.num_rows())),
    };
    let mut columns = schema.fields().iter().map(column).collect::<Result<Vec<ArrayRef>, _>>()?;
    // The reader takes memory for a whole batch, of which a condition may leave a few rows.
    columns.iter_mut().for_each(Array::shrink_to_fit);
    RecordBatch::try_new(Arc::clone(schema), columns)
}

/// A column whose numbers are finite or missing: an infinite diagnostic of one refused flight, written by a release
/// before 2026-11-23, must not refuse the whole table.
fn without_infinities(column: ArrayRef) -> Result<ArrayRef, ArrowError> {
    match column.as_primitive_opt::<Float64Type>() {
        Some(numbers) if numbers.values().iter().any(|value| !value.is_finite()) => {
            nullif(numbers, &BooleanArray::from_unary(numbers, |value| !value.is_finite()))
        }
        _ => Ok(column),
    }
}

/// Some of a schema's columns, with texts as dictionaries.
pub(crate) fn only(schema: &Schema, names: &[&str]) -> Result<SchemaRef, Error> {
    let fields = names.iter().map(|name| Ok(coded(schema.field_with_name(name)?)));
    Ok(Arc::new(Schema::new(fields.collect::<Result<Vec<_>, Error>>()?)))
}

/// A column of text as dictionary codes, any other as it is.
pub(crate) fn coded(field: &Field) -> Field {
    match field.data_type() {
        DataType::Utf8 => field.clone().with_data_type(dictionary()),
        _ => field.clone(),
    }
}

fn dictionary() -> DataType {
    DataType::Dictionary(Box::new(DataType::Int32), Box::new(DataType::Utf8))
}

#[cfg(test)]
mod tests {
    use arrow::array::{Float64Array, LargeStringArray, TimestampNanosecondArray};
    use parquet::arrow::ArrowWriter;
    use parquet::file::properties::WriterProperties;
    use records::GapRecord;

    use super::*;

    /// Files that another program wrote may hold long texts and nanoseconds, and lack what came later.
    #[test]
    fn a_column_is_filtered_and_read_in_one_form_whatever_form_a_file_has() {
        let dir = tempfile::tempdir().unwrap();
        let texts: ArrayRef = Arc::new(LargeStringArray::from(vec!["N1", "N2", "N1"]));
        let times = TimestampNanosecondArray::from(vec![1_000_000_000, 2_000_000_000, 3_000_000_000]);
        let times: ArrayRef = Arc::new(times.with_timezone("UTC"));
        let batch = RecordBatch::try_from_iter([("tail_number", texts), ("departure_utc", times)]).unwrap();
        let file = dir.path().join("a");
        let groups = WriterProperties::builder().set_max_row_group_row_count(Some(2)).build();
        let mut writer =
            ArrowWriter::try_new(File::create(&file).unwrap(), batch.schema(), Some(groups)).unwrap();
        writer.write(&batch).unwrap();
        writer.close().unwrap();
        let schema = |names: &[&str]| only(&GapRecord::schema(), names).unwrap();
        let wanted = schema(&["departure_utc", "tail_number", "skew_se_s"]);
        let found = read_file(&file, &wanted, &[]).unwrap().remove(0);
        assert_eq!(found.column(1).data_type(), &dictionary());
        assert_eq!((found.num_rows(), found.column(2).null_count()), (3, 3));
        let tail = Condition::texts("tail_number", "N1", "N1");
        let since = Condition::times("departure_utc", 2_000_000, i64::MAX);
        let found = read_file(&file, &wanted, &[tail, since]).unwrap();
        assert_eq!(found.iter().map(RecordBatch::num_rows).sum::<usize>(), 1);
        assert!(read_file(&file, &schema(&["serial_number"]), &[]).is_err());
    }

    /// A NIS that overflowed, of a log with samples of 1e300, was stored as infinity: every trend ended with exit code 2.
    #[test]
    fn an_infinite_number_is_read_as_missing() {
        let nis = Float64Array::from(vec![Some(1.0), Some(f64::INFINITY), None, Some(f64::NAN), Some(2.0)]);
        let found = without_infinities(Arc::new(nis)).unwrap();
        let wanted = Float64Array::from(vec![Some(1.0), None, None, None, Some(2.0)]);
        assert_eq!(found.as_primitive::<Float64Type>(), &wanted);
    }
}
