//! Some rows of a table at a time, its columns as what they stand for: text, numbers, instants.
//!
//! A fleet's history has tens of millions of rows, so nothing is turned into text that is a number already.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{Cursor, Read, Seek};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow::array::{
    Array, ArrayRef, AsArray, Float64Array, Int32Array, PrimitiveArray, RecordBatch, StringArray,
    TimestampMicrosecondArray, new_null_array,
};
use arrow::compute::cast;
use arrow::csv::ReaderBuilder;
use arrow::csv::reader::Format;
use arrow::datatypes::{
    DataType, Field, Fields, Float64Type, Int32Type, Schema, TimeUnit, TimestampMicrosecondType,
};
use jiff::Timestamp;
use parquet::arrow::ProjectionMask;
use parquet::arrow::arrow_reader::{ArrowReaderMetadata, ArrowReaderOptions};
use parquet::file::metadata::ParquetMetaData;

use crate::bounds::{self, TABLE_COLUMNS};
use crate::error::{Error, Fault, bad_table, column_type, not_parquet};
use crate::io::byte_source::whole;
use crate::io::retry;
use crate::parquet::log_file::with_codes;
use crate::parquet::page_reader::BoundedGroups;
use crate::parquet::raw_footer::{self, caught};
use crate::tables::cell::{missing, number, utc};

/// Rows of a batch; of a CSV table of more than [`USUAL_COLUMNS`] columns, in proportion fewer.
const ROWS: usize = 65_536;
const USUAL_COLUMNS: usize = 16;

/// Some rows of a table.
#[derive(Debug, Clone)]
pub struct TableBatch {
    pub(super) file: PathBuf,
    pub(super) header: Vec<String>,
    pub(super) batch: RecordBatch,
    /// Names that the configuration gives the columns; `None` where it cannot.
    pub(super) names: Option<ColumnAliases>,
    /// Rows of the table before these.
    before: usize,
}

/// What a user's table calls the columns that we know: our name → theirs.
pub type ColumnAliases = BTreeMap<String, String>;

/// The texts of a column, trimmed, an empty one none: one for each row, or one for each code where the table has codes.
#[derive(Debug, Clone)]
pub struct StringColumn {
    codes: Option<Int32Array>,
    texts: StringArray,
}

impl StringColumn {
    /// The text of a row.
    pub fn get(&self, row: usize) -> Option<&str> {
        let at = if self.codes.is_some() { self.code(row)? } else { row };
        text_at(&self.texts, at)
    }

    /// The code of a row's text, where the table has codes.
    pub fn code(&self, row: usize) -> Option<usize> {
        self.codes.as_ref().filter(|codes| codes.is_valid(row)).map(|codes| codes.value(row) as usize)
    }

    /// Whether two rows have the same text; one text may have several codes.
    pub fn are_same(&self, a: usize, b: usize) -> bool {
        if self.codes.is_some() { self.code(a) == self.code(b) } else { self.get(a) == self.get(b) }
    }
}

/// The text of a row, trimmed; an empty one is none.
pub(super) fn text_at(texts: &StringArray, row: usize) -> Option<&str> {
    let text = texts.is_valid(row).then(|| texts.value(row).trim())?;
    (!text.is_empty()).then_some(text)
}

impl TableBatch {
    /// Rows from memory, after `before` other rows of the table; diagnostics show `name` as their file.
    pub fn new(name: &Path, batch: RecordBatch, before: usize) -> Self {
        let header = batch.schema_ref().fields().iter().map(|f| f.name().clone()).collect();
        Self { file: name.to_owned(), header, batch, names: None, before }
    }

    /// Numbers of its rows.
    pub fn rows(&self) -> Range<usize> {
        0..self.batch.num_rows()
    }

    /// Where a column stands, if it is there under one of its names.
    pub fn find(&self, names: &[&str]) -> Option<usize> {
        let column = |name: &str| self.header.iter().position(|own| own.trim() == name);
        names.iter().find_map(|name| column(self.alias(name)))
    }

    /// What this table calls a column.
    fn alias<'n>(&'n self, name: &'n str) -> &'n str {
        self.names.as_ref().and_then(|names| names.get(name)).map_or(name, String::as_str)
    }

