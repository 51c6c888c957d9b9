//! Durable local writes: content is synced before its name appears, and the folder before the call returns.
//!
//! `object_store` 0.13 does not sync, so a power cut can leave the name of a commit on an empty file. [`DurableFiles`]
//! wraps its local store for every write of delta-rs (commits, checkpoints); data files are written by the functions.

use std::fmt;
use std::fs::File;
use std::io::{self, Write};
use std::path::{Path as FsPath, PathBuf};

use async_trait::async_trait;
use deltalake::logstore::object_store::local::LocalFileSystem;
use deltalake::logstore::object_store::path::Path;
use deltalake::logstore::object_store::{
    CopyOptions, Error, GetOptions, GetResult, ListResult, MultipartUpload, ObjectMeta, ObjectStore, PutMode,
    PutMultipartOptions, PutOptions, PutPayload, PutResult, RenameOptions, Result,
};
use futures::stream::{self, BoxStream};
use futures::{StreamExt, TryStreamExt};

/// Writes a whole file under a new name. `false` when a file with other content has that name.
pub(crate) fn create(path: &FsPath, content: &[u8]) -> io::Result<bool> {
    create_parts(path, &[content])
}

/// Writes a whole file; replaces a file of the same name.
pub(crate) fn replace(path: &FsPath, content: &[u8]) -> io::Result<()> {
    replace_parts(path, &[content])
}

/// Makes the entries of a folder durable.
pub(crate) fn sync_dir(dir: &FsPath) -> io::Result<()> {
    if cfg!(unix) { File::open(dir)?.sync_all() } else { Ok(()) }
}

/// Only the link itself reports that the name is taken: other calls give `AlreadyExists` for other reasons.
///
/// A name that is taken by the same content counts as written, since the reply to an earlier link may have been lost.
fn create_parts(path: &FsPath, parts: &[&[u8]]) -> io::Result<bool> {
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

fn replace_parts(path: &FsPath, parts: &[&[u8]]) -> io::Result<()> {
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

/// Writes and syncs the content under a temporary name; returns the folder and that name.
fn stage<'a>(path: &'a FsPath, parts: &[&[u8]]) -> io::Result<(&'a FsPath, PathBuf)> {
    let dir = path.parent().unwrap_or(FsPath::new("."));
    create_folder(dir)?;
    let staged = staged(path);
    match write_synced(&staged, parts) {
        Ok(()) => Ok((dir, staged)),
        Err(error) => {
            // Best effort: the error that is reported is the one that happened first.
            let _ = std::fs::remove_file(&staged);
            Err(error)
        }
    }
}

fn write_synced(staged: &FsPath, parts: &[&[u8]]) -> io::Result<()> {
    let mut file = File::create(staged)?;
    for part in parts {
        file.write_all(part)?;
    }
    file.sync_all()
}

/// Temporary name that the local object store does not list: a number after a hash sign.
fn staged(path: &FsPath) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(format!("#{}", std::process::id()));
    PathBuf::from(name)
}

/// Local file system with durable writes.
#[derive(Debug, Default)]
pub(crate) struct DurableFiles {
    inner: LocalFileSystem,
}

impl fmt::Display for DurableFiles {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "durable {}", self.inner)
    }
}

fn failed(source: io::Error) -> Error {
    Error::Generic { store: "durable", source: Box::new(source) }
}

#[async_trait]
impl ObjectStore for DurableFiles {
    async fn put_opts(&self, location: &Path, payload: PutPayload, options: PutOptions) -> Result<PutResult> {
        let path = self.inner.path_to_filesystem(location)?;
        let parts: Vec<&[u8]> = payload.iter().map(AsRef::as_ref).collect();
        match options.mode {
            PutMode::Create if create_parts(&path, &parts).map_err(failed)? => {}
            PutMode::Create => {
                let source = io::Error::from(io::ErrorKind::AlreadyExists).into();
                return Err(Error::AlreadyExists { path: location.to_string(), source });
            }
            PutMode::Overwrite => replace_parts(&path, &parts).map_err(failed)?,
            PutMode::Update(_) => return self.inner.put_opts(location, payload, options).await,
        }
        Ok(PutResult { e_tag: None, version: None })
    }

