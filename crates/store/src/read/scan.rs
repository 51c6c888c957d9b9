//! Scan of data files: the wanted columns of the matching rows, as Arrow.
//!
//! Row groups whose statistics rule out a condition are not decoded. A column of a later release is empty, and a column
//! that this release does not know is not read.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use arrow::array::{
    Array, ArrayRef, AsArray, BooleanArray, RecordBatch, Scalar, StringArray, TimestampMicrosecondArray,
    new_null_array,
};
use arrow::compute::kernels::cmp::{gt, gt_eq, lt, lt_eq};
use arrow::compute::{and, cast, concat_batches, nullif};
use arrow::datatypes::{DataType, Field, Float64Type, Schema, SchemaRef};
use arrow::error::ArrowError;
use parquet::arrow::ProjectionMask;
use parquet::arrow::arrow_reader::statistics::StatisticsConverter;
use parquet::arrow::arrow_reader::{
    ArrowPredicate, ArrowPredicateFn, ArrowReaderMetadata, ArrowReaderOptions,
    ParquetRecordBatchReaderBuilder, RowFilter,
};

use records::row_schema::time_type;

use crate::delta::data_file::GROUP_ROWS;
use crate::delta::file_stats::Stats;
use crate::error::Error;

type Builder = ParquetRecordBatchReaderBuilder<File>;

/// Rows whose value in a column lies between two values, both included.
#[derive(Debug, Clone)]
pub(crate) struct Condition {
    pub(crate) column: &'static str,
    bounds: Bounds,
}

#[derive(Debug, Clone)]
enum Bounds {
    Texts(String, String),
    /// µs since 1970 UTC.
    Times(Option<i64>, Option<i64>),
}

impl Condition {
    /// Texts from `first` to `last`, byte by byte.
    pub(crate) fn texts(column: &'static str, first: &str, last: &str) -> Self {
        Self { column, bounds: Bounds::Texts(first.to_owned(), last.to_owned()) }
    }

    /// Times in µs UTC.
    pub(crate) fn times(column: &'static str, first_us: Option<i64>, last_us: Option<i64>) -> Self {
        Self { column, bounds: Bounds::Times(first_us, last_us) }
    }

    /// Whether a file may hold a matching row, by its statistics.
    pub(crate) fn may_be_in(&self, file: &Stats) -> bool {
        match &self.bounds {
            Bounds::Texts(first, last) => file.may_hold(self.column, first, last),
            Bounds::Times(first, last) => {
                let (earliest, latest) = file.times_us(self.column);
                first.is_none_or(|first| first <= latest) && last.is_none_or(|last| earliest <= last)
            }
        }
    }

    /// The least and the largest matching value.
    fn scalars(&self) -> [Option<Scalar<ArrayRef>>; 2] {
        let text = |text: &String| Scalar::new(Arc::new(StringArray::from(vec![text.as_str()])) as ArrayRef);
        let time = |micros: i64| {
            let time = TimestampMicrosecondArray::from(vec![micros]).with_timezone("UTC");
            Scalar::new(Arc::new(time) as ArrayRef)
        };
        match &self.bounds {
            Bounds::Texts(first, last) => [first, last].map(|bound| Some(text(bound))),
            Bounds::Times(first, last) => [first, last].map(|bound| bound.map(time)),
        }
    }

    /// Mask of the matching values.
    pub(crate) fn matches(&self, values: &ArrayRef) -> Result<BooleanArray, ArrowError> {
        // Another program may have given the values another form.
        let values = match self.bounds {
            Bounds::Texts(..) if values.data_type() == &dictionary() => Arc::clone(values),
            Bounds::Texts(..) => cast(values, &DataType::Utf8)?,
            Bounds::Times(..) => cast(values, &time_type())?,
        };
        let [first, last] = self.scalars();
        let mut mask = BooleanArray::from(vec![true; values.len()]);
        if let Some(first) = first {
            mask = and(&mask, &gt_eq(&values, &first)?)?;
        }
        if let Some(last) = last {
            mask = and(&mask, &lt_eq(&values, &last)?)?;
        }
        Ok(mask)
    }

    /// For each row group, whether its statistics rule out every row; `None` where they cannot be compared.
    fn excludes(&self, builder: &Builder) -> Option<Vec<bool>> {
        let groups = builder.metadata().row_groups();
        let stats =
            StatisticsConverter::try_new(self.column, builder.schema(), builder.parquet_schema()).ok()?;
        let mut excluded = vec![false; groups.len()];
        let mut exclude = |mask: Result<BooleanArray, ArrowError>| {
            // Statistics that are missing exclude nothing.
            let mask = mask.ok()?;
            excluded.iter_mut().zip(&mask).for_each(|(excluded, outside)| *excluded |= outside == Some(true));
            Some(())
        };
        let [first, last] = self.scalars();
        if let Some(first) = first {
            exclude(lt(&stats.row_group_maxes(groups).ok()?, &first))?;
        }
        if let Some(last) = last {
            exclude(gt(&stats.row_group_mins(groups).ok()?, &last))?;
        }
        Some(excluded)
    }

