//! Maintenance: figures about the store, and merging its files changes no row.

use std::fs;
use std::time::Duration;

use store::Query;

use crate::fixtures::{departure, filled, fresh, run, writer};

#[test]
fn a_sound_store_has_no_findings_and_is_counted_from_the_empty_one_on() {
    let (_dir, writer) = fresh();
    assert_eq!(writer.store().verify(), []);
    let info = writer.store().info().unwrap();
    assert_eq!((info.records, info.logs, info.last_departure_utc, info.last_completed), (0, 0, None, None));
    let (_dir, writer) = filled(2, 6);
    assert_eq!(writer.store().verify(), []);
    let info = writer.store().info().unwrap();
    assert_eq!((info.records, info.flights, info.serials, info.tails, info.logs), (36, 12, 6, 2, 12));
    // A new table has a file without rows, so that other engines always find one.
    assert_eq!((info.files, info.version), (7, 6));
    assert_eq!((info.first_departure_utc, info.last_departure_utc), (Some(departure(0)), Some(departure(5))));
}

#[test]
fn the_last_completed_run_is_not_hidden_by_runs_under_a_wrong_clock_and_by_those_that_did_not_complete() {
    let (_dir, mut writer) = fresh();
    for (run_id, at, exit_code, expected) in [
        ("ahead", "2131-01-01T04:00:00Z", 0, "ahead"),
        ("a", "2026-03-01T04:00:00Z", 0, "a"),
        ("b", "2026-03-03T04:00:00Z", 1, "b"),
        ("interrupted", "2026-03-04T04:00:00Z", 130, "b"),
        ("ten years back", "2016-03-03T05:00:00Z", 0, "b"),
    ] {
        writer.end_run(&run(run_id, at, Some(exit_code))).unwrap();
        let completed = writer.store().info().unwrap().last_completed.unwrap();
        assert_eq!(completed.run_id, expected, "after {run_id}");
    }
}

/// Two commits of one row each per run: after fifty runs the run table alone needs a compaction, and the first
/// compaction is sufficient.
#[test]
fn a_store_is_scattered_once_a_table_has_a_hundred_files_too_many() {
    let (_dir, mut writer) = fresh();
    for _ in 0..101 {
        writer.end_run(&run("a", "2026-11-18T02:00:00Z", Some(0))).unwrap();
    }
    assert!(!writer.store().needs_compaction().unwrap());
    writer.end_run(&run("b", "2026-11-19T02:00:00Z", Some(0))).unwrap();
    assert!(writer.store().needs_compaction().unwrap());
    writer.compact().unwrap();
    assert!(!writer.store().needs_compaction().unwrap());
    assert_eq!(writer.store().table_files("runs").unwrap().len(), 1);
}

#[test]
fn superseded_files_are_kept_for_readers_until_they_are_old() {
    let (dir, mut writer) = filled(2, 6);
    let before = writer.store().table_files("gaps").unwrap();
    writer.compact().unwrap();
    assert!(before.iter().all(|file| file.exists()));
    fs::write(dir.path().join("gaps/000000000099-half.parquet#4711"), "x").unwrap();
    assert_eq!(writer.vacuum(Duration::ZERO).unwrap(), 15);
    assert!(before.iter().all(|file| !file.exists()));
    assert_eq!(writer.store().verify(), []);
    assert_eq!(writer.store().records(&Query::default()).unwrap().len(), 36);
}

/// Stores of earlier releases have no digests of their commits: there the content of the files is compared. A compaction
/// reads the files that they rule out all the same.
#[test]
fn statistics_that_do_not_cover_the_content_are_found_without_a_digest_and_lose_no_record() {
    for (from, to) in [
        ("\\\"tail_number\\\":\\\"N", "\\\"tail_number\\\":\\\"Z"),
        ("\\\"tail_number\\\":\\\"N1\\\"", "\\\"tail_number\\\":\\\"N0\\\""),
        ("freeplaySerials\\\":[\\\"", "freeplaySerials\\\":[\\\"x"),
    ] {
        let (dir, _) = filled(2, 6);
        fs::remove_dir_all(dir.path().join("gaps/_digests")).unwrap();
        let file = dir.path().join("gaps/_delta_log/00000000000000000003.json");
        let text = fs::read_to_string(&file).unwrap();
        assert!(text.contains(from), "{text}");
        fs::write(&file, text.replace(from, to)).unwrap();
        let mut writer = writer(dir.path());
        let found = writer.store().verify();
        assert_eq!(found.iter().map(|f| f.code.as_str()).collect::<Vec<_>>(), ["store_damaged"], "{to}");
        writer.compact().unwrap();
        assert_eq!(writer.store().records(&Query::default()).unwrap().len(), 36, "{to}");
    }
}
