//! Cache of the newest snapshot of a table, valid as long as the table's log does not change.
//!
//! A run reads the content of each table some ten times, with commits in between. Replaying the log every time took
//! a third of the fixed cost of a run; one listing of the folder shows whether the log changed.

use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

use crate::delta::durable_fs::Entry;
use crate::delta::location::Location;
use crate::delta::log_storage::LOG;
use crate::delta::snapshot::Snapshot;

/// A snapshot with the listing of its log.
type Kept = (Snapshot, Vec<Entry>);

/// The snapshot that is kept, shared by all who hold the table.
#[derive(Clone, Default)]
pub(crate) struct SnapshotCache(Arc<Mutex<Option<Kept>>>);

/// The file of a commit below its table's folder.
pub(crate) fn commit_file(version: u64) -> String {
    format!("{LOG}/{version:020}.json")
}

impl SnapshotCache {
    /// The snapshot kept, where the log has not changed since.
    pub(crate) fn get(&self, table: &Location) -> Option<Snapshot> {
        let kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let (snapshot, log) = kept.as_ref()?;
        table.join(LOG).entries().is_ok_and(|found| found == *log).then(|| snapshot.clone())
    }

    /// Forgets the snapshot.
    pub(crate) fn clear(&self) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }

    /// Replaces the cached snapshot, unless another commit is newer. In a bucket a listing costs
    /// as much as reading: nothing is kept.
    pub(crate) fn keep(&self, table: &Location, snapshot: &Snapshot) {
        let log = if table.is_bucket() { Vec::new() } else { table.join(LOG).entries().unwrap_or_default() };
        let has = |version| {
            let commit = table.dir().join(commit_file(version));
            log.iter().any(|entry| entry.path == commit)
        };
        let is_newest = has(snapshot.version) && !has(snapshot.version + 1);
        let kept = is_newest.then(|| (snapshot.clone(), log));
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = kept;
    }
}

impl fmt::Debug for SnapshotCache {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("SnapshotCache")
    }
}
