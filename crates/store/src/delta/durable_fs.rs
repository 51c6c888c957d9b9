//! Durable local writes: content is synced before its name appears, and the folder before the call returns. And listings
//! that fail when they are not complete.

use std::fs::File;
use std::io::{self, Write};
use std::path::{Path as FsPath, PathBuf};
use std::time::SystemTime;

pub(crate) fn sync_dir(dir: &FsPath) -> io::Result<()> {
    if cfg!(unix) { File::open(dir)?.sync_all() } else { Ok(()) }
}

/// Writes a whole file under a new name. `false` when a file with other content has that name.
///
/// Only the link itself reports that the name is taken: other calls give `AlreadyExists` for other reasons. A name that is
/// taken by the same content counts as written, since the reply to an earlier link may have been lost.
pub(crate) fn create(path: &FsPath, parts: &[&[u8]]) -> io::Result<bool> {
    let (dir, staged) = stage(path, parts)?;
    let linked = std::fs::hard_link(&staged, path);
    // Best effort: a staged file that is left is ignored by readers and replaced by the next write.
    let _ = std::fs::remove_file(&staged);
    let is_ours = match linked {
        Ok(()) => true,
        Err(e) if e.kind() == io::ErrorKind::AlreadyExists => std::fs::read(path)? == parts.concat(),
        Err(e) => return Err(e),
    };
    sync_dir(dir)?;
    Ok(is_ours)
}

pub(crate) fn replace(path: &FsPath, parts: &[&[u8]]) -> io::Result<()> {
    let (dir, staged) = stage(path, parts)?;
    if let Err(error) = std::fs::rename(&staged, path) {
        let _ = std::fs::remove_file(&staged);
        return Err(error);
    }
    sync_dir(dir)
}

/// Creates a folder and its parents.
///
/// `create_dir_all` returns `AlreadyExists` when the folder exists and its `stat` fails. That error does not concern
/// the file to be written, so the error of the `stat` is returned instead.
pub(crate) fn create_folder(dir: &FsPath) -> io::Result<()> {
    match std::fs::create_dir_all(dir) {
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => match std::fs::metadata(dir) {
            Ok(found) if found.is_dir() => Ok(()),
            Ok(_) => Err(io::ErrorKind::NotADirectory.into()),
            Err(error) => Err(error),
        },
        done => done,
    }
}

/// A file of a folder or prefix. One that is truncated or replaced differs in its size or the time it was written.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Entry {
    pub(crate) path: PathBuf,
    pub(crate) bytes: u64,
    pub(crate) written: SystemTime,
}

/// The files in a folder, in the order of names. A file whose `stat` fails is an error, unless it was deleted meanwhile.
pub(crate) fn entries(dir: &FsPath) -> io::Result<Vec<Entry>> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(dir)? {
        let path = entry?.path();
        match std::fs::metadata(&path) {
            Ok(data) if data.is_file() => {
                found.push(Entry { path, bytes: data.len(), written: data.modified()? });
            }
            Err(error) if error.kind() != io::ErrorKind::NotFound => {
                return Err(io::Error::new(error.kind(), format!("{}: {error}", path.display())));
            }
            _ => {}
        }
    }
    found.sort_unstable_by(|a, b| a.path.cmp(&b.path));
    Ok(found)
}

/// Writes and syncs the content under a temporary name; returns the folder and that name.
fn stage<'a>(path: &'a FsPath, parts: &[&[u8]]) -> io::Result<(&'a FsPath, PathBuf)> {
    let dir = path.parent().unwrap_or(FsPath::new("."));
    create_folder(dir)?;
    // The local object store does not list a name with a number after a hash sign.
    let mut staged = path.as_os_str().to_owned();
    staged.push(format!("#{}", std::process::id()));
    let staged = PathBuf::from(staged);
    let written = object_io::create_fresh(&staged).and_then(|mut file| {
        parts.iter().try_for_each(|part| file.write_all(part))?;
        file.sync_all()
    });
    if let Err(error) = written {
        // Best effort: the error that is reported is the one that happened first.
        let _ = std::fs::remove_file(&staged);
        return Err(error);
    }
    Ok((dir, staged))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_existing_file_is_distinguished_from_one_with_the_same_content() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a");
        assert!(create(&path, &[b"one"]).unwrap());
        assert!(create(&path, &[b"one"]).unwrap(), "the same content counts as written");
        assert!(!create(&path, &[b"two"]).unwrap());
        assert_eq!(std::fs::read(&path).unwrap(), b"one");
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1, "no staged file is left");
    }

    /// `mkdir` gives `EEXIST` for a dangling link, as for a folder whose `stat` fails with `EIO`.
    #[cfg(unix)]
    #[test]
    fn a_folder_that_cannot_be_reached_is_not_taken_for_a_written_file() {
        let dir = tempfile::tempdir().unwrap();
        let folder = dir.path().join("table");
        std::os::unix::fs::symlink(dir.path().join("nowhere"), &folder).unwrap();
        let error = create(&folder.join("a"), &[b"one"]).unwrap_err();
        assert_ne!(error.kind(), io::ErrorKind::AlreadyExists);
    }
}
