//! Size, time and identity of a file, compared without opening it.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use ingest::log::flight_rows::split_path;
use ingest::{IdentityMapping, LogFiles};
use object_io::ListEntry;
use store::LogRecord;

/// File status of listed objects: it avoids one request per key for millions of keys.
pub(crate) type SeenObjects = HashMap<PathBuf, FileStat>;

/// Identity and version of a file without opening it.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct FileStat {
    /// Bytes.
    pub size_bytes: i64,
    /// Nanoseconds since 1970 UTC.
    pub modified_utc_ns: i64,
    /// Device and inode where the system has them; an object's e-tag.
    pub file_id: String,
}

impl FileStat {
    fn of(path: &Path, seen: &SeenObjects) -> Option<Self> {
        if object_io::is_address(path) {
            return seen.get(path).cloned();
        }
        let data = std::fs::metadata(path).ok()?;
        let modified = data.modified().ok().and_then(|m| m.duration_since(std::time::UNIX_EPOCH).ok());
        Some(Self {
            size_bytes: data.len() as i64,
            modified_utc_ns: modified.map_or(0, |m| m.as_nanos() as i64),
            file_id: file_id(&data),
        })
    }

    /// Of all files of a log: one that differs makes the whole differ.
    pub(crate) fn of_log(files: &LogFiles, seen: &SeenObjects, identity: &IdentityMapping) -> Option<Self> {
        let mut stats = files.all().map(|path| Self::of(&split_path(path, identity).0, seen));
        let first = stats.next()??;
        stats.try_fold(first, |whole, next| {
            let next = next?;
            Some(Self {
                size_bytes: whole.size_bytes + next.size_bytes,
                modified_utc_ns: whole.modified_utc_ns.max(next.modified_utc_ns),
                file_id: format!("{} {}", whole.file_id, next.file_id),
            })
        })
    }

    pub(crate) fn is_of(&self, account: &LogRecord) -> bool {
        self.size_bytes == account.size_bytes
            && self.modified_utc_ns == account.modified_utc_ns
            && self.file_id == account.file_id
    }
}

#[cfg(unix)]
fn file_id(data: &std::fs::Metadata) -> String {
    use std::os::unix::fs::MetadataExt;
    format!("{}:{}", data.dev(), data.ino())
}

#[cfg(not(unix))]
fn file_id(_: &std::fs::Metadata) -> String {
    String::new()
}

impl From<ListEntry> for FileStat {
    fn from(entry: ListEntry) -> Self {
        Self {
            size_bytes: entry.size_bytes as i64,
            modified_utc_ns: entry.modified_utc_ns,
            file_id: entry.e_tag,
        }
    }
}
