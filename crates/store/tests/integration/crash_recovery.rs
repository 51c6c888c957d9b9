//! Killed at any instant, and read at any instant: whole flights, each once.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use records::GapRecord;
use store::{Holder, Query, Store};

use crate::fixtures::{POSITIONS, result, writer};

/// Folder into which the child writes; without it, the test does nothing.
const FOLDER: &str = "FREEPLAY_TEST_KILL_FOLDER";
/// Kills of a test, and of the gate.
const KILLS: [usize; 2] = [5, 25];

/// Commits for ever, two flights at a time; every third commit estimates old flights again, and now
/// and then files are merged.
#[test]
fn a_writer_to_be_killed() {
    let Some(dir) = std::env::var_os(FOLDER).map(PathBuf::from) else { return };
    let mut writer = writer(&dir);
    let known = writer.store().accounts().unwrap().len() as i64;
    for step in known / 2.. {
        let again = if step % 3 == 2 { step / 2 } else { step };
        let gap_m = 1e-6 * (step + 1) as f64;
        writer.commit(&[result(1, again, gap_m), result(2, again, gap_m)]).unwrap();
        if step % 8 == 7 {
            writer.compact().unwrap();
            writer.vacuum(Duration::ZERO).unwrap();
        }
    }
}

fn child(dir: &Path) -> Child {
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.args(["--exact", "crash_recovery::a_writer_to_be_killed"]).env(FOLDER, dir);
    command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
}

/// Files below a folder.
fn files_in(dir: &Path) -> usize {
    let entries = std::fs::read_dir(dir).into_iter().flatten().flatten();
    entries.map(|entry| if entry.path().is_dir() { files_in(&entry.path()) } else { 1 }).sum()
}

/// Every flight has each of its positions once, all of one estimate.
fn assert_whole(records: &[GapRecord]) {
    let mut flights: BTreeMap<_, Vec<&GapRecord>> = BTreeMap::new();
    for record in records {
        let flight = (record.flight.tail_number.clone(), record.flight.flight_id.clone());
        flights.entry(flight).or_default().push(record);
    }
    for (flight, records) in flights {
        let positions: Vec<&str> = records.iter().map(|r| r.position.as_str()).collect();
        assert_eq!(positions, POSITIONS, "{flight:?}");
        assert!(records.windows(2).all(|r| r[0].estimate.gap_m == r[1].estimate.gap_m), "{flight:?}");
    }
}

#[test]
fn a_writer_killed_at_any_instant_leaves_whole_flights_once_and_no_lock() {
    let dir = tempfile::tempdir().unwrap();
    let mut committed = 0;
    for kill in 0..KILLS[usize::from(crate::gate::is_gate())] {
        let mut child = child(dir.path());
        // Spread over start, commit and compaction: the kill follows the child's next 0 to 40 files.
        let files = files_in(dir.path()) + (kill * 7_919) % 41;
        while files_in(dir.path()) < files {
            assert_eq!(child.try_wait().unwrap(), None, "the child gave up by itself");
        }
        child.kill().unwrap();
        child.wait().unwrap();
        let store = Store::create_or_open(dir.path()).unwrap();
        drop(store.lock(&Holder::this_process(), None).unwrap());
        assert_eq!(store.verify(), [], "kill {kill}");
        let records = store.records(&Query::default()).unwrap();
        assert_whole(&records);
        let accounts = store.accounts().unwrap();
        assert!(records.len() >= 3 * accounts.len(), "an account without its records");
        assert!(records.len() >= committed, "what was committed is gone");
        committed = records.len();
    }
    assert!(committed > 0, "the child never came to commit anything");
}

#[test]
fn a_reader_beside_a_writer_sees_whole_commits_only() {
    let dir = tempfile::tempdir().unwrap();
    let mut writer = writer(dir.path());
    let reader = Store::open(dir.path()).unwrap();
    std::thread::scope(|scope| {
        let writing = scope.spawn(move || {
            for step in 0..24 {
                let gap_m = 1e-6 * f64::from(step);
                let flight = i64::from(step % 5);
                writer.commit(&[result(1, flight, gap_m), result(2, flight, gap_m)]).unwrap();
                if step % 10 == 9 {
                    writer.compact().unwrap();
                }
            }
        });
        while !writing.is_finished() {
            assert_whole(&reader.records(&Query::default()).unwrap());
        }
        writing.join().unwrap();
    });
    assert_eq!(reader.records(&Query::default()).unwrap().len(), 30);
}
