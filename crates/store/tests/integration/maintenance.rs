//! Maintenance: figures about the store, and merging its files changes no row.

use std::fs;
use std::path::PathBuf;
use std::time::Duration;

use store::{Query, Store, Writer};

use crate::fixtures::{departure, fresh, result, run, writer};

fn filled() -> (tempfile::TempDir, Writer) {
    let (dir, mut writer) = fresh();
    for flight in 0..6 {
        writer.commit(&[result(1, flight, 1e-6), result(2, flight, 2e-6)]).unwrap();
    }
    (dir, writer)
}

fn codes(store: &Store) -> Vec<String> {
    store.verify().into_iter().map(|finding| finding.code).collect()
}

fn data_file(writer: &Writer) -> PathBuf {
    writer.store().table_files("gaps").unwrap().remove(0)
}

#[test]
fn a_sound_store_has_no_findings_and_is_counted() {
    let (_dir, mut writer) = filled();
    writer.end_run(&run("a", "2026-11-18T02:00:00Z", Some(0))).unwrap();
    writer.end_run(&run("b", "2026-11-19T02:00:00Z", Some(1))).unwrap();
    writer.end_run(&run("c", "2026-11-20T02:00:00Z", Some(130))).unwrap();
    assert_eq!(writer.store().verify(), []);
    let info = writer.store().info().unwrap();
    assert_eq!((info.records, info.flights, info.serials, info.tails, info.logs), (36, 12, 6, 2, 12));
    // A new table has a file without rows, so that other engines always find one.
    assert_eq!((info.files, info.version), (7, 6));
    assert_eq!((info.first_departure_utc, info.last_departure_utc), (Some(departure(0)), Some(departure(5))));
    assert_eq!(info.last_completed.unwrap().run_id, "b");
}