    /// Where a column stands.
    ///
    /// # Errors
    /// When it is not there, with the nearest name that is.
    pub fn column(&self, names: &[&str]) -> Result<usize, Error> {
        let is_mapped = self.names.is_some();
        self.find(names).ok_or_else(|| missing(&self.file, self.alias(names[0]), &self.header, is_mapped))
    }

    /// A column as text; without one, all none.
    ///
    /// # Errors
    /// When it is neither text, numbers nor times.
    pub fn texts(&self, column: Option<usize>) -> Result<StringColumn, Error> {
        let coded = column.and_then(|column| self.batch.column(column).as_dictionary_opt::<Int32Type>());
        if let Some((coded, texts)) = coded.and_then(|coded| Some((coded, coded.values().as_string_opt()?))) {
            return Ok(StringColumn { codes: Some(coded.keys().clone()), texts: texts.clone() });
        }
        let texts = self.cast(column, &DataType::Utf8)?;
        Ok(StringColumn { codes: None, texts: texts.as_string().clone() })
    }

    /// A column as finite numbers; without one, all none.
    ///
    /// # Errors
    /// The first cell that is no number.
    pub fn numbers(&self, column: Option<usize>) -> Result<Float64Array, Error> {
        if let Some(index) = column.filter(|c| !self.batch.column(*c).data_type().is_numeric()) {
            // Booleans and texts are parsed, or refused.
            return self.parsed::<Float64Type>(index, number);
        }
        let numbers: Float64Array = self.cast(column, &DataType::Float64)?.as_primitive().clone();
        // The value under a null is undefined.
        let is_number = |value: Option<f64>| value.is_none_or(f64::is_finite);
        match numbers.iter().position(|value| !is_number(value)) {
            Some(row) => Err(self.error(row, column, format!("`{}` is not a number", numbers.value(row)))),
            None => Ok(numbers),
        }
    }

    /// A column as instants, µs since 1970 UTC; without one, all none.
    ///
    /// # Errors
    /// The first cell that is neither a date nor a time.
    pub fn timestamps(&self, column: Option<usize>) -> Result<TimestampMicrosecondArray, Error> {
        let wanted = DataType::Timestamp(TimeUnit::Microsecond, None);
        match column.filter(|c| !self.batch.column(*c).data_type().is_temporal()) {
            None => Ok(self.cast(column, &wanted)?.as_primitive().clone()),
            Some(index) => self
                .parsed::<TimestampMicrosecondType>(index, |text| utc(text).map(Timestamp::as_microsecond)),
        }
    }

    /// A diagnostic about a row's cell; rows count from 0 here and from 1 for people.
    pub fn error(&self, row: usize, column: Option<usize>, detail: String) -> Error {
        let mut fault = bad_table(detail).row((self.before + row) as u64 + 1);
        fault.0.column = column.and_then(|column| self.header.get(column)).cloned();
        fault.in_file(&self.file)
    }

    fn parsed<T: arrow::datatypes::ArrowPrimitiveType>(
        &self,
        column: usize,
        read: impl Fn(&str) -> Result<T::Native, String>,
    ) -> Result<PrimitiveArray<T>, Error> {
        let texts = self.texts(Some(column))?;
        let cell = |row: usize| {
            let value = texts.get(row).map(&read).transpose();
            value.map_err(|detail| self.error(row, Some(column), detail))
        };
        self.rows().map(cell).collect()
    }

    pub(super) fn cast(&self, column: Option<usize>, wanted: &DataType) -> Result<ArrayRef, Error> {
        let Some(column) = column else { return Ok(new_null_array(wanted, self.rows().len())) };
        let array = self.batch.column(column);
        cast(array, wanted).map_err(|_| {
            let found = array.data_type().to_string();
            column_type(&self.header[column], &found, "text, numbers or times").in_file(&self.file)
        })
    }
}

/// A table in parts that several may read at a time: a `.parquet` file as Parquet in its row groups, anything else
/// as CSV in one.
pub struct TableSplits {
    file: PathBuf,
    parquet: Option<ParquetTable>,
}

/// A Parquet file, the types in which its columns are read, and the mask of the columns that are read.
struct ParquetTable {
    file: Arc<File>,
    metadata: Arc<ParquetMetaData>,
    fields: Fields,
    mask: ProjectionMask,
}

