//! Snapshot of a Delta table: its version and data files; and a cache of the newest one, valid as long as the table's log
//! does not change.
//!
//! A run reads the content of each table some ten times, with commits in between. Replaying the log every time took
//! a third of the fixed cost of a run; one listing of the folder shows whether the log changed.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use deltalake::DeltaTable;
use deltalake::kernel::LogicalFileView;

use crate::delta::data_file;
use crate::delta::durable_fs::Entry;
use crate::delta::file_stats::Stats;
use crate::delta::location::Location;
use crate::delta::log_storage::LOG;

/// One version of a table; cheap to clone.
#[derive(Clone)]
pub(crate) struct Snapshot {
    pub(crate) version: u64,
    pub(crate) files: Arc<[DataFile]>,
    pub(crate) delta: DeltaTable,
}

impl Snapshot {
    pub(crate) fn paths(&self) -> impl Iterator<Item = PathBuf> {
        self.files.iter().map(|file| file.path.clone())
    }

    pub(crate) fn paths_where(&self, may_be_in: impl Fn(&Stats) -> bool) -> Vec<PathBuf> {
        let files = self.files.iter().filter(|file| file.has_rows() && may_be_in(&file.stats));
        files.map(|file| file.path.clone()).collect()
    }
}

/// Data file as recorded in the log.
pub(crate) struct DataFile {
    pub(crate) path: PathBuf,
    pub(crate) size_bytes: u64,
    pub(crate) stats: Stats,
    pub(crate) view: LogicalFileView,
}

impl DataFile {
    /// Whether the file may hold rows, by its statistics.
    pub(crate) fn has_rows(&self) -> bool {
        self.stats.num_records != Some(0)
    }

    pub(crate) fn has_digest(&self) -> bool {
        let name = self.path.file_name().and_then(|name| name.to_str());
        name.is_some_and(|name| data_file::digest_of_name(name).is_some())
    }
}

/// A snapshot with the listing of its log.
type Kept = (Snapshot, Vec<Entry>);

/// The snapshot that is kept, shared by all who hold the table.
#[derive(Clone, Default)]
pub(crate) struct SnapshotCache(Arc<Mutex<Option<Kept>>>);

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
