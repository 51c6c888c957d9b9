//! The folder: made, known as ours, held by one.

use std::time::{Duration, Instant};

use store::{Error, Query, Store};

use crate::fixtures::{result, writer};

#[test]
fn a_second_writer_gets_the_holder_of_the_store_and_may_wait() {
    let dir = tempfile::tempdir().unwrap();
    let store = Store::create_or_open(dir.path()).unwrap();
    let first = store.lock(None).unwrap();
    let error = store.lock(None).unwrap_err().to_string();
    assert!(error.starts_with(&format!("the store is held by pid {} on ", std::process::id())), "{error}");
    let clock = Instant::now();
    assert!(store.lock(Some(Duration::from_millis(250))).is_err());
    assert!(clock.elapsed() >= Duration::from_millis(250));
    drop(first);
    store.lock(Some(Duration::from_secs(5))).unwrap();
}

#[test]
fn an_empty_folder_and_the_root_of_an_ext4_volume_can_become_a_store() {
    let dir = tempfile::tempdir().unwrap();
    for inside in ["", "lost+found"] {
        std::fs::create_dir_all(dir.path().join(inside)).unwrap();
        assert!(matches!(Store::open(dir.path()).unwrap_err(), Error::Missing { .. }));
    }
    writer(dir.path()).commit(&[result(1, 0, 1e-6)]).unwrap();
    assert_eq!(Store::open(dir.path()).unwrap().records(&Query::default()).unwrap().len(), 3);
}

/// A link to itself cannot be read by any user, root included, like a folder without permissions by others.
#[cfg(unix)]
#[test]
fn a_table_that_cannot_be_read_is_not_taken_for_a_missing_store() {
    let dir = tempfile::tempdir().unwrap();
    writer(dir.path()).commit(&[result(1, 0, 1e-6)]).unwrap();
    let opened = Store::open(dir.path()).unwrap();
    let (table, kept) = (dir.path().join("gaps"), dir.path().join("logs-kept"));
    std::fs::rename(&table, &kept).unwrap();
    std::os::unix::fs::symlink(&table, &table).unwrap();
    for error in [Store::open(dir.path()).unwrap_err(), opened.records(&Query::default()).unwrap_err()] {
        assert!(matches!(error, Error::Io { .. }), "{error}");
        assert!(!error.diagnostic().hint.unwrap().contains("remove"), "{error}");
    }
}
