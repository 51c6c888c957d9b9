//! Fuzz targets of the Parquet reader, over files of eight writers.
//!
//! Of each column the column reader and Arrow's reader must give the same numbers.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow::array::{ArrayRef, Float32Array, Float64Array, RecordBatch};
use parquet::arrow::ArrowWriter;
use parquet::basic::{Compression, Encoding, ZstdLevel};
use parquet::file::metadata::{ColumnChunkMetaData, ParquetMetaDataReader, RowGroupMetaData};
use parquet::file::properties::{WriterProperties, WriterVersion};

use self::engine::{Input, Random, fuzz, overwrite};
use crate::channel::column_builder::ColumnBuilder;
use crate::parquet::log_file::LogFile;
use crate::parquet::numeric::append;
use crate::parquet::row_selection::RowSelection;

#[path = "../../../../tests/fuzz/engine.rs"]
mod engine;

/// Page headers are shorter than this without statistics.
const HEADER_BYTES: usize = 48;

/// The part of a file that a target changes.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Part {
    PageHeaders,
    Pages,
    Footer,
}

/// Files of other writers, and of the parquet crate for each of its encodings.
fn corpus() -> Vec<Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/writers");
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().flatten().map(|e| e.path()).collect();
    files.sort();
    let mut all: Vec<Vec<u8>> = files
        .iter()
        .filter(|f| f.extension().is_some_and(|e| e == "parquet"))
        .map(|f| std::fs::read(f).unwrap())
        .collect();
    for version in [WriterVersion::PARQUET_1_0, WriterVersion::PARQUET_2_0] {
        for compression in [Compression::UNCOMPRESSED, Compression::ZSTD(ZstdLevel::default())] {
            for (encoding, is_coded) in
                [(Encoding::PLAIN, false), (Encoding::BYTE_STREAM_SPLIT, false), (Encoding::PLAIN, true)]
            {
                let properties = WriterProperties::builder()
                    .set_writer_version(version)
                    .set_compression(compression)
                    .set_encoding(encoding)
                    .set_dictionary_enabled(is_coded)
                    .set_data_page_row_count_limit(60)
                    .set_write_batch_size(20)
                    .set_max_row_group_row_count(Some(150));
                all.push(written(properties.build()));
            }
        }
    }
    all
}

fn written(properties: WriterProperties) -> Vec<u8> {
    let value = |row: i32| (row % 7 != 3).then(|| f64::from(row % 5) * 0.25);
    let columns: [(&str, ArrayRef); 3] = [
        ("nullable", Arc::new((0..200).map(value).collect::<Float64Array>())),
        ("double", Arc::new((0..200).map(|row| Some(f64::from(row % 9))).collect::<Float64Array>())),
        ("float", Arc::new((0..200).map(|row| value(row).map(|v| v as f32)).collect::<Float32Array>())),
    ];
    let batch = RecordBatch::try_from_iter(columns).unwrap();
    let mut bytes = Vec::new();
    let mut writer = ArrowWriter::try_new(&mut bytes, batch.schema(), Some(properties)).unwrap();
    writer.write(&batch).unwrap();
    writer.close().unwrap();
    bytes
}

/// The byte ranges of a part of a sound file.
fn ranges(bytes: &[u8], part: Part) -> Vec<Range<usize>> {
    if part == Part::Footer {
        let trailer: [u8; 4] = bytes[bytes.len() - 8..bytes.len() - 4].try_into().unwrap();
        return std::iter::once(bytes.len() - 8 - u32::from_le_bytes(trailer) as usize..bytes.len())
            .collect();
    }
    let footer =
        ParquetMetaDataReader::new().parse_and_finish(&bytes::Bytes::copy_from_slice(bytes)).unwrap();
    let chunks = footer.row_groups().iter().flat_map(RowGroupMetaData::columns);
    let of_chunk = |chunk: &ColumnChunkMetaData| {
        let (start, length) = chunk.byte_range();
        let (start, end) = (start as usize, (start + length) as usize);
        let first_data = chunk.data_page_offset() as usize;
        let behind = |page: usize| (page + HEADER_BYTES).min(end)..end;
        match part {
            Part::PageHeaders => vec![start..start + HEADER_BYTES, first_data..first_data + HEADER_BYTES],
            Part::Pages | Part::Footer => vec![behind(start), behind(first_data)],
        }
    };
    chunks.flat_map(of_chunk).collect()
}

/// Reads every column both ways and compares; the outcome names how each ended.
fn read_both_ways(file: &Path) -> String {
    let opened = match LogFile::open(file) {
        Ok(opened) => opened,
        Err(e) => return code(&e),
    };
    let mut outcome = String::new();
    for leaf in opened.leaves() {
        let mut fast = ColumnBuilder::with_capacity(0, None);
        let direct = opened.append_numbers(&leaf.name, RowSelection::ALL, &mut fast);
        let mut plain = ColumnBuilder::with_capacity(0, None);
        let by_crate =
            opened.each_flat(&[&leaf.name], |_, flats| append(&leaf.name, &flats[0].values, &mut plain));
        if direct.is_ok() && by_crate.is_ok() {
            let bits = |built: ColumnBuilder| -> Vec<u64> {
                let values = built.finish().0.into_iter();
                values.map(|v| if v.is_nan() { u64::MAX } else { v.to_bits() }).collect()
            };
            assert_eq!(bits(fast), bits(plain), "numbers of `{}` differ", leaf.name);
        }
        outcome.push_str(&direct.as_ref().map_or_else(code, |()| "read ".to_owned()));
    }
    outcome
}

/// The code of an error and its detail without numbers.
fn code(error: &crate::Error) -> String {
    let diagnostic = error.diagnostic();
    let words = diagnostic.message.chars().filter(|c| !c.is_ascii_digit());
    format!("{} {} ", diagnostic.code, words.take(80).collect::<String>())
}

fn fuzz_part(name: &'static str, part: Part, gate_cases: usize) {
    let corpus: Vec<Vec<u8>> = corpus().into_iter().filter(|bytes| !ranges(bytes, part).is_empty()).collect();
    let places: Vec<_> = corpus.iter().map(|bytes| ranges(bytes, part)).collect();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("log.parquet");
    let change = |random: &mut Random, input: &mut Input| {
        overwrite(random, &mut input.bytes, &places[input.origin]);
        if part == Part::Footer && random.below(20) == 0 {
            input.bytes.truncate(random.below(input.bytes.len()) + 1);
        }
    };
    fuzz(name, corpus.clone(), gate_cases, change, |bytes| {
        std::fs::write(&file, bytes).unwrap();
        read_both_ways(&file)
    });
}

#[test]
fn fuzz_page_headers() {
    fuzz_part("page header", Part::PageHeaders, 300);
}

#[test]
fn fuzz_pages() {
    fuzz_part("pages", Part::Pages, 600);
}

#[test]
fn fuzz_footer() {
    fuzz_part("footer", Part::Footer, 300);
}
