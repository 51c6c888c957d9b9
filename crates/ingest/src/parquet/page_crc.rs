//! Page checksums: the writer of the Arrow library leaves them out, so they are put in afterwards.
//!
//! A page header gets the CRC-32 of its body (Parquet format, `PageHeader.crc`), which makes it a few
//! bytes longer; so chunks move, and the footer is rewritten with their new offsets.

use std::fs::File;
use std::io::{BufWriter, Write};

use parquet::errors::ParquetError;
use parquet::file::metadata::{
    ColumnChunkMetaData, ParquetMetaDataBuilder, ParquetMetaDataReader, ParquetMetaDataWriter,
};
use parquet::file::writer::TrackedWrite;
use polars_parquet_format::thrift::protocol::TCompactOutputProtocol;

use crate::io::read_at;
use crate::parquet::page_header;

const MAGIC: &[u8; 4] = b"PAR1";

/// Copies a Parquet file page by page, each with its checksum.
pub(crate) fn copy(from: &File, to: &mut File) -> Result<(), ParquetError> {
    let footer = ParquetMetaDataReader::new().parse_and_finish(from)?;
    let mut sink = TrackedWrite::new(BufWriter::with_capacity(1 << 20, to));
    sink.write_all(MAGIC)?;
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
        read_at::read_exact(from, &mut body, page.body_start)?;
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
    use super::MAGIC;
    use crate::error::Error;
    use crate::parquet::log_file::{LogFile, Scan};
    use crate::parquet::writer::{Column, write_parquet};

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
        let bytes = std::fs::read(&file).unwrap();
        let (_, trailer) = bytes.split_at(bytes.len() - 8);
        let footer = u32::from_le_bytes(trailer[..4].try_into().unwrap()) as usize;
        for at in (MAGIC.len()..bytes.len() - 8 - footer).step_by(7) {
            let mut damaged = bytes.clone();
            damaged[at] ^= 0x10;
            std::fs::write(&file, damaged).unwrap();
            assert!(read().is_err(), "byte {at} was flipped and read");
        }
    }
}
