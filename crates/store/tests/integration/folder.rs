//! The folder: made, known as ours, held by one.

use std::time::{Duration, Instant};

use store::{Error, Holder, Query, Store};

use crate::fixtures::{result, time, writer};

#[test]
fn a_second_writer_gets_the_holder_of_the_store_and_may_wait() {
    let dir = tempfile::tempdir().unwrap();
    let store = Store::create_or_open(dir.path()).unwrap();
    let holder = Holder { pid: 8812, host: "hangar2".into(), started_utc: time("2026-11-20T02:00:03Z") };
    let first = store.lock(&holder, None).unwrap();
    let error = store.lock(&Holder::this_process(), None).unwrap_err();
    assert_eq!(error.to_string(), "the store is held by pid 8812 on hangar2 since 2026-11-20 02:00:03 UTC");
    let clock = Instant::now();
    assert!(store.lock(&Holder::this_process(), Some(Duration::from_millis(250))).is_err());
    assert!(clock.elapsed() >= Duration::from_millis(250));
    drop(first);
    store.lock(&Holder::this_process(), Some(Duration::from_secs(5))).unwrap();
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