impl TableSplits {
    /// Opens a table. Of Parquet only the `wanted` columns are read, where some are named; texts of the `coded`
    /// ones, which repeat, stay codes.
    ///
    /// # Errors
    /// When the file cannot be opened, or its content does not match its extension.
    pub fn open(file: &Path, wanted: Option<&[&str]>, coded: &[&str]) -> Result<Self, Error> {
        let is_parquet = file.extension().is_some_and(|e| e.eq_ignore_ascii_case("parquet"));
        let parquet = is_parquet.then(|| parquet(file, wanted, coded)).transpose();
        Ok(Self { file: file.to_owned(), parquet: parquet.map_err(|fault| fault.in_file(file))? })
    }

    /// How many parts there are: one at least.
    #[expect(clippy::len_without_is_empty, reason = "there is no table without a part")]
    pub fn len(&self) -> usize {
        self.parquet.as_ref().map_or(1, |table| table.metadata.num_row_groups().max(1))
    }

    /// The rows of some parts, in order.
    ///
    /// There is always one batch, so that a table without rows still shows its columns.
    ///
    /// # Errors
    /// As [`TableSplits::open`].
    pub fn batches(
        &self,
        parts: Range<usize>,
    ) -> Result<impl Iterator<Item = Result<TableBatch, Error>> + use<>, Error> {
        let opened = match &self.parquet {
            Some(table) => groups(table, parts),
            None => csv(&self.file),
        };
        let Rows { schema, mut batches, mut before } = opened.map_err(|fault| fault.in_file(&self.file))?;
        let (file, mut if_none) = (self.file.clone(), Some(RecordBatch::new_empty(schema)));
        Ok(std::iter::from_fn(move || {
            let empty = if_none.take();
            let batch = batches.next().or_else(|| empty.map(Ok))?;
            Some(batch.map_err(|fault| fault.in_file(&file)).map(|batch| {
                let rows = batch.num_rows();
                before += rows;
                TableBatch::new(&file, batch, before - rows)
            }))
        }))
    }
}

fn parquet(file: &Path, wanted: Option<&[&str]>, coded: &[&str]) -> Result<ParquetTable, Fault> {
    let file = whole(file)?;
    let metadata = raw_footer::read(&file, |_| Ok(()))?.metadata;
    let footer = caught(|| ArrowReaderMetadata::try_new(Arc::clone(&metadata), ArrowReaderOptions::new()));
    let fields =
        with_codes(footer.map_err(not_parquet)?.schema().fields(), |name| coded.contains(&name.trim()));
    let is_wanted = |name: &str| wanted.is_none_or(|wanted| wanted.contains(&name.trim()));
    let roots = fields.iter().enumerate().filter(|(_, field)| is_wanted(field.name())).map(|(root, _)| root);
    let mask = ProjectionMask::roots(metadata.file_metadata().schema_descr(), roots);
    Ok(ParquetTable { file, metadata, fields, mask })
}

/// Rows of an open table, in batches.
struct Rows {
    schema: Arc<Schema>,
    batches: Box<dyn Iterator<Item = Result<RecordBatch, Fault>> + Send>,
    /// Rows of the table before these.
    before: usize,
}

fn groups(table: &ParquetTable, groups: Range<usize>) -> Result<Rows, Fault> {
    let some = table.metadata.row_groups();
    let before = some.iter().take(groups.start).map(|group| group.num_rows() as usize).sum();
    let groups = groups.start..groups.end.min(some.len());
    let (file, groups) = (Arc::clone(&table.file), groups.collect());
    let rows = BoundedGroups { file, metadata: &table.metadata, groups, batch_rows: ROWS };
    let mut reader = caught(|| rows.reader(table.mask.clone(), Some(&table.fields))).map_err(not_parquet)?;
    let schema = arrow::array::RecordBatchReader::schema(&reader);
    let batch = move || caught(|| reader.next().transpose()).map_err(not_parquet).transpose();
    let batches = Box::new(std::iter::from_fn(batch));
    Ok(Rows { schema, batches, before })
}

