//! Fuzz target of the commit files: a store in which one of them changed gives an error, or all of its rows.

use std::path::{Path, PathBuf};

use store::{Query, Store};

use self::engine::{Input, Random, edit_text, fuzz, overwrite};
use crate::fixtures::{result, run, writer};

#[path = "../../../../tests/fuzz/engine.rs"]
pub(crate) mod engine;

/// A store of several commits, with a compaction behind it.
fn grown(dir: &Path) -> Store {
    let mut writer = writer(dir);
    for flight in 0..4 {
        writer.begin_run(&run("run", "2026-11-20T02:00:00Z", None), &[]).unwrap();
        writer.commit(&[result(1, flight, 1e-5), result(2, flight, 2e-5)]).unwrap();
        writer.end_run(&run("run", "2026-11-20T02:00:00Z", Some(0))).unwrap();
        if flight == 2 {
            writer.compact().unwrap();
        }
    }
    drop(writer);
    Store::open(dir).unwrap()
}

fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap().flatten() {
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy(&entry.path(), &target);
        } else {
            // Data files never change: a link is a copy.
            let is_data = target.extension().is_some_and(|e| e == "parquet");
            let linked = is_data && std::fs::hard_link(entry.path(), &target).is_ok();
            if !linked {
                std::fs::copy(entry.path(), &target).unwrap();
            }
        }
    }
}

/// The rows of every table as text.
fn rows(store: &Store) -> Result<String, store::Error> {
    let mut records: Vec<String> =
        store.records(&Query::default())?.iter().map(|record| format!("{record:?}")).collect();
    records.sort();
    let mut accounts: Vec<String> = store.accounts()?.iter().map(|account| format!("{account:?}")).collect();
    accounts.sort();
    let runs: Vec<String> = store.runs()?.iter().map(|run| format!("{run:?}")).collect();
    Ok([records, accounts, runs].concat().join("\n"))
}

#[test]
fn fuzz_commit_files() {
    let folder = tempfile::tempdir().unwrap();
    let whole = folder.path().join("whole");
    let sound = grown(&whole);
    let truth = rows(&sound).unwrap();
    assert!(sound.verify().is_empty(), "{:?}", sound.verify());
    let mut files: Vec<PathBuf> = ["gaps", "logs", "runs"]
        .iter()
        .flat_map(|table| std::fs::read_dir(whole.join(table).join("_delta_log")).unwrap().flatten())
        .map(|entry| entry.path())
        .filter(|file| file.is_file())
        .collect();
    files.sort();
    let corpus: Vec<Vec<u8>> = files.iter().map(|file| std::fs::read(file).unwrap()).collect();
    let name = |file: &PathBuf| file.strip_prefix(&whole).unwrap().to_owned();
    let names: Vec<PathBuf> = files.iter().map(name).collect();
    let others = corpus.clone();
    // The number of the file goes before its bytes.
    let numbered = corpus.iter().enumerate().map(|(number, bytes)| {
        let mut numbered = vec![number as u8];
        numbered.extend(bytes);
        numbered
    });
    let change = |random: &mut Random, input: &mut Input| {
        let number = input.bytes.remove(0);
        if random.below(2) == 0 {
            let length = input.bytes.len();
            overwrite(random, &mut input.bytes, std::slice::from_ref(&(0..length)));
        } else {
            edit_text(random, &mut input.bytes, &others);
        }
        input.bytes.insert(0, number);
    };
    let case = folder.path().join("case");
    fuzz("commit files", numbered.collect(), 120, change, |bytes| {
        let _ = std::fs::remove_dir_all(&case);
        copy(&whole, &case);
        std::fs::write(case.join(&names[usize::from(bytes[0])]), &bytes[1..]).unwrap();
        let changed = match Store::open(&case) {
            Ok(changed) => changed,
            Err(e) => return e.diagnostic().code,
        };
        let (found, verified) = (rows(&changed), changed.verify());
        match found {
            Ok(found) if found == truth => format!("all rows, {} found by verify", verified.len()),
            Ok(_) => {
                assert!(
                    !verified.is_empty(),
                    "rows differ, and verify finds nothing in {}",
                    names[usize::from(bytes[0])].display()
                );
                "other rows, found by verify".to_owned()
            }
            Err(e) => {
                assert!(!verified.is_empty(), "{} is not found by verify", e.diagnostic().message);
                e.diagnostic().code
            }
        }
    });
}
