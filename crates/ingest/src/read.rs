//! Columns out of a Parquet file: only those asked for, one at a time, checked against the footer.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use arrow::array::{Array, ArrayRef, AsArray, PrimitiveArray};
use arrow::compute::cast;
use arrow::datatypes::{DataType, Float32Type, Float64Type, Int64Type, TimeUnit as ArrowTimeUnit};
use jiff::Timestamp;
use parquet::arrow::ProjectionMask;
use parquet::arrow::arrow_reader::{
    ArrowReaderMetadata, ArrowReaderOptions, ParquetRecordBatchReaderBuilder,
};

use crate::clock::Stamps;
use crate::error::{Error, Fault};
use crate::pattern::nearest;
use crate::unit::TimeUnit;

/// Rows decoded at a time: small enough for the cache, large enough to forget the cost of a batch.
const BATCH_ROWS: usize = 8192;

/// An open Parquet file, its footer read and nothing else.
#[derive(Debug)]
pub(crate) struct Columns {
    path: PathBuf,
    file: File,
    footer: ArrowReaderMetadata,
}

impl Columns {
    pub(crate) fn open(path: &Path) -> Result<Self, Error> {
        let fail = |fault| Error::new(path, fault);
        let file = File::open(path).map_err(|source| fail(Fault::Unreadable { source }))?;
        let length = file.metadata().map_err(|source| fail(Fault::Unreadable { source }))?;
        if length.is_dir() {
            let source = std::io::Error::from(std::io::ErrorKind::IsADirectory);
            return Err(fail(Fault::Unreadable { source }));
        }
        if length.len() == 0 {
            return Err(fail(Fault::Empty));
        }
        // The embedded Arrow schema adds only zones and dictionaries, and its decoder panics on some damage.
        let options = ArrowReaderOptions::new().with_skip_arrow_metadata(true);
        let footer = ArrowReaderMetadata::load(&file, options)
            .map_err(|e| fail(Fault::NotParquet { detail: e.to_string() }))?;
        let columns = Self { path: path.to_owned(), file, footer };
        if columns.rows() == 0 {
            return Err(columns.error(Fault::Empty));
        }
        Ok(columns)
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    pub(crate) fn error(&self, fault: Fault) -> Error {
        Error::new(&self.path, fault)
    }

    /// Rows the footer declares.
    pub(crate) fn rows(&self) -> usize {
        usize::try_from(self.footer.metadata().file_metadata().num_rows()).unwrap_or(0)
    }

    /// Names of the top-level columns, in the order of the file.
    pub(crate) fn names(&self) -> impl Iterator<Item = &str> {
        self.footer.schema().fields().iter().map(|field| field.name().as_str())
    }

    pub(crate) fn has(&self, column: &str) -> bool {
        self.names().any(|name| name == column)
    }

    /// Type of a column.
    pub(crate) fn data_type(&self, column: &str) -> Result<&DataType, Error> {
        let schema = self.footer.schema();
        schema
            .field_with_name(column)
            .map(arrow::datatypes::Field::data_type)
            .map_err(|_| self.no_column(column))
    }

    /// A value of the footer's key-value metadata.
    pub(crate) fn metadata(&self, key: &str) -> Option<&str> {
        let pairs = self.footer.metadata().file_metadata().key_value_metadata()?;
        pairs.iter().find(|pair| pair.key == key)?.value.as_deref()
    }

    fn no_column(&self, column: &str) -> Error {
        let nearest = nearest(column, self.names()).map(str::to_owned);
        self.error(Fault::ColumnMissing { column: column.to_owned(), nearest })
    }

    /// Hands every batch of one column to `take`, and checks that as many rows came as were declared.
    fn each_batch(
        &self,
        column: &str,
        mut take: impl FnMut(&ArrayRef) -> Result<(), Fault>,
    ) -> Result<(), Error> {
        let root = self.footer.schema().index_of(column).map_err(|_| self.no_column(column))?;
        let decode = |group: Option<usize>, detail: String| {
            let row_group = group.map(|g| g as u64);
            self.error(Fault::Decode { column: column.to_owned(), row_group, detail })
        };
        let mut rows = 0;
        for group in 0..self.footer.metadata().num_row_groups() {
            let file = self.file.try_clone().map_err(|source| self.error(Fault::Unreadable { source }))?;
            let builder = ParquetRecordBatchReaderBuilder::new_with_metadata(file, self.footer.clone());
            // By index: a name with a dot in it would be taken for a path into a nest.
            let mask = ProjectionMask::roots(builder.parquet_schema(), [root]);
            let reader = builder
                .with_projection(mask)
                .with_row_groups(vec![group])
                .with_batch_size(BATCH_ROWS)
                .build();
            for batch in reader.map_err(|e| decode(Some(group), e.to_string()))? {
                let batch = batch.map_err(|e| decode(Some(group), e.to_string()))?;
                rows += batch.num_rows();
                take(batch.column(0)).map_err(|fault| self.error(fault))?;
            }
        }
        if rows != self.rows() {
            let (found, declared) = (rows as u64, self.rows() as u64);
            return Err(self.error(Fault::RowCount { column: column.to_owned(), found, declared }));
        }
        Ok(())
    }

    /// One column as numbers; a null is NaN.
    pub(crate) fn numbers(&self, column: &str) -> Result<Vec<f64>, Error> {
        // The footer may lie about the rows; what it claims is a hint, not a promise.
        let mut values = Vec::with_capacity(self.rows().min(1 << 26));
        self.each_batch(column, |array| append_numbers(column, array, &mut values))?;
        Ok(values)
    }

    /// One column as text that must not change; `None` when it is null throughout.
    pub(crate) fn constant(&self, column: &str, fact: &'static str) -> Result<Option<String>, Error> {
        let mut first: Option<String> = None;
        let mut row = 0_u64;
        self.each_batch(column, |array| {
            let text =
                cast(array, &DataType::Utf8).map_err(|_| column_type(column, array, "text or numbers"))?;
            for value in text.as_string::<i32>() {
                match (value, &first) {
                    (Some(value), Some(before)) if value != before => {
                        let (found, before) = (value.to_owned(), before.clone());
                        return Err(Fault::IdentityChanges {
                            fact,
                            column: column.to_owned(),
                            row,
                            found,
                            before,
                        });
                    }
                    (Some(value), None) => first = Some(value.to_owned()),
                    _ => {}
                }
                row += 1;
            }
            Ok(())
        })?;
        Ok(first)
    }

    /// The time column, in seconds since its first stamp.
    pub(crate) fn stamps(&self, column: &str, unit: Option<TimeUnit>) -> Result<Stamps, Error> {
        match (self.data_type(column)?.clone(), unit) {
            (DataType::Timestamp(arrow_unit, zone), _) => {
                let stamps = self.whole_stamps(column, per_second(arrow_unit), true)?;
                Ok(Stamps { is_local: zone.is_none(), ..stamps })
            }
            (found, None) => {
                let found = found.to_string();
                Err(self.error(Fault::TimeUnit { column: column.to_owned(), found }))
            }
            (found, Some(unit)) if found.is_integer() => self.whole_stamps(column, unit.per_second(), false),
            (_, Some(unit)) => self.real_stamps(column, unit.per_second()),
        }
    }

    /// Counted ticks: differences are exact before they become seconds.
    fn whole_stamps(&self, column: &str, per_second: f64, absolute: bool) -> Result<Stamps, Error> {
        let (mut seconds, mut first) = (Vec::with_capacity(self.rows().min(1 << 26)), None);
        self.each_batch(column, |array| {
            let ticks =
                cast(array, &DataType::Int64).map_err(|_| column_type(column, array, "time stamps"))?;
            let ticks: &PrimitiveArray<Int64Type> = ticks.as_primitive();
            seconds.extend(ticks.iter().map(|tick| {
                tick.map_or(f64::NAN, |tick| {
                    tick.wrapping_sub(*first.get_or_insert(tick)) as f64 / per_second
                })
            }));
            Ok(())
        })?;
        let start_utc = first.filter(|_| absolute).and_then(|tick| instant(tick, per_second));
        Ok(Stamps { column: column.to_owned(), seconds, start_utc, is_local: false })
    }

    fn real_stamps(&self, column: &str, per_second: f64) -> Result<Stamps, Error> {
        let mut seconds = self.numbers(column)?;
        let first = seconds.iter().copied().find(|s| !s.is_nan()).unwrap_or(0.0);
        for s in &mut seconds {
            *s = (*s - first) / per_second;
        }
        Ok(Stamps { column: column.to_owned(), seconds, start_utc: None, is_local: false })
    }

    /// blake3 of the footer and of the chunks of the named columns, in the order of the file.
    ///
    /// It says that what was read is what was read before, whatever the file is called now and
    /// whatever else was added to it.
    pub(crate) fn digest(&self, names: &[String]) -> Result<String, Error> {
        let unreadable = |source| self.error(Fault::Unreadable { source });
        let mut file = self.file.try_clone().map_err(unreadable)?;
        let length = file.metadata().map_err(unreadable)?.len();
        let mut hash = blake3::Hasher::new();
        let mut buffer = Vec::new();
        for group in self.footer.metadata().row_groups() {
            let wanted = |c: &&parquet::file::metadata::ColumnChunkMetaData| {
                c.column_path().parts().first().is_some_and(|root| names.contains(root))
            };
            for chunk in group.columns().iter().filter(wanted) {
                let (start, bytes) = chunk.byte_range();
                feed(&mut hash, &mut file, &mut buffer, start, bytes.min(length.saturating_sub(start)))
                    .map_err(unreadable)?;
            }
        }
        let footer_start = length.saturating_sub(self.footer_bytes(&mut file, length).map_err(unreadable)?);
        feed(&mut hash, &mut file, &mut buffer, footer_start, length - footer_start).map_err(unreadable)?;
        Ok(hash.finalize().to_hex().to_string())
    }

    /// Metadata length, which its own trailer states, plus the eight bytes of that trailer.
    #[expect(clippy::unused_self, reason = "it belongs to the open file, whose footer was already parsed")]
    fn footer_bytes(&self, file: &mut File, length: u64) -> std::io::Result<u64> {
        let mut trailer = [0; 4];
        file.seek(SeekFrom::Start(length.saturating_sub(8)))?;
        file.read_exact(&mut trailer)?;
        Ok((u64::from(u32::from_le_bytes(trailer)) + 8).min(length))
    }
}

/// Reads a stretch of the file into the hash, a mebibyte at a time.
fn feed(
    hash: &mut blake3::Hasher,
    file: &mut File,
    buffer: &mut Vec<u8>,
    start: u64,
    bytes: u64,
) -> std::io::Result<()> {
    const CHUNK: u64 = 1 << 20;
    file.seek(SeekFrom::Start(start))?;
    let mut left = bytes;
    while left > 0 {
        buffer.resize(left.min(CHUNK) as usize, 0);
        file.read_exact(buffer)?;
        hash.update(buffer);
        left -= buffer.len() as u64;
    }
    Ok(())
}

fn column_type(column: &str, array: &ArrayRef, wanted: &'static str) -> Fault {
    Fault::ColumnType { column: column.to_owned(), found: array.data_type().to_string(), wanted }
}

fn per_second(unit: ArrowTimeUnit) -> f64 {
    match unit {
        ArrowTimeUnit::Second => 1.0,
        ArrowTimeUnit::Millisecond => 1e3,
        ArrowTimeUnit::Microsecond => 1e6,
        ArrowTimeUnit::Nanosecond => 1e9,
    }
}

fn instant(tick: i64, per_second: f64) -> Option<Timestamp> {
    let nanoseconds = i128::from(tick) * (1e9 / per_second) as i128;
    Timestamp::from_nanosecond(nanoseconds).ok()
}

/// Appends any numeric Arrow array as `f64`; nulls become NaN.
fn append_numbers(column: &str, array: &ArrayRef, into: &mut Vec<f64>) -> Result<(), Fault> {
    match array.data_type() {
        DataType::Float64 => append_primitive(array.as_primitive::<Float64Type>(), into, |v| v),
        DataType::Float32 => append_primitive(array.as_primitive::<Float32Type>(), into, f64::from),
        kind if kind.is_numeric() || matches!(kind, DataType::Boolean | DataType::Dictionary(..)) => {
            let real = cast(array, &DataType::Float64).map_err(|_| column_type(column, array, "numbers"))?;
            append_primitive(real.as_primitive::<Float64Type>(), into, |v| v);
        }
        _ => return Err(column_type(column, array, "numbers")),
    }
    Ok(())
}

fn append_primitive<T: arrow::datatypes::ArrowPrimitiveType>(
    array: &PrimitiveArray<T>,
    into: &mut Vec<f64>,
    convert: impl Fn(T::Native) -> f64,
) {
    if array.null_count() == 0 {
        into.extend(array.values().iter().map(|&v| convert(v)));
    } else {
        into.extend(array.iter().map(|v| v.map_or(f64::NAN, &convert)));
    }
}
