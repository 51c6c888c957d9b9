//! Parquet writer for simulated logs, truth tables and traces. Files are written under another name and renamed, so no
//! reader sees a partial file.

use std::fs::{self, File};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use arrow::array::{
    ArrayRef, Float32Array, Float64Array, RecordBatch, StringArray, TimestampMicrosecondArray,
};
use arrow::datatypes::DataType;
use arrow::error::ArrowError;
use jiff::Timestamp;
use parquet::arrow::ArrowWriter;
use parquet::basic::{self, Compression, ZstdLevel};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::schema::types::ColumnPath;

use crate::error::{Error, Fault, bad_table};
use crate::parquet::page_crc;

/// Files that this process began.
static WRITTEN: AtomicU64 = AtomicU64::new(0);

/// A column to be written.
#[derive(Debug, Clone, PartialEq)]
pub enum Column {
    /// Numbers in full; NaN is written as null.
    Real(Vec<f64>),
    /// Numbers rounded to 24 bits, as recorders keep them; NaN is written as null.
    Single(Vec<f64>),
    /// Text.
    Text(Vec<String>),
    /// Instants, UTC, to the microsecond.
    Instant(Vec<Timestamp>),
}

impl Column {
    fn array(&self) -> ArrayRef {
        let present = |v: &f64| (!v.is_nan()).then_some(*v);
        match self {
            Self::Real(v) => Arc::new(v.iter().map(present).collect::<Float64Array>()),
            Self::Single(v) => {
                Arc::new(v.iter().map(|v| present(v).map(|v| v as f32)).collect::<Float32Array>())
            }
            Self::Text(v) => Arc::new(v.iter().map(Some).collect::<StringArray>()),
            Self::Instant(v) => {
                let ticks = TimestampMicrosecondArray::from_iter_values(v.iter().map(|t| t.as_microsecond()));
                Arc::new(ticks.with_timezone("UTC"))
            }
        }
    }
}

/// How numbers lie in the file; always under zstd, with a checksum on every page.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Encoding {
    /// Byte stream split: the smallest, and in this program the quickest to read (`docs/columns.md`).
    #[default]
    Split,
    /// Dictionary while it pays, then plain: every reader knows it, also those that know no byte stream
    /// split of double floats, Spark 4.2 among them.
    Compatible,
}

/// Writes columns of one length as a Parquet file with key-value metadata, numbers split.
///
/// # Errors
/// As `write_encoded`.
pub fn write_parquet(
    file: &Path,
    columns: &[(String, Column)],
    metadata: &[(String, String)],
) -> Result<(), Error> {
    write_encoded(file, columns, metadata, Encoding::Split)
}

/// Writes columns of one length as a Parquet file with key-value metadata.
pub(crate) fn write_encoded(
    file: &Path,
    columns: &[(String, Column)],
    metadata: &[(String, String)],
    encoding: Encoding,
) -> Result<(), Error> {
    let bad = |e: ParquetError| match object_io::system_error(&e.to_string()) {
        Some(source) => Fault::new(
            "cannot_write",
            format!("the file cannot be written: {source}"),
            "make room on the disk or check the permissions, or name another folder",
        )
        .in_file(file),
        None => bad_table(e).in_file(file),
    };
    let batch = batch(columns).map_err(|e| bad(e.into()))?;
    // Two processes, or workers, may write files of one name.
    let own = format!("{}-{}", std::process::id(), WRITTEN.fetch_add(1, Ordering::Relaxed));
    let [bare, beside] = ["bare", "part"].map(|end| file.with_extension(format!("{own}.{end}")));
    let write = || {
        file.parent().map_or(Ok(()), fs::create_dir_all)?;
        write_batch(object_io::create_fresh(&bare)?, &batch, properties(&batch, metadata, encoding))?;
        let mut to = object_io::create_fresh(&beside)?;
        page_crc::copy(&File::open(&bare)?, &mut to)?;
        to.sync_all()?;
        fs::remove_file(&bare)?;
        Ok(fs::rename(&beside, file)?)
    };
    write().map_err(|e| {
        // A disk may be full: what was begun must not fill it.
        for begun in [&bare, &beside] {
            let _ = fs::remove_file(begun);
        }
        bad(e)
    })
}

pub(crate) fn write_batch(
    sink: File,
    batch: &RecordBatch,
    properties: WriterProperties,
) -> parquet::errors::Result<()> {
    let mut writer = ArrowWriter::try_new(sink, batch.schema(), Some(properties))?;
    writer.write(batch)?;
    writer.close().map(drop)
}

/// Columns of one length as they would be read back.
///
/// # Errors
/// When the columns differ in length.
pub fn batch(columns: &[(String, Column)]) -> Result<RecordBatch, ArrowError> {
    RecordBatch::try_from_iter(columns.iter().map(|(name, column)| (name, column.array())))
}

fn properties(batch: &RecordBatch, metadata: &[(String, String)], encoding: Encoding) -> WriterProperties {
    let pairs = metadata.iter().map(|(key, value)| KeyValue::new(key.clone(), value.clone())).collect();
    let mut builder = WriterProperties::builder()
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        .set_key_value_metadata(Some(pairs))
        // A page index would speak of places that the checksums move.
        .set_offset_index_disabled(true)
        .set_statistics_enabled(EnabledStatistics::Chunk)
        .set_created_by(concat!("freeplay ", env!("CARGO_PKG_VERSION")).to_owned());
    for field in batch.schema().fields() {
        let is_number = matches!(field.data_type(), DataType::Float64 | DataType::Float32);
        if is_number && encoding == Encoding::Split {
            let path = ColumnPath::from(field.name().as_str());
            builder = builder
                .set_column_dictionary_enabled(path.clone(), false)
                .set_column_encoding(path, basic::Encoding::BYTE_STREAM_SPLIT);
        }
    }
    builder.build()
}