/// A commit of another program that replaces a data file by a copy under a name of its own.
#[test]
fn a_foreign_commit_is_found_until_it_is_accepted_and_its_file_is_compacted() {
    let (dir, mut writer) = filled();
    let log = dir.path().join("gaps/_delta_log");
    let newest = fs::read_to_string(log.join("00000000000000000006.json")).unwrap();
    let line = newest.lines().find(|line| line.starts_with("{\"add\"")).unwrap();
    let mut add: serde_json::Value = serde_json::from_str(line).unwrap();
    let path = add["add"]["path"].as_str().unwrap().to_owned();
    fs::copy(dir.path().join("gaps").join(&path), dir.path().join("gaps/foreign.parquet")).unwrap();
    add["add"]["path"] = "foreign.parquet".into();
    let remove =
        format!("{{\"remove\":{{\"path\":\"{path}\",\"deletionTimestamp\":1,\"dataChange\":true}}}}");
    fs::write(log.join("00000000000000000007.json"), format!("{remove}\n{add}\n")).unwrap();
    let store = writer.store().clone();
    assert_eq!(codes(&store), ["store_file_foreign", "store_file_foreign"]);
    assert_eq!(writer.accept_foreign().unwrap(), 1);
    assert_eq!(codes(&store), ["store_file_foreign"], "the data file");
    writer.compact().unwrap();
    assert_eq!(store.verify(), []);
    assert_eq!(store.info().unwrap().records, 36);
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
fn an_empty_store_is_sound_and_counts_zero() {
    let dir = tempfile::tempdir().unwrap();
    let store = Store::create_or_open(dir.path()).unwrap();
    assert_eq!(store.verify(), []);
    let info = store.info().unwrap();
    assert_eq!((info.records, info.logs, info.last_departure_utc, info.last_completed), (0, 0, None, None));
}

#[test]
fn stray_files_beside_the_data_are_no_rows() {
    let (dir, writer) = filled();
    fs::copy(data_file(&writer), dir.path().join("gaps/copy of yesterday.parquet")).unwrap();
    fs::write(dir.path().join("gaps/notes.txt"), "x").unwrap();
    assert_eq!(writer.store().verify(), []);
    assert_eq!(writer.store().records(&Query::default()).unwrap().len(), 36);
}

/// As if another program had added a file that is there already.
#[test]
fn verify_finds_records_that_are_there_twice() {
    let (dir, writer) = filled();
    let log = dir.path().join("gaps/_delta_log");
    let commit = fs::read_to_string(log.join("00000000000000000006.json")).unwrap();
    let add: &str = commit.lines().find(|line| line.starts_with("{\"add\"")).unwrap();
    let name = add.split('"').find(|part| part.ends_with(".parquet")).unwrap();
    let copy = name.replacen("000000000006-", "000000000007-", 1);
    fs::copy(dir.path().join("gaps").join(name), dir.path().join("gaps").join(&copy)).unwrap();
    fs::write(log.join("00000000000000000007.json"), add.replace(name, &copy)).unwrap();
    let findings = writer.store().verify();
    assert_eq!(findings.len(), 5);
    assert_eq!(findings[0].message, "a commit was written by another program and carries no digest");
    assert_eq!(findings[1].message, "N1 aileron_left, departure 2026-01-06T06:00:00Z, is stored twice");
    assert_eq!(findings[4].message, "3 more records are stored twice");
}

#[test]
fn compaction_leaves_one_sorted_file_and_the_same_answers() {
    let (dir, mut writer) = filled();
    let reader = Store::open(dir.path()).unwrap();
    let (records, accounts) = (reader.scan(&Query::default()).unwrap(), reader.accounts().unwrap());
    let done = writer.compact().unwrap();
    assert_eq!((done.before, done.after, done.deleted), (15, 3, 0));
    assert_eq!(writer.compact().unwrap().before, 3);
    assert_eq!(reader.info().unwrap().version, 7);
    assert_eq!(reader.scan(&Query::default()).unwrap(), records);
    assert_eq!(reader.accounts().unwrap(), accounts);
    assert_eq!(reader.verify(), []);
}

#[test]
fn compaction_refuses_to_give_a_damaged_file_a_new_digest() {
    let (_dir, mut writer) = filled();
    let file = data_file(&writer);
    let mut content = fs::read(&file).unwrap();
    content[200] ^= 1;
    fs::write(&file, content).unwrap();
    assert!(matches!(writer.compact(), Err(store::Error::Damaged { .. })));
    assert_eq!(codes(writer.store()), ["store_damaged"]);
}

#[test]
fn superseded_files_are_kept_for_readers_until_they_are_old() {
    let (dir, mut writer) = filled();
    let before = writer.store().table_files("gaps").unwrap();
    writer.compact().unwrap();
    assert!(before.iter().all(|file| file.exists()));
    fs::write(dir.path().join("gaps/000000000099-half.parquet#4711"), "x").unwrap();
    assert_eq!(writer.vacuum(Duration::ZERO).unwrap(), 15);
    assert!(before.iter().all(|file| !file.exists()));
    assert_eq!(writer.store().verify(), []);
    assert_eq!(writer.store().records(&Query::default()).unwrap().len(), 36);
}

/// Delta readers skip actions that they do not know: a changed name would remove a file's rows without an error.
#[test]
fn a_changed_action_is_refused_by_readers_with_and_without_a_digest() {
    for has_digests in [true, false] {
        let dir = filled().0;
        let file = dir.path().join("gaps/_delta_log/00000000000000000003.json");
        let text = fs::read_to_string(&file).unwrap();
        fs::write(&file, text.replacen("{\"add\":", "{\"aed\":", 1)).unwrap();
        if !has_digests {
            fs::remove_dir_all(dir.path().join("gaps/_digests")).unwrap();
        }
        let store = Store::open(dir.path()).unwrap();
        let error = store.records(&Query::default()).unwrap_err();
        assert!(error.to_string().starts_with("the log of a table is damaged: "), "{error}");
        assert_eq!(codes(&store), ["store_damaged"]);
    }
}

/// Stores of earlier releases have no digests of their commits: there the content of the files is compared. A compaction
/// reads the files that they rule out all the same.
#[test]
fn statistics_that_do_not_cover_the_content_are_found_without_a_digest_and_lose_no_record() {
    for (from, to) in [
        ("\\\"tail_number\\\":\\\"N", "\\\"tail_number\\\":\\\"Z"),
        ("\\\"tail_number\\\":\\\"N2\\\"", "\\\"tail_number\\\":\\\"N1\\\""),
        ("freeplaySerials\\\":[\\\"", "freeplaySerials\\\":[\\\"x"),
    ] {
        let dir = filled().0;
        fs::remove_dir_all(dir.path().join("gaps/_digests")).unwrap();
        let file = dir.path().join("gaps/_delta_log/00000000000000000003.json");
        let text = fs::read_to_string(&file).unwrap();
        assert!(text.contains(from), "{text}");
        fs::write(&file, text.replace(from, to)).unwrap();
        assert_eq!(codes(&Store::open(dir.path()).unwrap()), ["store_damaged"], "{to}");
        let mut writer = writer(dir.path());
        writer.compact().unwrap();
        assert_eq!(writer.store().records(&Query::default()).unwrap().len(), 36, "{to}");
    }
}

/// The table of records is put back to an earlier state; the log records are those of the present state.
#[test]
fn log_records_are_compared_with_the_records() {
    let dir = filled().0;
    let table = dir.path().join("gaps");
    fs::remove_file(table.join("_delta_log/00000000000000000006.json")).unwrap();
    let found = codes(&Store::open(dir.path()).unwrap());
    assert!(!found.is_empty() && found.iter().all(|code| code == "store_records_missing"), "{found:?}");
}