    /// The condition as a filter of rows while a file is decoded.
    fn predicate(&self, builder: &Builder) -> Box<dyn ArrowPredicate> {
        let condition = self.clone();
        let mask = mask(builder, [self.column].into_iter());
        Box::new(ArrowPredicateFn::new(mask, move |batch| match batch.columns() {
            [values] => condition.matches(values),
            _ => Ok(vec![false; batch.num_rows()].into()),
        }))
    }
}

/// The matching rows of files of one table, in the order of the files, in one batch.
///
/// # Errors
/// As [`read_file`].
pub(crate) fn read_table(
    files: &[PathBuf],
    schema: &SchemaRef,
    conditions: &[Condition],
) -> Result<RecordBatch, Error> {
    Ok(concat_batches(schema, &read_files(files, schema, conditions)?)?)
}

/// As [`read_table`], in one batch or more. Files are read by as many threads as the machine has.
///
/// # Errors
/// As [`read_file`].
pub(crate) fn read_files(
    files: &[PathBuf],
    schema: &SchemaRef,
    conditions: &[Condition],
) -> Result<Vec<RecordBatch>, Error> {
    read_each(files, schema, |file| read_file(file, schema, conditions))
}

/// What a function reads of each file, in the order of the files, one empty batch where that is nothing.
///
/// # Errors
/// The first of the function's errors.
pub(crate) fn read_each(
    files: &[PathBuf],
    schema: &SchemaRef,
    read_file: impl Fn(&Path) -> Result<Vec<RecordBatch>, Error> + Sync,
) -> Result<Vec<RecordBatch>, Error> {
    let threads = std::thread::available_parallelism().map_or(1, std::num::NonZero::get).min(files.len());
    let next = AtomicUsize::new(0);
    let read = || {
        let mut parts = Vec::new();
        let take = || {
            let at = next.fetch_add(1, Ordering::Relaxed);
            files.get(at).map(|file| (at, file))
        };
        while let Some((at, file)) = take() {
            parts.push((at, read_file(file)?));
        }
        Ok::<_, Error>(parts)
    };
    let mut parts = std::thread::scope(|scope| {
        let others: Vec<_> = (1..threads).map(|_| scope.spawn(read)).collect();
        let mut parts = read()?;
        for other in others {
            parts.extend(other.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))?);
        }
        Ok::<_, Error>(parts)
    })?;
    parts.sort_unstable_by_key(|(at, _)| *at);
    let batches: Vec<RecordBatch> = parts.into_iter().flat_map(|(_, batches)| batches).collect();
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
    let mut builder = opened(path, schema)?;
    if !conditions.is_empty() {
        let excluded: Vec<Vec<bool>> = conditions.iter().filter_map(|one| one.excludes(&builder)).collect();
        let groups = 0..builder.metadata().num_row_groups();
        let groups = groups.filter(|&group| excluded.iter().all(|excluded| !excluded[group])).collect();
        let predicates = conditions.iter().map(|one| one.predicate(&builder)).collect();
        builder = builder.with_row_groups(groups).with_row_filter(RowFilter::new(predicates));
    }
    let mask = mask(&builder, schema.fields().iter().map(|field| field.name().as_str()));
    // A group's dictionary serves its rows alone.
    let rows = builder.with_projection(mask).with_batch_size(GROUP_ROWS).build()?;
    rows.map(|batch| Ok(without_infinities(&cast_to_schema(&batch?, schema)?)?)).collect()
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

/// The columns of those names that a file has.
fn mask<'a>(builder: &Builder, names: impl Iterator<Item = &'a str>) -> ProjectionMask {
    let roots: Vec<usize> = names.filter_map(|name| builder.schema().index_of(name).ok()).collect();
    ProjectionMask::roots(builder.parquet_schema(), roots)
}

