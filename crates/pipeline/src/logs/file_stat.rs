//! Size, time and identity of a file, compared without opening it.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use ingest::log::flight_rows::split_path;
use ingest::{IdentityMapping, LogFiles};
use store::LogRecord;

/// File status of listed objects: it avoids one request per key for millions of keys.
pub(crate) type SeenObjects = HashMap<PathBuf, FileStat>;

/// Identity and version of a file without opening it.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[expect(missing_docs, reason = "each field is named for what it holds, with its unit")]
pub struct FileStat {
    pub size_bytes: i64,
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

    /// Of all files of a log: their sizes added up, the latest time, and identity and time of each.
    pub(crate) fn of_log(files: &LogFiles, seen: &SeenObjects, identity: &IdentityMapping) -> Option<Self> {
        let stats = files.all().map(|path| Self::of(&split_path(path, identity).0, seen));
        let stats = stats.collect::<Option<Vec<Self>>>()?;
        if let [one] = &stats[..] {
            return Some(one.clone());
        }
        let id = |stat: &Self| format!("{}@{}", stat.file_id, stat.modified_utc_ns);
        Some(Self {
            size_bytes: stats.iter().map(|stat| stat.size_bytes).sum(),
            modified_utc_ns: stats.iter().map(|stat| stat.modified_utc_ns).max()?,
            file_id: stats.iter().map(id).collect::<Vec<_>>().join(" "),
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

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::fs::File;
    use std::time::{Duration, UNIX_EPOCH};

    use super::*;

    /// The second file is the newer one; the first is written again with the same size, before the second one's time.
    #[test]
    fn a_log_differs_when_one_of_its_files_is_written_again() {
        let dir = tempfile::tempdir().unwrap();
        let main = ["a", "b"].map(|name| dir.path().join(name)).to_vec();
        let write = |file: usize, at_s: u64| {
            let written = File::create(&main[file]).unwrap();
            written.set_modified(UNIX_EPOCH + Duration::from_secs(at_s)).unwrap();
        };
        let files = LogFiles { main: main.clone(), groups: BTreeMap::new() };
        let stat = || FileStat::of_log(&files, &SeenObjects::default(), &IdentityMapping::default()).unwrap();
        write(0, 10);
        write(1, 20);
        let before = stat();
        assert_eq!(stat(), before);
        write(0, 15);
        assert_ne!(stat(), before);
    }
}
