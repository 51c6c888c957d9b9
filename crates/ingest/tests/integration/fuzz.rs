//! Fuzz targets of logs, of clocks, and of the tables of installations and flights.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow::array::{ArrayRef, StringArray};
use bytes::Bytes;
use ingest::tables::ColumnAliases;
use ingest::time::clock::{TimeOrigin, Timestamps, build_time_base};
use ingest::{ClockMapping, Error, Flights, Geometry, IdentityMapping, Log, LogFiles, SampleFilter};
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use parquet::basic::{Compression, Encoding, ZstdLevel};
use parquet::file::metadata::{ParquetMetaDataReader, RowGroupMetaData};
use parquet::file::properties::{WriterProperties, WriterVersion};

use self::edits::{Choices, edit_text, number, overwrite};
use crate::layouts::write;

#[path = "../../../../tests/fuzz/edits.rs"]
mod edits;

/// Bytes of one change to the stamps.
const EDIT: usize = 12;

/// Stamps of 50 Hz after the changes that the bytes describe, and a clock.
fn stamps_of(bytes: &[u8]) -> (Timestamps, ClockMapping) {
    let rows = 8 * usize::from(bytes.first().copied().unwrap_or_default()) + 1;
    let mut seconds: Vec<f64> = (0..rows).map(|row| row as f64 * 0.02).collect();
    let (mut origin, mut clock) = (TimeOrigin::Counted(0.0), ClockMapping::default());
    for edit in bytes.get(1..).unwrap_or_default().chunks_exact(EDIT) {
        let value = number(edit[3], edit[4..].try_into().unwrap());
        let first = rows * usize::from(edit[1]) / 256;
        let range = first..(first + usize::from(edit[2])).min(rows);
        match edit[0] % 16 {
            0..=2 => seconds[range].fill(value),
            3 => seconds[range].reverse(),
            4..=6 => seconds[first..].iter_mut().for_each(|s| *s += value),
            7 => seconds[range].iter_mut().for_each(|s| *s *= value),
            8 => seconds[range].iter_mut().for_each(|s| *s = s.floor()),
            9 => clock.rate_hz = Some(value),
            10 => clock.tick_s = Some(value),
            11 => clock.max_back_s = Some(value),
            12 => clock.split_at_jumps = edit[3] % 2 == 0,
            13 => origin = TimeOrigin::Counted(value),
            14 => clock.wraps_at = Some(value),
            _ => origin = TimeOrigin::Start,
        }
    }
    // A configuration with settings outside their ranges is refused before a clock is built.
    let within =
        |value: Option<f64>, least: f64, most: f64| value.filter(|value| (least..=most).contains(value));
    clock.rate_hz = within(clock.rate_hz, 1e-6, 1e6);
    clock.tick_s = within(clock.tick_s, 1e-9, 1e4);
    clock.max_back_s = within(clock.max_back_s, 1e-9, 1e9);
    (Timestamps { column: "t".into(), seconds, origin }, clock)
}

/// A clock has a positive step, and its rows and segments lie within the log, in order.
fn clock_of_any(bytes: &[u8]) {
    let (mut stamps, clock) = stamps_of(bytes);
    let rows = stamps.seconds.len();
    let Ok(line) = build_time_base(&mut stamps, &clock) else { return };
    assert!(line.step_s.is_finite() && line.step_s > 0.0, "step {}", line.step_s);
    let kept = line.kept.as_ref().map_or(rows, Vec::len);
    assert!(kept <= rows);
    assert!(line.kept.iter().flatten().all(|row| (*row as usize) < rows), "rows");
    let mut end = 0;
    for segment in &line.segments {
        assert!(end <= segment.start && segment.start <= segment.end && segment.end <= kept, "{segment:?}");
        end = segment.end;
    }
    assert_eq!(stamps.of(&line).len(), kept);
}

#[test]
fn fuzz_clock() {
    bolero::check!().with_iterations(1000).with_max_len(1 + 20 * EDIT).for_each(clock_of_any);
}

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
            let mut bytes = Vec::new();
            let mut writer =
                ArrowWriter::try_new(&mut bytes, batch.schema(), Some(properties.build())).unwrap();
            writer.write(&batch).unwrap();
            writer.close().unwrap();
            all.push(bytes);
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

/// Bytes changed in files of every writer: samples or a reason come back, and no more samples than the file has rows.
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
    let read = |mapping: &Arc<ingest::Mapping>| -> Result<usize, Error> {
        let log = Log::open(&LogFiles::one(&file), mapping)?;
        let at = log.actuators(&mapping.channels, None)?;
        let geometry = Geometry::Linear { lead_m_per_rev: Some(0.005) };
        Ok(log.read_actuator(&at[0], &mapping.channels, geometry)?.dx_m.len())
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
                Ok(samples) => assert!(samples <= 400, "{samples} samples of 400 rows"),
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
    let [csv, parquet] = ["table.csv", "table.parquet"].map(|name| folder.path().join(name));
    bolero::check!().with_iterations(150).with_max_len(64).for_each(|input| {
        let choices = &mut Choices(input);
        let mut bytes = choices.pick(&corpus).clone();
        edit_text(choices, &mut bytes, &corpus);
        std::fs::write(&csv, &bytes).unwrap();
        // The same cells as a table of texts.
        let text = String::from_utf8_lossy(&bytes);
        let rows: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
        let names: Vec<String> = rows
            .first()
            .into_iter()
            .flatten()
            .enumerate()
            .map(|(k, name)| format!("{name}{}", if k < 9 { "" } else { "+" }))
            .collect();
        let column = |k: usize| {
            let cells = rows.iter().skip(1).map(|row| row.get(k).copied());
            Arc::new(cells.collect::<StringArray>()) as ArrayRef
        };
        let columns: Vec<(&str, ArrayRef)> =
            names.iter().enumerate().map(|(k, name)| (name.as_str(), column(k))).collect();
        let is_table = !columns.is_empty() && rows.len() > 1;
        if is_table {
            write(&parquet, &columns);
        }
        for file in [&csv, &parquet].into_iter().take(1 + usize::from(is_table)) {
            let _ = ingest::tables::installations(file, &ColumnAliases::new()).map_err(|e| e[0].diagnostic());
            let _ = Flights::read(file, &ColumnAliases::new(), &IdentityMapping::default())
                .map_err(|e| e[0].diagnostic());
        }
    });
}
