//! Fuzz target of the commit files: a store in which one of them changed gives an error, or all of its rows.

use std::path::{Path, PathBuf};

use store::{Query, Store};

use self::edits::{Choices, edit_text, overwrite};
use crate::fixtures::{result, run, writer};

#[path = "../../../../tests/fuzz/edits.rs"]
mod edits;

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
    let case = folder.path().join("case");
    bolero::check!().with_iterations(40).with_max_len(80).for_each(|input| {
        let choices = &mut Choices(input);
        let number = choices.below(files.len());
        let (name, mut bytes) = (files[number].strip_prefix(&whole).unwrap(), corpus[number].clone());
        if choices.below(2) == 0 {
            let length = bytes.len();
            overwrite(choices, &mut bytes, std::slice::from_ref(&(0..length)));
        } else {
            edit_text(choices, &mut bytes, &corpus);
        }
        let _ = std::fs::remove_dir_all(&case);
        copy(&whole, &case);
        std::fs::write(case.join(name), bytes).unwrap();
        let Ok(changed) = Store::open(&case) else { return };
        let is_whole = rows(&changed).is_ok_and(|found| found == truth);
        assert!(is_whole || !changed.verify().is_empty(), "verify finds nothing in {}", name.display());
    });
}
