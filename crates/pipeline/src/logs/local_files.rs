//! Files of this machine that fit a pattern: `*` within a name, `**` across folders.
//!
//! Links to folders are followed. A folder that was reached before is not entered again, so that links in a loop, or
//! folders that hold links to each other, end.

use std::collections::BTreeSet;
use std::io;
use std::path::{Component, Path, PathBuf};

use glob::{MatchOptions, Pattern, PatternError};
use walkdir::{DirEntry, WalkDir};

/// `*` stays within a folder, `**` does not.
pub(crate) const AS_FILES: MatchOptions = MatchOptions {
    case_sensitive: true,
    require_literal_separator: true,
    require_literal_leading_dot: false,
};

/// Files that match a pattern, and paths that could not be listed or were skipped.
#[derive(Debug, Default)]
pub(crate) struct LocalFiles {
    pub(crate) paths: BTreeSet<PathBuf>,
    /// Folders that cannot be listed, links that lead nowhere, and links that lead back.
    pub(crate) faults: Vec<(PathBuf, io::Error)>,
}

/// Searches the files below `folder` that fit a pattern.
///
/// # Errors
/// When it is no pattern.
pub(crate) fn matching(folder: &Path, pattern: &str) -> Result<LocalFiles, PatternError> {
    Pattern::new(pattern)?;
    let mut found = LocalFiles::default();
    let parts: Vec<_> = Path::new(pattern).components().collect();
    let (written, rest) = parts.split_at(parts_written_out(Path::new(pattern)));
    let root = folder.join(written.iter().collect::<PathBuf>());
    if rest.is_empty() {
        found.paths.extend(root.symlink_metadata().is_ok().then_some(root));
        return Ok(found);
    }
    let texts: Vec<_> = rest.iter().map(|part| part.as_os_str().to_string_lossy()).collect();
    let whole = Pattern::new(&texts.join("/"))?;
    let names = texts.iter().map(|text| Pattern::new(text)).collect::<Result<Vec<_>, _>>()?;
    let across_folders = texts.iter().position(|text| text == "**");
    let listed = if root.as_os_str().is_empty() { Path::new(".") } else { &root };
    let below = |path: &Path| path.strip_prefix(listed).unwrap_or(path).to_owned();
    // `**` at the end stands for folders, which are no logs.
    let fits = |path: &Path| {
        texts.last().is_some_and(|last| last != "**")
            && whole.matches_with(&below(path).to_string_lossy(), AS_FILES)
    };
    let mut entered = BTreeSet::new();
    // A folder that the names of the pattern lead to; below `**`, each only once.
    let is_entered = |entry: &DirEntry| {
        let depth = entry.depth();
        let is_named = |name: &Pattern| name.matches(&entry.file_name().to_string_lossy());
        let is_across = depth == 0 || across_folders.is_some_and(|first| depth > first);
        let mut is_new = || entry.path().canonicalize().is_ok_and(|real| entered.insert(real));
        !entry.file_type().is_dir()
            || ((is_across || is_named(&names[depth - 1])) && (across_folders.is_none() || is_new()))
    };
    let walk = WalkDir::new(listed)
        .max_depth(across_folders.map_or(rest.len(), |_| usize::MAX))
        .follow_links(true)
        // Folders before links to them, which are other names of the same.
        .sort_by(|a, b| (a.path_is_symlink(), a.file_name()).cmp(&(b.path_is_symlink(), b.file_name())));
    for entry in walk.into_iter().filter_entry(is_entered) {
        match entry {
            Ok(entry) => {
                let fits = !entry.file_type().is_dir() && fits(entry.path());
                found.paths.extend(fits.then(|| root.join(below(entry.path()))));
            }
            Err(error) => {
                let path = error.path().unwrap_or(listed).to_owned();
                let is_fault = match error.loop_ancestor() {
                    Some(_) => across_folders.is_some(),
                    // What vanished meanwhile is no fault.
                    None => path.symlink_metadata().is_ok() && (path.is_dir() || fits(&path)),
                };
                let loops = || io::Error::other("the link leads back to a folder around it");
                let error = error.into_io_error().unwrap_or_else(loops);
                found.faults.extend(is_fault.then(|| (root.join(below(&path)), error)));
            }
        }
    }
    Ok(found)
}

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
    use std::fs;

    use super::*;

    fn names(found: &LocalFiles, folder: &Path) -> Vec<String> {
        let paths = found.paths.iter().filter(|path| path.is_file());
        paths.map(|path| path.strip_prefix(folder).unwrap().to_string_lossy().replace('\\', "/")).collect()
    }

    #[test]
    fn patterns_find_what_the_glob_crate_finds() {
        let dir = tempfile::tempdir().unwrap();
        for file in
            ["a.parquet", "x/b.parquet", "x/y/c.parquet", "x/y/d.txt", "z [1]/e.parquet", ".h/f.parquet"]
        {
            let file = dir.path().join(file);
            fs::create_dir_all(file.parent().unwrap()).unwrap();
            fs::write(file, "").unwrap();
        }
        for pattern in [
            "*.parquet",
            "**/*.parquet",
            "x/**/*",
            "x/*/c.parquet",
            "*/*.parquet",
            "x/y/d.txt",
            "./x/../a.*",
            "**/y/*",
        ] {
            let found = names(&matching(dir.path(), pattern).unwrap(), dir.path());
            let whole = dir.path().join(pattern);
            let mut wanted: Vec<_> = glob::glob(whole.to_str().unwrap()).unwrap().flatten().collect();
            wanted.retain(|path| path.is_file());
            let wanted: Vec<_> = wanted.iter().map(|path| path.canonicalize().unwrap()).collect();
            let real: Vec<_> =
                found.iter().map(|path| dir.path().join(path).canonicalize().unwrap()).collect();
            assert_eq!(real, wanted, "{pattern}");
        }
        assert!(matching(dir.path(), "a**b").is_err());
    }

    /// Each of twenty folders holds two links to the one around it, and two to the next.
    #[cfg(unix)]
    #[test]
    fn links_in_a_loop_end_and_are_named() {
        use std::os::unix::fs::symlink;
        let dir = tempfile::tempdir().unwrap();
        for k in 0..20 {
            let folder = dir.path().join(k.to_string());
            fs::create_dir(&folder).unwrap();
            fs::write(folder.join("a.parquet"), "").unwrap();
            for link in ["u", "v"] {
                symlink("..", folder.join(link)).unwrap();
                symlink(format!("../{}", k + 1), folder.join(format!("{link}{link}"))).unwrap();
            }
        }
        let found = matching(dir.path(), "**/*.parquet").unwrap();
        assert_eq!((names(&found, dir.path()).len(), found.faults.len()), (20, 40));
    }

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
