//! Files that writers and copying tools leave in folders of logs: hidden and unfinished files, and those of engines.

use std::path::{Component, Path};

/// Folders and files of Spark, Hadoop, Delta and Parquet writers that hold no log.
const OF_ENGINES: [&str; 6] =
    ["_temporary", "_delta_log", "_spark_metadata", "_SUCCESS", "_metadata", "_common_metadata"];
/// Beginnings of such names.
const BEGINNINGS: [&str; 3] = [".", "_started_", "_committed_"];
/// Ends of the names of unfinished copies and of checksums.
const ENDS: [&str; 7] = [".tmp", ".temp", ".part", ".partial", ".crdownload", ".filepart", ".crc"];

/// Whether a path names a temporary file below the part of a pattern that its user wrote out.
pub fn is_temporary(path: &Path, pattern: &Path) -> bool {
    path.components().skip(parts_written_out(pattern)).any(|part| {
        let name = part.as_os_str().to_string_lossy();
        OF_ENGINES.contains(&name.as_ref())
            || BEGINNINGS.iter().any(|begin| name.starts_with(begin))
            || ENDS.iter().any(|end| name.ends_with(end))
    })
}

/// How many parts of a pattern stand before its first wildcard.
pub(crate) fn parts_written_out(pattern: &Path) -> usize {
    let is_written_out = |part: &Component<'_>| !part.as_os_str().to_string_lossy().contains(['*', '?', '[']);
    pattern.components().take_while(is_written_out).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Names that Spark, Hadoop, Delta Lake, macOS, rsync and browsers give to files that are no logs; a name that the
    /// pattern writes out is meant.
    #[test]
    fn unfinished_and_hidden_files_are_no_logs() {
        let all = "/logs/**/*";
        for (pattern, path, expected) in [
            (all, "/logs/._a.parquet", true),
            (all, "/logs/N1/.a.parquet.tmp", true),
            (all, "/logs/N1/a.parquet.tmp", true),
            (all, "/logs/_temporary/0/a.parquet", true),
            (all, "/logs/_delta_log/00000000000000000010.checkpoint.parquet", true),
            (all, "/logs/_SUCCESS", true),
            (all, "/logs/N1/_metadata", true),
            (all, "/logs/.a.parquet.crc", true),
            (all, "/logs/a.parquet", false),
            (all, "/logs/_archive/_a.parquet", false),
            (all, "/logs/tail=N1/a.b.parquet", false),
            ("/home/.cache/logs/*.parquet", "/home/.cache/logs/a.parquet", false),
            ("/home/.cache/logs/*.parquet", "/home/.cache/logs/.a.parquet", true),
        ] {
            assert_eq!(is_temporary(Path::new(path), Path::new(pattern)), expected, "{path}");
        }
    }
}