/// The rows of a CSV file, all of whose cells are text.
fn csv(file: &Path) -> Result<Rows, Fault> {
    let mut text = Vec::new();
    let opened = whole(file)?;
    let mut opened = opened.as_ref();
    retry::with_retry(|| {
        text.clear();
        opened.rewind()?;
        opened.read_to_end(&mut text)
    })?;
    if let Some(format) = foreign(&text) {
        return Err(bad_table(format!("this is {format}: save it as CSV in UTF-8")));
    }
    // Spreadsheets open their UTF-8 with a byte order mark.
    let mark = if text.starts_with("\u{feff}".as_bytes()) { 3 } else { 0 };
    let format = Format::default().with_header(true).with_comment(b'#');
    let (header, _) = format.infer_schema(&text[mark..], Some(0)).map_err(bad_table)?;
    let names: Vec<&str> = header.fields().iter().map(|field| field.name().trim()).collect();
    if let Some(separator) =
        [';', '\t'].into_iter().find(|c| names.first().is_some_and(|first| first.contains(*c)))
    {
        let separator = separator.escape_default();
        return Err(bad_table(format!(
            "its fields are separated by `{separator}`: save it with commas, and numbers with a point"
        )));
    }
    bounds::check("columns", names.len() as u64, TABLE_COLUMNS as u64)?;
    if let Some(line) = commented_row(&text[mark..], names.len()) {
        return Err(bad_table(format!(
            "line {line} begins with `#` and has as many fields as the header: put its first field in quotes, or delete the line"
        )));
    }
    let mut known = BTreeSet::new();
    if let Some(twice) = names.iter().find(|name| !name.is_empty() && !known.insert(**name)) {
        return Err(bad_table(format!("the header has column `{twice}` twice: rename or remove one")));
    }
    let fields: Vec<Field> = names.iter().map(|name| Field::new(*name, DataType::Utf8, true)).collect();
    let schema = Arc::new(Schema::new(fields));
    let mut text = Cursor::new(text);
    text.set_position(mark as u64);
    // The reader takes the memory of a batch before it knows how many rows there are.
    let rows = ROWS / names.len().div_ceil(USUAL_COLUMNS).max(1);
    let reader = ReaderBuilder::new(Arc::clone(&schema)).with_format(format).with_batch_size(rows);
    let reader = reader.build_buffered(text).map_err(bad_table)?;
    let unread = |error| bad_table(format!("{error} (lines that are blank or comments are not counted)"));
    let batches = Box::new(reader.map(move |batch| batch.map_err(unread)));
    Ok(Rows { schema, batches, before: 0 })
}

/// The first line that is a comment by its `#`, and a row by its number of fields; the header comes before it.
fn commented_row(text: &[u8], fields: usize) -> Option<usize> {
    let lines = text.split(|byte| *byte == b'\n').zip(1..);
    let mut rows = lines.skip_while(|(line, _)| line.trim_ascii().is_empty() || line.starts_with(b"#"));
    let is_row = |line: &[u8]| line.starts_with(b"#") && line.split(|byte| *byte == b',').count() == fields;
    rows.find(|(line, _)| fields > 1 && is_row(line)).map(|(_, line)| line)
}

/// Format of a table that is no CSV in UTF-8, by its first bytes.
fn foreign(bytes: &[u8]) -> Option<&'static str> {
    match bytes {
        [b'P', b'K', 3, 4, ..] => Some("an Excel workbook"),
        [0xFF, 0xFE, ..] | [0xFE, 0xFF, ..] => Some("text in UTF-16"),
        _ => str::from_utf8(bytes).err().map(|_| "no text in UTF-8"),
    }
}

#[cfg(test)]
mod tests {
    use arrow::array::{Int64Array, TimestampSecondArray};
    use parquet::file::properties::WriterProperties;

    use super::*;
    use crate::parquet::writer::write_batch;

    fn batch(columns: Vec<(&str, ArrayRef)>) -> RecordBatch {
        RecordBatch::try_from_iter(columns).unwrap()
    }

    fn batches(file: &Path, wanted: Option<&[&str]>) -> impl Iterator<Item = Result<TableBatch, Error>> {
        let table = TableSplits::open(file, wanted, &[]).unwrap();
        table.batches(0..table.len()).unwrap()
    }

    fn parquet(batch: &RecordBatch) -> (tempfile::TempDir, PathBuf) {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("table.parquet");
        let groups = WriterProperties::builder().set_max_row_group_row_count(Some(3)).build();
        write_batch(File::create(&file).unwrap(), batch, groups).unwrap();
        (dir, file)
    }

