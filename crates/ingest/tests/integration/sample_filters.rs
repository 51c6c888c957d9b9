//! Segments selected by sample filters: data outside are neither read nor used, in any page layout.

use std::fs::{self, File};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow::array::{Int64Array, RecordBatch, StringArray, UInt8Array};
use ingest::{ActuatorChannels, Mapping, RawValue, SampleFilter};
use parquet::basic::{Compression, ZstdLevel};
use parquet::file::metadata::{PageIndexPolicy, ParquetMetaDataReader};
use parquet::file::properties::WriterProperties;
use proptest::prelude::*;

use crate::layouts::{self, LINEAR, opened, plain, prefixed, read, reals, write_batch};

const ROWS: usize = 3000;
/// Where the state is 1.
const STRETCHES: [Range<usize>; 3] = [310..420, 1200..1300, 2890..2995];

fn written(folder: &Path, group_rows: usize, page_rows: usize, is_coded: bool) -> PathBuf {
    let column = |value: fn(usize) -> f64| reals((0..ROWS).map(value));
    let state = |k: usize| f64::from(u8::from(STRETCHES.iter().any(|s| s.contains(&k))));
    // Few values, a hole within a stretch, and a leap that no stretch holds.
    let screw = |k: usize| match k {
        1210..1215 => f64::NAN,
        600 => 9.0,
        _ => (k % 17) as f64 * 1e-4,
    };
    let columns = [
        ("t", column(|k| k as f64 * 0.01)),
        ("state", column(state)),
        ("m", column(|k| (k as f64 * 0.003).sin() * 0.02)),
        ("s", column(screw)),
        ("f", column(|k| (k as f64 * 0.011).cos() * 5e3)),
    ];
    let batch = RecordBatch::try_from_iter(columns).unwrap();
    let properties = WriterProperties::builder()
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        .set_dictionary_enabled(is_coded)
        .set_max_row_group_row_count(Some(group_rows))
        .set_data_page_row_count_limit(page_rows)
        .set_write_batch_size(50)
        .build();
    let file = folder.join("N1_20261119T041300Z.parquet");
    write_batch(&file, &batch, properties);
    file
}

/// The condition that a column is 1.
fn when(column: &str) -> SampleFilter {
    SampleFilter { column: column.into(), equals: vec![RawValue::Number(1.0)], ..SampleFilter::default() }
}

fn conditional(is_conditional: bool) -> Mapping {
    let mut mapping = plain();
    if is_conditional {
        mapping.channels.when.push(when("state"));
    }
    mapping
}

fn channels(read: &ActuatorChannels) -> [Vec<u64>; 3] {
    let bits = |value: &f64| if value.is_nan() { u64::MAX } else { value.to_bits() };
    [&read.motor_m, &read.dx_m, &read.load_n].map(|values| values.iter().map(bits).collect())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    /// What is read under a condition is what is read without one, less all that lies outside its stretches, and what
    /// is seen of it is seen of the stretches alone. A condition that is never met leaves no sample, and gives no error.
    #[test]
    fn a_condition_leaves_its_stretches_and_nothing_else(
        group_rows in 60_usize..3500, page_rows in 50_usize..900, is_coded in any::<bool>(),
    ) {
        let folder = tempfile::tempdir().unwrap();
        let file = written(folder.path(), group_rows, page_rows, is_coded);
        let (all, some) = (read(&file, &conditional(false)).unwrap(), read(&file, &conditional(true)).unwrap());
        prop_assert_eq!(&some.segments, &STRETCHES.to_vec());
        let mut wanted = channels(&all);
        for k in (0..ROWS).filter(|k| !STRETCHES.iter().any(|s| s.contains(k))) {
            wanted.iter_mut().for_each(|values| values[k] = u64::MAX);
        }
        prop_assert_eq!(channels(&some), wanted);
        let count = STRETCHES.iter().map(Range::len).sum::<usize>();
        prop_assert_eq!((some.excluded, some.quality[0].samples), (ROWS - count, count));
        prop_assert!((some.missing_share - 5.0 / count as f64).abs() < 1e-15);
        let seen = &some.quality[1];
        prop_assert!(seen.max < 0.1 && seen.spikes == 0 && (seen.rate_hz - 100.0).abs() < 1e-9, "{:?}", seen);
        prop_assert!(some.quality[2].missing_share == 0.0 && all.quality[1].max > 1.0);
        let mut never = conditional(true);
        never.channels.when[0].equals = vec![RawValue::Number(7.0)];
        let none = read(&file, &never).unwrap();
        prop_assert!(none.segments.is_empty() && none.excluded == ROWS && none.missing_share == 0.0);
        prop_assert_eq!(channels(&none), [ROWS; 3].map(|rows| vec![u64::MAX; rows]));
    }
}

