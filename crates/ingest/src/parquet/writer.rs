//! Parquet writer for simulated logs, truth tables and traces. Files are written under another name and renamed, so no
//! reader sees a partial file.

use std::fs::{self, File};
use std::io::{BufWriter, Write};
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
use parquet::file::metadata::{
    ColumnChunkMetaData, KeyValue, ParquetMetaDataBuilder, ParquetMetaDataReader, ParquetMetaDataWriter,
};
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::writer::TrackedWrite;
use parquet::schema::types::ColumnPath;
use polars_parquet_format::thrift::protocol::TCompactOutputProtocol;

use crate::error::{Error, Fault, bad_table};
use crate::io::retry;
use crate::parquet::page_header;

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
        copy_with_checksums(&File::open(&bare)?, &mut to)?;
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

/// Copies a Parquet file page by page, each with its checksum (CRC-32 of its body, `PageHeader.crc`), which the Arrow
/// library's writer leaves out. Headers grow by a few bytes, so the footer gets the new offsets.
fn copy_with_checksums(from: &File, to: &mut File) -> Result<(), ParquetError> {
    let footer = ParquetMetaDataReader::new().parse_and_finish(from)?;
    let mut sink = TrackedWrite::new(BufWriter::with_capacity(1 << 20, to));
    sink.write_all(b"PAR1")?;
    let mut groups = Vec::with_capacity(footer.num_row_groups());
    for group in footer.row_groups() {
        let start = sink.bytes_written() as i64;
        let columns =
            group.columns().iter().map(|chunk| copy_chunk(from, &mut sink, chunk, group.num_rows()));
        let columns = columns.collect::<Result<_, _>>()?;
        groups
            .push(group.clone().into_builder().set_column_metadata(columns).set_file_offset(start).build()?);
    }
    let footer = ParquetMetaDataBuilder::new(footer.file_metadata().clone()).set_row_groups(groups).build();
    ParquetMetaDataWriter::new(&mut sink, &footer).finish()?;
    Ok(sink.flush()?)
}

fn copy_chunk(
    from: &File,
    sink: &mut TrackedWrite<impl Write>,
    chunk: &ColumnChunkMetaData,
    rows: i64,
) -> Result<ColumnChunkMetaData, ParquetError> {
    let began = sink.bytes_written() as i64;
    let mut first_data = None;
    for mut page in page_header::bounded(from, chunk, rows).map_err(ParquetError::General)? {
        let mut body = vec![0; page.header.compressed_page_size as usize];
        retry::read_exact(from, &mut body, page.body_start)?;
        if !page.is_dictionary() {
            first_data.get_or_insert(sink.bytes_written() as i64);
        }
        page.header.crc = Some(crc32fast::hash(&body) as i32);
        let mut protocol = TCompactOutputProtocol::new(&mut *sink);
        page.header.write_to_out_protocol(&mut protocol).map_err(|e| ParquetError::General(e.to_string()))?;
        sink.write_all(&body)?;
    }
    let bytes = sink.bytes_written() as i64 - began;
    chunk
        .clone()
        .into_builder()
        .set_data_page_offset(first_data.unwrap_or(began))
        .set_dictionary_page_offset(chunk.dictionary_page_offset().map(|_| began))
        .set_total_compressed_size(bytes)
        // Both sizes count the headers, which alone have grown.
        .set_total_uncompressed_size(chunk.uncompressed_size() + bytes - chunk.compressed_size())
        .build()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parquet::log_file::{LogFile, Scan};

    /// Every seventh byte of the pages, flipped: with checksums none of them gives a number.
    #[test]
    fn no_flipped_byte_under_a_checksum_gives_a_number() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("x.parquet");
        let values = Column::Real((0..1000).map(f64::from).collect());
        write_parquet(&file, &[("x".to_owned(), values)], &[]).unwrap();
        let read = || -> Result<(), Error> { LogFile::open(&file)?.scan(&["x"], Scan::PLAIN, |_| Ok(())) };
        read().unwrap();
        assert!(LogFile::open(&file).unwrap().has_page_checksums(&["x"]).unwrap());
        let bytes = fs::read(&file).unwrap();
        let (_, trailer) = bytes.split_at(bytes.len() - 8);
        let footer = u32::from_le_bytes(trailer[..4].try_into().unwrap()) as usize;
        for at in (4..bytes.len() - 8 - footer).step_by(7) {
            let mut damaged = bytes.clone();
            damaged[at] ^= 0x10;
            fs::write(&file, damaged).unwrap();
            assert!(read().is_err(), "byte {at} was flipped and read");
        }
    }
}