    /// 2026-01-01 is 1,767,225,600 s after 1970 by any calendar.
    #[test]
    fn an_instant_is_the_same_as_text_as_a_day_and_as_a_stamp_of_any_zone() {
        let seconds = || TimestampSecondArray::from(vec![1_767_225_600]);
        let columns: [ArrayRef; 5] = [
            Arc::new(StringArray::from(vec!["2026-01-01T01:00:00+01:00"])),
            Arc::new(StringArray::from(vec![" 2026-01-01 "])),
            Arc::new(arrow::array::Date32Array::from(vec![20_454])),
            Arc::new(seconds()),
            Arc::new(seconds().with_timezone("+05:30")),
        ];
        for column in columns {
            let kind = column.data_type().clone();
            let batch = TableBatch::new("t".as_ref(), batch(vec![("at", column)]), 0);
            assert_eq!(batch.timestamps(Some(0)).unwrap().value(0), 1_767_225_600_000_000, "{kind}");
        }
    }

    #[test]
    fn only_columns_that_are_wanted_are_read_and_a_missing_one_is_reported() {
        let column = |n: i64| Arc::new(Int64Array::from(vec![n])) as ArrayRef;
        let (_dir, file) = parquet(&batch(vec![("a", column(1)), ("gap_mm", column(2)), ("c", column(3))]));
        let batch = batches(&file, Some(&["c", "gap_mm"])).next().unwrap().unwrap();
        assert_eq!((batch.find(&["a"]), batch.find(&["c"])), (None, Some(1)));
        let error = batch.column(&["gap_m"]).unwrap_err();
        assert!(error.diagnostic().hint.unwrap().starts_with("`gap_mm`?"));
    }

    #[test]
    fn a_bad_cell_is_counted_through_all_chunks() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("table.csv");
        let rows: String = (0..=ROWS + 7).map(|row| if row == ROWS + 4 { "x\n" } else { "1.5\n" }).collect();
        std::fs::write(&file, format!("gap_m\n{rows}")).unwrap();
        let errors = batches(&file, None).filter_map(|batch| batch.unwrap().numbers(Some(0)).err());
        let places: Vec<_> = errors.map(|e| e.diagnostic().location().unwrap()).collect();
        assert_eq!(places, [format!("column `gap_m`, row {}", ROWS + 5)]);
    }

    /// Seven rows in groups of three, some texts as codes, whatever form of text the file's writer prefers.
    #[test]
    fn parts_of_a_table_are_its_rows_in_order_and_know_how_many_are_before_them() {
        let serials: Vec<String> = (0..7).map(|row| format!(" S{} ", row / 4)).collect();
        let texts: [ArrayRef; 3] = [
            Arc::new(StringArray::from(serials.clone())),
            Arc::new(arrow::array::LargeStringArray::from(serials.clone())),
            Arc::new(arrow::array::StringViewArray::from_iter_values(serials)),
        ];
        let gaps = Float64Array::from(vec![0.0, 1.0, 2.0, 3.0, 4.0, f64::INFINITY, 6.0]);
        for serials in texts {
            let kind = serials.data_type().clone();
            let table = batch(vec![("serial", serials), ("gap_m", Arc::new(gaps.clone()))]);
            let (_dir, file) = parquet(&table);
            let parted = TableSplits::open(&file, None, &["serial"]).unwrap();
            assert_eq!(parted.len(), 3);
            let rows = |parts: Range<usize>| parted.batches(parts).unwrap().map(Result::unwrap);
            assert_eq!(rows(1..3).map(|batch| batch.rows().len()).sum::<usize>(), 4, "{kind}");
            let last = rows(2..3).next().unwrap();
            let serials = last.texts(Some(0)).unwrap();
            assert!(serials.code(0).is_some(), "{kind}");
            assert_eq!(serials.get(0), Some("S1"));
            assert_eq!(last.numbers(Some(1)).unwrap(), Float64Array::from(vec![6.0]));
            let bad = rows(1..2).next().unwrap().numbers(Some(1)).unwrap_err();
            assert_eq!(bad.diagnostic().location().unwrap(), "column `gap_m`, row 6", "{kind}");
        }
    }

    #[test]
    fn a_table_without_rows_shows_its_columns() {
        let (_dir, file) = parquet(&RecordBatch::new_empty(
            batch(vec![("gap_m", Arc::new(Int64Array::from(vec![1])))]).schema(),
        ));
        let all: Vec<TableBatch> = batches(&file, None).collect::<Result<_, _>>().unwrap();
        assert_eq!((all.len(), all[0].rows(), all[0].find(&["gap_m"])), (1, 0..0, Some(0)));
    }
}