/// Overwrites the second half of some pages of a column, selected by their rows.
fn spoilt(file: &Path, column: usize, which: impl Fn(Range<usize>) -> bool) -> PathBuf {
    let footer = ParquetMetaDataReader::new()
        .with_page_index_policy(PageIndexPolicy::Required)
        .parse_and_finish(&File::open(file).unwrap())
        .unwrap();
    let mut bytes = fs::read(file).unwrap();
    let mut first = 0;
    for (group, index) in footer.row_groups().iter().zip(footer.offset_index().unwrap()) {
        let (rows, pages) = (group.num_rows() as usize, index[column].page_locations());
        for (k, page) in pages.iter().enumerate() {
            let end = pages.get(k + 1).map_or(rows, |next| next.first_row_index as usize);
            if which(first + page.first_row_index as usize..first + end) {
                let body = page.offset as usize..page.offset as usize + page.compressed_page_size as usize;
                bytes[body.start + body.len() / 2..body.end].fill(0xff);
            }
        }
        first += rows;
    }
    let spoilt = file.with_file_name("N2_20261119T041300Z.parquet");
    fs::write(&spoilt, bytes).unwrap();
    spoilt
}

/// A page without a selected row may be corrupt, since it is not read; a page with a selected row may not.
#[test]
fn pages_outside_of_every_stretch_are_not_unpacked() {
    let folder = tempfile::tempdir().unwrap();
    let file = written(folder.path(), 1000, 100, false);
    let sound = read(&file, &conditional(true)).unwrap();
    let all = read(&file, &conditional(false)).unwrap();
    let touched = |rows: &Range<usize>| STRETCHES.iter().any(|s| s.start < rows.end && rows.start < s.end);
    // Bytes without a checksum may be unpacked to other numbers without a word.
    let is = |file: &Path, is_conditional: bool, wanted: &ActuatorChannels| {
        read(file, &conditional(is_conditional)).is_ok_and(|found| channels(&found) == channels(wanted))
    };
    for column in 2..5 {
        let outside = spoilt(&file, column, |rows| !touched(&rows));
        assert!(!is(&outside, false, &all), "column {column} was not spoilt");
        assert!(is(&outside, true, &sound), "column {column} was read outside of the stretches");
        let inside = spoilt(&file, column, |rows| rows.contains(&1250));
        assert!(!is(&inside, true, &sound), "column {column} was not read");
    }
}

/// Each actuator uses its own column where the condition names one, and a common column where it does not.
#[test]
#[expect(clippy::single_range_in_vec_init, reason = "one stretch is a list of one")]
fn conditions_apply_to_each_actuator() {
    let column = |value: fn(usize) -> f64| reals((0..100).map(value));
    let mut columns = vec![
        ("t", column(|k| k as f64 * 0.01)),
        ("a_t", column(|k| k as f64 * 0.01)),
        ("b_t", column(|k| 0.4 + k as f64 * 0.01)),
        ("a_mode", Arc::new(UInt8Array::from_iter_values((0..100).map(|k| k / 50)))),
        ("b_mode", Arc::new(Int64Array::from_iter_values((0..100).map(|k| k / 90)))),
        ("phase", Arc::new(StringArray::from_iter_values((0..100).map(|k| ["climb", "cruise"][k / 50])))),
    ];
    columns.extend(["a_m", "a_s", "a_f", "b_m", "b_s", "b_f"].map(|name| (name, column(|k| k as f64))));
    let (_dir, file) = layouts::written(&columns);
    let mut mapping = prefixed("{position}_");
    let segments = |mapping: &Mapping| -> Vec<Vec<Range<usize>>> {
        let log = opened(&file, mapping);
        let positions = log.actuators(&mapping.channels, None).unwrap();
        let read = |at| log.read_actuator(at, &mapping.channels, LINEAR);
        positions.iter().map(|at| read(at).unwrap().segments).collect()
    };
    mapping.channels.when = vec![when("{position}_mode")];
    assert_eq!(segments(&mapping), [vec![50..100], vec![90..100]]);
    let cruise = SampleFilter { equals: vec![RawValue::Text("cruise".into())], ..when("phase") };
    for of_both in [when("a_mode"), cruise] {
        mapping.channels.when = vec![of_both];
        assert_eq!(segments(&mapping), [vec![50..100], vec![50..100]]);
    }
    // One column for all, on stamps of each one's own: b's come 0.4 s later.
    let timed = SampleFilter { time_column: Some("{position}_t".into()), ..when("a_mode") };
    mapping.channels.when = vec![timed];
    assert_eq!(segments(&mapping), [vec![50..100], vec![100 - 10..100]]);
}
