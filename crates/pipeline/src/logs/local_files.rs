//! Files of this machine that fit a pattern: `*` within a name, `**` across folders.
//!
//! Links to folders are followed. A folder that was reached before is not entered again, so that links in a loop, or
//! folders that hold links to each other, end.

use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::path::{Component, Path, PathBuf};

use glob::{Pattern, PatternError};

/// What fits a pattern, and what could not be listed or was passed over.
#[derive(Debug, Default)]
pub(crate) struct LocalFiles {
    /// Paths that fit, folders among them.
    pub(crate) paths: BTreeSet<PathBuf>,
    /// Folders that cannot be listed, and links that lead back.
    pub(crate) faults: Vec<(PathBuf, io::Error)>,
    /// Folders below `**`, without links.
    entered: BTreeSet<(usize, PathBuf)>,
}

/// One part of a pattern.
enum Part {
    /// As it is written.
    Plain(PathBuf),
    /// Any name that fits.
    Names(Pattern),
    /// Any number of folders.
    Folders,
}

/// Searches the files below `folder` that fit a pattern.
///
/// # Errors
/// When it is no pattern.
pub(crate) fn matching(folder: &Path, pattern: &str) -> Result<LocalFiles, PatternError> {
    Pattern::new(pattern)?;
    let part = |component: Component<'_>| {
        let name = component.as_os_str();
        match (component, name.to_str()) {
            (Component::Normal(_), Some("**")) => Ok(Part::Folders),
            (Component::Normal(_), Some(text)) if text.contains(['*', '?', '[']) => {
                Pattern::new(text).map(Part::Names)
            }
            _ => Ok(Part::Plain(PathBuf::from(name))),
        }
    };
    let parts = Path::new(pattern).components().map(part).collect::<Result<Vec<_>, _>>()?;
    let mut found = LocalFiles::default();
    found.walk(folder, &parts);
    Ok(found)
}

impl LocalFiles {
    fn walk(&mut self, folder: &Path, parts: &[Part]) {
        let Some((part, rest)) = parts.split_first() else { return };
        match part {
            Part::Plain(name) => self.take(folder.join(name), rest),
            Part::Names(pattern) => {
                for path in self.entries(folder) {
                    let fits = |name: &std::ffi::OsStr| pattern.matches(&name.to_string_lossy());
                    if path.file_name().is_some_and(fits) {
                        self.take(path, rest);
                    }
                }
            }
            Part::Folders if rest.is_empty() => self.below(folder, parts, true),
            Part::Folders => self.below(folder, parts, false),
        }
    }

    /// A path that fits so far: one of the answers, or a folder to go on in.
    fn take(&mut self, path: PathBuf, rest: &[Part]) {
        if !rest.is_empty() {
            if !matches!(rest[0], Part::Plain(_)) && !path.is_dir() {
                return;
            }
            self.walk(&path, rest);
        } else if path.symlink_metadata().is_ok() {
            self.paths.insert(path);
        }
    }

    /// Every folder below one, itself included, each once.
    fn below(&mut self, folder: &Path, parts: &[Part], takes_folders: bool) {
        let here = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
        let Ok(real) = here.canonicalize() else { return };
        if !self.entered.insert((parts.len(), real.clone())) {
            // A link to a folder around it is a loop; another way to a folder is none.
            if here.is_symlink()
                && here.parent().and_then(|p| p.canonicalize().ok()).is_some_and(|p| p.starts_with(&real))
            {
                let loops = io::Error::other("the link leads back to a folder around it");
                self.faults.push((folder.to_owned(), loops));
            }
            return;
        }
        if takes_folders {
            self.paths.insert(folder.to_owned());
        } else {
            self.walk(folder, &parts[1..]);
        }
        // Folders before links to them, which are other names of the same.
        let (links, folders): (Vec<_>, Vec<_>) =
            self.entries(folder).into_iter().filter(|path| path.is_dir()).partition(|path| path.is_symlink());
        folders.iter().chain(&links).for_each(|path| self.below(path, parts, takes_folders));
    }

    /// Paths in a folder, in order; without those that vanish meanwhile.
    fn entries(&mut self, folder: &Path) -> Vec<PathBuf> {
        let listed = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
        let entries = fs::read_dir(listed).and_then(Iterator::collect::<io::Result<Vec<_>>>);
        match entries {
            Ok(entries) => {
                let mut paths: Vec<_> = entries.iter().map(|entry| folder.join(entry.file_name())).collect();
                paths.sort_unstable();
                paths
            }
            Err(error) => {
                let is_gone = matches!(error.kind(), io::ErrorKind::NotFound | io::ErrorKind::NotADirectory);
                if !is_gone && !self.faults.iter().any(|(path, _)| path == folder) {
                    self.faults.push((folder.to_owned(), error));
                }
                Vec::new()
            }
        }
    }
}

#[cfg(test)]
mod tests {
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
}
