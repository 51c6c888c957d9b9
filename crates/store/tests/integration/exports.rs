//! Exports: what others read is what is stored.

use std::io::Write;

use arrow::array::RecordBatch;
use arrow::compute::concat_batches;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use records::GapRecord;
use records::row_schema::from_batch;
use store::{Format, Query, RecordKey};

use crate::fixtures::{record, result, writer};

fn exported(format: Format, results: &[store::LogResult]) -> Vec<u8> {
    let dir = tempfile::tempdir().unwrap();
    let mut writer = writer(dir.path());
    for result in results {
        writer.commit(std::slice::from_ref(result)).unwrap();
    }
    let mut out = Vec::new();
    let rows = writer.store().export(&Query::default(), format, &mut out).unwrap();
    assert_eq!(rows, results.iter().map(|r| r.records.len()).sum::<usize>());
    out
}

#[test]
fn json_holds_every_column_of_every_record_and_the_same_bits() {
    let results = [result(2, 1, 0.1 + 0.2), result(1, 1, 5e-324), result(1, 0, 40e-6)];
    let text = exported(Format::Json, &results);
    let rows: Vec<serde_json::Map<String, serde_json::Value>> = serde_json::from_slice(&text).unwrap();
    assert!(rows.iter().all(|row| row.len() == GapRecord::schema().fields().len()));
    assert!(rows[0]["tail_hours_end"].is_null());
    let read: Vec<GapRecord> = serde_json::from_slice(&text).unwrap();
    let mut expected: Vec<GapRecord> = results.into_iter().flat_map(|r| r.records).collect();
    expected.sort_by_key(RecordKey::of);
    assert_eq!(read, expected);
}

#[test]
fn csv_has_a_header_and_joins_flags_by_semicolons() {
    let text = String::from_utf8(exported(Format::Csv, &[result(1, 0, 40e-6)])).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines.len(), 4);
    assert!(lines[0].starts_with("tail_number,position,part_number,"));
    assert!(
        lines[1].starts_with("N1,aileron_left,EMA-27,S-1-aileron_left,F0000,2026-01-01T06:00:00"),
        "{}",
        lines[1]
    );
    assert!(lines[1].contains(",soft_contact;drift,"), "{}", lines[1]);
}

#[test]
fn parquet_reads_back_as_the_same_records() {
    let bytes = exported(Format::Parquet, &[result(1, 0, 40e-6), result(1, 1, 41e-6)]);
    let mut file = tempfile::tempfile().unwrap();
    file.write_all(&bytes).unwrap();
    let reader = ParquetRecordBatchReaderBuilder::try_new(file).unwrap().build().unwrap();
    let batches: Vec<RecordBatch> = reader.map(Result::unwrap).collect();
    let batch = concat_batches(&GapRecord::schema(), &batches).unwrap();
    let records: Vec<GapRecord> = from_batch(&batch).unwrap();
    let expected: Vec<GapRecord> = [(0, 40e-6), (1, 41e-6)]
        .into_iter()
        .flat_map(|(flight, gap_m)| {
            crate::fixtures::POSITIONS.map(|position| record(1, flight, position, gap_m))
        })
        .collect();
    assert_eq!(records, expected);
}

#[test]
fn nothing_stored_is_an_empty_table_and_not_an_empty_file() {
    assert_eq!(exported(Format::Json, &[]), b"[]");
    let header = String::from_utf8(exported(Format::Csv, &[])).unwrap();
    assert_eq!(header.lines().count(), 1);
    assert!(exported(Format::Parquet, &[]).starts_with(b"PAR1"));
}

#[test]
fn the_order_of_commits_does_not_show() {
    let results: Vec<_> = (0..6).map(|i| result(i % 3, i as i64 / 2, 1e-6 * i as f64)).collect();
    let reversed: Vec<_> = results.iter().rev().cloned().collect();
    for format in [Format::Csv, Format::Json, Format::Parquet] {
        assert!(exported(format, &results) == exported(format, &reversed), "{format:?}");
    }
}
