//! Fuzz target of the files of a store: one in which a commit file, a checkpoint or a data file changed gives an error, or
//! all of its rows, and `verify` finds the change.

use std::path::{Path, PathBuf};

use store::{Query, Store};

use self::edits::{Choices, edit_text, overwrite};
use crate::fixtures::{result, run, writer};

#[path = "../../../../tests/fuzz/edits.rs"]
mod edits;

/// A store of several commits, with a compaction and a checkpoint behind it.
fn grown(dir: &Path) -> Store {
    let mut writer = writer(dir);
    writer.begin_run(&run("run", "2026-11-20T02:00:00Z", None), &[]).unwrap();
    for flight in 0..21 {
        writer.commit(&[result(1, flight, 1e-5), result(2, flight, 2e-5)]).unwrap();
        if flight == 2 {
            writer.compact().unwrap();
        }
    }
    writer.end_run(&run("run", "2026-11-20T02:00:00Z", Some(0))).unwrap();
    drop(writer);
    Store::open(dir).unwrap()
}

/// Links each file: the one that a case changes is removed first, and a reader changes none.
fn link(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap().flatten() {
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            link(&entry.path(), &target);
        } else {
            std::fs::hard_link(entry.path(), target).unwrap();
        }
    }
}

fn texts<R: std::fmt::Debug>(rows: &[R]) -> Vec<String> {
    let mut texts: Vec<String> = rows.iter().map(|row| format!("{row:?}")).collect();
    texts.sort();
    texts
}

/// The rows of every table as text; the columns of a scan are those of the records.
fn rows(store: &Store) -> Result<String, store::Error> {
    let scan = store.scan_columns(&Query::default(), &["gap_m"])?;
    (0..scan.file_count()).try_for_each(|file| scan.read(file).map(drop))?;
    let records = texts(&store.records(&Query::default())?);
    Ok([records, texts(&store.accounts()?), texts(&store.runs()?)].concat().join("\n"))
}

#[test]
fn fuzz_store_files() {
    let folder = tempfile::tempdir().unwrap();
    let whole = folder.path().join("whole");
    let sound = grown(&whole);
    let truth = rows(&sound).unwrap();
    assert!(sound.verify().is_empty(), "{:?}", sound.verify());
    let mut files: Vec<PathBuf> = ["gaps", "logs", "runs"]
        .iter()
        .flat_map(|table| std::fs::read_dir(whole.join(table).join("_delta_log")).unwrap().flatten())
        .map(|entry| entry.path())
        .filter(|file| file.is_file() && !file.ends_with("_last_checkpoint"))
        .collect();
    assert!(files.iter().any(|file| file.to_str().unwrap().contains("checkpoint.parquet")), "{files:?}");
    let (of_log, data) = (files.len(), sound.table_files("gaps").unwrap());
    files.extend(data);
    files[..of_log].sort();
    let corpus: Vec<Vec<u8>> = files.iter().map(|file| std::fs::read(file).unwrap()).collect();
    let case = folder.path().join("case");
    bolero::check!().with_iterations(40).with_max_len(80).for_each(|input| {
        let choices = &mut Choices(input);
        let number = choices.below(files.len());
        let (name, mut bytes) = (files[number].strip_prefix(&whole).unwrap(), corpus[number].clone());
        let is_text = name.extension().is_some_and(|ending| ending == "json");
        if !is_text || choices.below(2) == 0 {
            let length = bytes.len();
            overwrite(choices, &mut bytes, std::slice::from_ref(&(0..length)));
        } else {
            edit_text(choices, &mut bytes, &corpus);
        }
        let is_changed = bytes != corpus[number];
        let _ = std::fs::remove_dir_all(&case);
        link(&whole, &case);
        std::fs::remove_file(case.join(name)).unwrap();
        std::fs::write(case.join(name), bytes).unwrap();
        let Ok(changed) = Store::open(&case) else { return };
        let is_found = !changed.verify().is_empty();
        assert!(is_found || !is_changed, "verify finds nothing in {}", name.display());
        let found = rows(&changed);
        let is_whole = found.as_ref().is_ok_and(|found| *found == truth);
        assert!(is_whole || found.is_err() || number < of_log, "other rows in {}", name.display());
    });
}