    async fn put_multipart_opts(
        &self,
        location: &Path,
        options: PutMultipartOptions,
    ) -> Result<Box<dyn MultipartUpload>> {
        self.inner.put_multipart_opts(location, options).await
    }

    async fn get_opts(&self, location: &Path, options: GetOptions) -> Result<GetResult> {
        self.inner.get_opts(location, options).await
    }

    fn delete_stream(&self, locations: BoxStream<'static, Result<Path>>) -> BoxStream<'static, Result<Path>> {
        self.inner.delete_stream(locations)
    }

    fn list(&self, prefix: Option<&Path>) -> BoxStream<'static, Result<ObjectMeta>> {
        self.complete(prefix, None, self.inner.list(prefix))
    }

    fn list_with_offset(
        &self,
        prefix: Option<&Path>,
        offset: &Path,
    ) -> BoxStream<'static, Result<ObjectMeta>> {
        self.complete(prefix, Some(offset), self.inner.list_with_offset(prefix, offset))
    }

    async fn list_with_delimiter(&self, prefix: Option<&Path>) -> Result<ListResult> {
        self.inner.list_with_delimiter(prefix).await
    }

    async fn copy_opts(&self, from: &Path, to: &Path, options: CopyOptions) -> Result<()> {
        self.inner.copy_opts(from, to, options).await
    }

    async fn rename_opts(&self, from: &Path, to: &Path, options: RenameOptions) -> Result<()> {
        self.inner.rename_opts(from, to, options).await
    }
}

impl DurableFiles {
    /// A listing that fails where `object_store` leaves a file out whose `stat` fails: without the last commit, a table
    /// would be read as it was before.
    fn complete(
        &self,
        prefix: Option<&Path>,
        offset: Option<&Path>,
        listed: BoxStream<'static, Result<ObjectMeta>>,
    ) -> BoxStream<'static, Result<ObjectMeta>> {
        let prefix = prefix.cloned().unwrap_or_default();
        let (folder, offset) = (self.inner.path_to_filesystem(&prefix), offset.cloned());
        stream::once(async move {
            let listed: Vec<ObjectMeta> = listed.try_collect().await?;
            let is_wanted = |name: &str| {
                let location = prefix.clone().join(name);
                offset.as_ref().is_none_or(|offset| location > *offset)
                    && !listed.iter().any(|found| found.location == location)
            };
            left_out(&folder?, is_wanted)
                .map_err(|e| Error::Generic { store: "LocalFileSystem", source: Box::new(e) })?;
            Ok::<_, Error>(stream::iter(listed.into_iter().map(Ok)))
        })
        .try_flatten()
        .boxed()
    }
}

/// Looks at the files of a folder that a listing should hold: they are gone by now, or the listing is not whole.
fn left_out(folder: &FsPath, is_wanted: impl Fn(&str) -> bool) -> io::Result<()> {
    let entries = match std::fs::read_dir(folder) {
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(()),
        entries => entries?,
    };
    for entry in entries {
        let entry = entry?;
        let name = entry.file_name();
        // Staged files have a hash sign.
        let Some(name) = name.to_str().filter(|name| !name.contains('#') && is_wanted(name)) else {
            continue;
        };
        match std::fs::metadata(entry.path()) {
            Ok(found) if found.is_file() => {
                return Err(io::Error::other(format!("{name} was left out of the listing of its folder")));
            }
            Err(e) if e.kind() != io::ErrorKind::NotFound => return Err(e),
            _ => {}
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_existing_file_is_distinguished_from_one_with_the_same_content() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a");
        assert!(create(&path, b"one").unwrap());
        assert!(create(&path, b"one").unwrap(), "the same content counts as written");
        assert!(!create(&path, b"two").unwrap());
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
        let error = create(&folder.join("a"), b"one").unwrap_err();
        assert_ne!(error.kind(), io::ErrorKind::AlreadyExists);
    }
}
