//! Cache of the newest snapshot of a table, valid as long as the table's log does not change.
//!
//! A run reads the content of each table some ten times, with commits in between. Replaying the log every time took
//! a third of the fixed cost of a run; one listing of the folder shows whether the log changed.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fmt;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::SystemTime;

use crate::delta::location::Location;
use crate::delta::log_storage::LOG;
use crate::delta::snapshot::Snapshot;

/// A snapshot that is kept, shared by all who hold the table.
#[derive(Clone, Default)]
pub(crate) struct SnapshotCache(Arc<Mutex<Option<CachedSnapshot>>>);

struct CachedSnapshot {
    snapshot: Snapshot,
    log: LogListing,
}

/// The files of a log, each with its size and modification time: a truncated or replaced file
/// differs in one of them.
#[derive(PartialEq, Eq)]
struct LogListing(BTreeMap<OsString, (u64, SystemTime)>);

impl LogListing {
    /// None where the folder cannot be read, or its files have no modification time.
    fn of(dir: &Path) -> Option<Self> {
        let mut files = BTreeMap::new();
        for entry in std::fs::read_dir(dir).ok()? {
            let entry = entry.ok()?;
            let data = entry.metadata().ok()?;
            files.insert(entry.file_name(), (data.len(), data.modified().ok()?));
        }
        Some(Self(files))
    }

    /// Whether a version's commit is the last.
    fn ends_with(&self, version: u64) -> bool {
        let has = |version| self.0.contains_key(&OsString::from(name(version)));
        has(version) && !has(version + 1)
    }
}

fn name(version: u64) -> String {
    format!("{version:020}.json")
}

/// The file of a commit below its table's folder.
pub(crate) fn commit_file(version: u64) -> String {
    format!("{LOG}/{}", name(version))
}

impl SnapshotCache {
    /// The snapshot kept, where the log has not changed since.
    pub(crate) fn get(&self, location: &Location) -> Option<Snapshot> {
        let kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let CachedSnapshot { snapshot, log } = kept.as_ref()?;
        (LogListing::of(&location.dir().join(LOG)).as_ref() == Some(log)).then(|| snapshot.clone())
    }

    /// Forgets the snapshot.
    pub(crate) fn clear(&self) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }

    /// Replaces the cached snapshot, unless another commit is newer. In a bucket a listing costs
    /// as much as reading: nothing is kept.
    pub(crate) fn keep(&self, location: &Location, snapshot: &Snapshot) {
        let log = if location.is_bucket() { None } else { LogListing::of(&location.dir().join(LOG)) };
        let log = log.filter(|log| log.ends_with(snapshot.version));
        let kept = log.map(|log| CachedSnapshot { snapshot: snapshot.clone(), log });
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = kept;
    }
}

impl fmt::Debug for SnapshotCache {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("SnapshotCache")
    }
}
