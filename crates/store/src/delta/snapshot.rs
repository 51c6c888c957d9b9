//! Snapshot of a Delta table: its version and data files.

use std::path::PathBuf;
use std::sync::Arc;

use deltalake::DeltaTable;
use deltalake::kernel::LogicalFileView;

use crate::delta::data_file;
use crate::delta::file_stats::Stats;

/// One version of a table; cheap to clone.
#[derive(Clone)]
pub(crate) struct Snapshot {
    pub(crate) version: u64,
    pub(crate) files: Arc<[DataFile]>,
    pub(crate) delta: DeltaTable,
}

impl Snapshot {
    /// Paths of the data files.
    pub(crate) fn paths(&self) -> impl Iterator<Item = PathBuf> {
        self.files.iter().map(|file| file.path.clone())
    }

    /// Paths of the data files with rows whose statistics `may_be_in` accepts.
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

    /// Whether the file name contains the digest of the content.
    pub(crate) fn has_digest(&self) -> bool {
        let name = self.path.file_name().and_then(|name| name.to_str());
        name.is_some_and(|name| data_file::digest_of_name(name).is_some())
    }
}