/// A batch's columns in the form wanted; a column that came with a later release is empty.
fn cast_to_schema(batch: &RecordBatch, schema: &SchemaRef) -> Result<RecordBatch, ArrowError> {
    let column = |field: &Arc<Field>| match batch.column_by_name(field.name()) {
        Some(column) => cast(column, field.data_type()),
        None => Ok(new_null_array(field.data_type(), batch.num_rows())),
    };
    let mut columns = schema.fields().iter().map(column).collect::<Result<Vec<ArrayRef>, _>>()?;
    // The reader takes memory for a whole batch, of which a condition may leave a few rows.
    columns.iter_mut().for_each(Array::shrink_to_fit);
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

    fn written(dir: &Path, name: &str, batch: &RecordBatch) -> PathBuf {
        let path = dir.join(name);
        let groups = WriterProperties::builder().set_max_row_group_row_count(Some(2)).build();
        let mut writer =
            ArrowWriter::try_new(File::create(&path).unwrap(), batch.schema(), Some(groups)).unwrap();
        writer.write(batch).unwrap();
        writer.close().unwrap();
        path
    }

    /// Files that another program wrote may hold long texts and nanoseconds, and lack what came later.
    #[test]
    fn a_column_is_filtered_and_read_in_one_form_whatever_form_a_file_has() {
        let dir = tempfile::tempdir().unwrap();
        let texts: ArrayRef = Arc::new(LargeStringArray::from(vec!["N1", "N2", "N1"]));
        let times = TimestampNanosecondArray::from(vec![1_000_000_000, 2_000_000_000, 3_000_000_000]);
        let times: ArrayRef = Arc::new(times.with_timezone("UTC"));
        let batch = RecordBatch::try_from_iter([("tail_number", texts), ("departure_utc", times)]).unwrap();
        let file = written(dir.path(), "a", &batch);
        let schema = |names: &[&str]| only(&GapRecord::schema(), names).unwrap();
        let wanted = schema(&["departure_utc", "tail_number", "skew_se_s"]);
        let found = read_table(std::slice::from_ref(&file), &wanted, &[]).unwrap();
        assert_eq!(found.column(1).data_type(), &dictionary());
        assert_eq!((found.num_rows(), found.column(2).null_count()), (3, 3));
        let tail = Condition::texts("tail_number", "N1", "N1");
        let since = Condition::times("departure_utc", Some(2_000_000), None);
        let found = read_table(std::slice::from_ref(&file), &wanted, &[tail, since]).unwrap();
        assert_eq!(found.num_rows(), 1);
        assert!(read_file(&file, &schema(&["serial_number"]), &[]).is_err());
    }

    /// Files of an earlier release lack a column: whatever the order of the files, the missing values are empty.
    #[test]
    fn files_without_a_later_column_are_read_by_time_with_empty_values() {
        let dir = tempfile::tempdir().unwrap();
        let times: ArrayRef = Arc::new(TimestampMicrosecondArray::from(vec![10, 20]).with_timezone("UTC"));
        let later: ArrayRef = Arc::new(Float64Array::from(vec![Some(1.0), Some(2.0)]));
        let fields = [("departure_utc", times, false), ("later", later, true)];
        let batch = RecordBatch::try_from_iter_with_nullable(fields).unwrap();
        let (new, old) =
            (written(dir.path(), "new", &batch), written(dir.path(), "old", &batch.project(&[0]).unwrap()));
        let since = Condition::times("departure_utc", Some(15), None);
        for (files, wanted) in
            [([old.clone(), new.clone()], [None, Some(2.0)]), ([new, old], [Some(2.0), None])]
        {
            let found = read_table(&files, &batch.schema(), std::slice::from_ref(&since)).unwrap();
            assert_eq!(found.column(1).as_primitive::<Float64Type>().iter().collect::<Vec<_>>(), wanted);
        }
    }

    #[test]
    fn a_row_group_is_passed_over_only_when_its_statistics_exclude_every_row() {
        let dir = tempfile::tempdir().unwrap();
        let texts: ArrayRef = Arc::new(StringArray::from(vec!["a", "b", "c", "d", "e"]));
        let times: ArrayRef =
            Arc::new(TimestampMicrosecondArray::from(vec![1, 2, 3, 4, 5]).with_timezone("UTC"));
        let batch = RecordBatch::try_from_iter([("text", texts), ("time", times)]).unwrap();
        let file = opened(&written(dir.path(), "a", &batch), &batch.schema()).unwrap();
        for (condition, excluded) in [
            (Condition::texts("text", "b", "b"), [false, true, true]),
            (Condition::texts("text", "b", "c"), [false, false, true]),
            (Condition::texts("text", "f", "g"), [true, true, true]),
            (Condition::times("time", Some(3), None), [true, false, false]),
            (Condition::times("time", None, Some(2)), [false, true, true]),
        ] {
            assert_eq!(condition.excludes(&file), Some(excluded.to_vec()), "{condition:?}");
        }
        assert_eq!(Condition::texts("other", "a", "b").excludes(&file), None);
        assert_eq!(Condition::texts("time", "a", "b").excludes(&file), None, "of another type");
    }

    /// A NIS that overflowed, of a log with samples of 1e300, was stored as infinity: every trend ended with exit code 2.
    #[test]
    fn an_infinite_number_is_read_as_missing() {
        let nis = Float64Array::from(vec![Some(1.0), Some(f64::INFINITY), None, Some(f64::NAN), Some(2.0)]);
        let batch = RecordBatch::try_from_iter([("nis", Arc::new(nis) as ArrayRef)]).unwrap();
        let found = without_infinities(&batch).unwrap();
        let wanted = Float64Array::from(vec![Some(1.0), None, None, None, Some(2.0)]);
        assert_eq!(found.column(0).as_primitive::<Float64Type>(), &wanted);
    }
}
