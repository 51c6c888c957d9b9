//! Fuzz targets of logs and of the tables of installations and flights.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use bytes::Bytes;
use ingest::tables::ColumnAliases;
use ingest::{ClockMapping, Error, Flights, Geometry, IdentityMapping, Log, LogFiles, SampleFilter};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use parquet::basic::{Compression, Encoding, ZstdLevel};
use parquet::file::metadata::{ParquetMetaDataReader, RowGroupMetaData};
use parquet::file::properties::{WriterProperties, WriterVersion};

use self::edits::{Choices, edit_text, overwrite};
use crate::layouts::{place, write_batch};

#[path = "../../../../tests/fuzz/edits.rs"]
mod edits;

/// Page headers are shorter than this without statistics.
const HEADER_BYTES: usize = 48;

/// Files of other writers, and of the parquet crate by each of its encodings.
fn logs() -> Vec<Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/writers");
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().flatten().map(|e| e.path()).collect();
    files.retain(|file| file.extension().is_some_and(|ending| ending == "parquet"));
    files.sort();
    let mut all: Vec<Vec<u8>> = files.iter().map(|file| std::fs::read(file).unwrap()).collect();
    let wide = files.iter().find(|file| file.to_str().unwrap().contains("pyarrow")).unwrap();
    let reader = ParquetRecordBatchReaderBuilder::try_new(std::fs::File::open(wide).unwrap()).unwrap();
    let batch = reader.build().unwrap().next().unwrap().unwrap();
    let (_dir, file) = place("log.parquet");
    let encodings = [(Encoding::PLAIN, false), (Encoding::BYTE_STREAM_SPLIT, false), (Encoding::PLAIN, true)];
    for version in [WriterVersion::PARQUET_1_0, WriterVersion::PARQUET_2_0] {
        for (encoding, is_coded) in encodings {
            let compression =
                if is_coded { Compression::UNCOMPRESSED } else { Compression::ZSTD(ZstdLevel::default()) };
            let properties = WriterProperties::builder()
                .set_writer_version(version)
                .set_compression(compression)
                .set_encoding(encoding)
                .set_dictionary_enabled(is_coded)
                .set_data_page_row_count_limit(60)
                .set_write_batch_size(20)
                .set_max_row_group_row_count(Some(150));
            write_batch(&file, &batch, properties.build());
            all.push(std::fs::read(&file).unwrap());
        }
    }
    all
}

/// Byte ranges of a sound file that are changed equally often: headers of pages, their bodies, the footer, everything.
fn places(bytes: &[u8]) -> [Vec<Range<usize>>; 4] {
    let footer = ParquetMetaDataReader::new().parse_and_finish(&Bytes::copy_from_slice(bytes)).unwrap();
    let trailer: [u8; 4] = bytes[bytes.len() - 8..bytes.len() - 4].try_into().unwrap();
    let start = bytes.len() - 8 - u32::from_le_bytes(trailer) as usize;
    let (mut headers, mut bodies) = (Vec::new(), Vec::new());
    for chunk in footer.row_groups().iter().flat_map(RowGroupMetaData::columns) {
        let (first, length) = chunk.byte_range();
        let end = (first + length) as usize;
        for page in [first as usize, chunk.data_page_offset() as usize] {
            headers.push(page..page + HEADER_BYTES);
            bodies.push((page + HEADER_BYTES).min(end)..end);
        }
    }
    [
        headers,
        bodies,
        std::iter::once(start..bytes.len()).collect(),
        std::iter::once(0..bytes.len()).collect(),
    ]
}

/// Bytes changed in files of every writer: samples or a reason come back, and no more measured samples than the file has rows.
#[test]
fn fuzz_logs() {
    let corpus = logs();
    let places: Vec<_> = corpus.iter().map(|bytes| places(bytes)).collect();
    let whole = crate::foreign_writers::wide();
    let mut selected = whole.clone();
    let column = whole.clock.column.clone().unwrap();
    selected.channels.when.push(SampleFilter { column, at_least: Some(0.5), ..SampleFilter::default() });
    let mut unstamped = selected.clone();
    unstamped.clock = ClockMapping { rate_hz: Some(100.0), ..ClockMapping::default() };
    let mappings = [whole, selected, unstamped].map(Arc::new);
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("log.parquet");
    // Samples, and those of them that are measured.
    let read = |mapping: &Arc<ingest::Mapping>| -> Result<(usize, usize), Error> {
        let log = Log::open(&LogFiles::one(&file), mapping)?;
        let at = log.actuators(&mapping.channels, None)?;
        let geometry = Geometry::Linear { lead_m_per_rev: Some(0.005) };
        let dx_m = log.read_actuator(&at[0], &mapping.channels, geometry)?.dx_m;
        Ok((dx_m.len(), dx_m.iter().filter(|m| !m.is_nan()).count()))
    };
    bolero::check!().with_iterations(500).with_max_len(64).for_each(|input| {
        let choices = &mut Choices(input);
        let origin = choices.below(corpus.len());
        let mut bytes = corpus[origin].clone();
        let place = choices.below(4);
        overwrite(choices, &mut bytes, &places[origin][place]);
        if choices.below(60) == 59 {
            bytes.truncate(choices.below(bytes.len()) + 1);
        }
        std::fs::write(&file, bytes).unwrap();
        for mapping in &mappings {
            match read(mapping) {
                // Lost rows, as many as those that are there at most, count as missing samples.
                Ok((samples, measured)) => assert!(
                    samples <= 2 * 400 && measured <= 400,
                    "{samples} samples, {measured} of them measured, of 400 rows"
                ),
                Err(error) => drop(error.diagnostic()),
            }
        }
    });
}

#[test]
fn fuzz_installations_and_flights() {
    let sample = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../sample-data/installations.csv");
    let flights = "tail_number,flight_id,departure_utc,flight_hours,tail_hours_end,path,position\n\
                   N1,F1,2026-01-01T06:00:00Z,1.5,100.0,N1/F1.parquet,aileron\nN1,F2,2026-01-02,,101.5,,\n";
    let corpus = vec![std::fs::read(sample).unwrap(), flights.as_bytes().to_vec()];
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("table.csv");
    bolero::check!().with_iterations(150).with_max_len(64).for_each(|input| {
        let choices = &mut Choices(input);
        let mut bytes = choices.pick(&corpus).clone();
        edit_text(choices, &mut bytes, &corpus);
        std::fs::write(&file, &bytes).unwrap();
        let _ = ingest::tables::installations(&file, &ColumnAliases::new()).map_err(|e| e[0].diagnostic());
        let _ = Flights::read(&file, &ColumnAliases::new(), &IdentityMapping::default())
            .map_err(|e| e[0].diagnostic());
    });
}
