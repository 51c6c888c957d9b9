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
    CopyOptions, Error, GetOptions, GetResult, ListResult, MultipartUpload, ObjectMeta, ObjectStore,
    ObjectStoreExt, PutMode, PutMultipartOptions, PutOptions, PutPayload, PutResult, RenameOptions, Result,
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
    let mut file = object_io::create_fresh(staged)?;
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
    /// Adds the files of the folder that `object_store` leaves out because their `stat` fails, or fails: without the last
    /// commit, a table would be read as it was before.
    fn complete(
        &self,
        prefix: Option<&Path>,
        offset: Option<&Path>,
        listed: BoxStream<'static, Result<ObjectMeta>>,
    ) -> BoxStream<'static, Result<ObjectMeta>> {
        let (files, prefix) = (self.inner.clone(), prefix.cloned().unwrap_or_default());
        let offset = offset.cloned();
        stream::once(async move {
            let mut listed: Vec<ObjectMeta> = listed.try_collect().await?;
            listed.sort_unstable_by(|a, b| a.location.cmp(&b.location));
            let is_listed =
                |location: &Path| listed.binary_search_by(|found| found.location.cmp(location)).is_ok();
            let mut left_out = names(&files.path_to_filesystem(&prefix)?).map_err(failed)?;
            left_out.retain(|name| {
                let location = prefix.clone().join(name.as_str());
                offset.as_ref().is_none_or(|offset| location > *offset) && !is_listed(&location)
            });
            for name in left_out {
                match files.head(&prefix.clone().join(name)).await {
                    Ok(found) => listed.push(found),
                    // A folder, or removed by now.
                    Err(Error::NotFound { .. }) => {}
                    Err(error) => return Err(error),
                }
            }
            Ok(stream::iter(listed.into_iter().map(Ok)))
        })
        .try_flatten()
        .boxed()
    }
}

/// Names in a folder, without those of staged files; none when the folder does not exist.
fn names(folder: &FsPath) -> io::Result<Vec<String>> {
    let entries = match std::fs::read_dir(folder) {
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries?,
    };
    let names: io::Result<Vec<_>> = entries.map(|entry| Ok(entry?.file_name())).collect();
    let names = names?.into_iter().filter_map(|name| name.into_string().ok());
    Ok(names.filter(|name| !name.contains('#')).collect())
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

    /// A listing without a file, as `object_store` gives it when the `stat` of the file fails.
    #[tokio::test]
    async fn a_file_that_a_listing_leaves_out_is_looked_for() {
        let dir = tempfile::tempdir().unwrap();
        let commits = ["00000.json", "00001.json", "00002.json"];
        for name in commits.iter().chain(&["00003.json#7"]) {
            std::fs::write(dir.path().join(name), name).unwrap();
        }
        std::fs::create_dir(dir.path().join("sidecars")).unwrap();
        let prefix = Path::from_filesystem_path(dir.path()).unwrap();
        let files = DurableFiles::default();
        let listed = async |offset: Option<&Path>, left_out: &str| {
            let inner = files.inner.list(Some(&prefix)).try_collect::<Vec<_>>().await.unwrap();
            let kept: Vec<_> = inner
                .into_iter()
                .filter(|found| found.location.filename() != Some(left_out))
                .map(Ok)
                .collect();
            let found = files.complete(Some(&prefix), offset, stream::iter(kept).boxed());
            let found: Vec<ObjectMeta> = found.try_collect().await.unwrap();
            let mut names: Vec<_> =
                found.iter().map(|file| (file.location.filename().unwrap().to_owned(), file.size)).collect();
            names.sort();
            names
        };
        let wanted = commits.map(|name| (name.to_owned(), 10));
        assert_eq!(listed(None, "").await, wanted);
        assert_eq!(listed(None, "00002.json").await, wanted);
        let offset = prefix.clone().join("00000.json");
        assert_eq!(listed(Some(&offset), "00000.json").await, wanted[1..]);
    }

    #[test]
    fn a_folder_that_is_gone_has_no_names_and_one_that_cannot_be_listed_is_an_error() {
        let dir = tempfile::tempdir().unwrap();
        assert_eq!(names(&dir.path().join("gone")).unwrap(), Vec::<String>::new());
        let file = dir.path().join("file");
        std::fs::write(&file, "").unwrap();
        assert_eq!(names(&file).unwrap_err().kind(), io::ErrorKind::NotADirectory);
    }

    /// A loop of links has a `stat` that fails for another reason than that the file is gone.
    #[cfg(unix)]
    #[tokio::test]
    async fn a_listing_without_a_file_that_cannot_be_reached_fails() {
        let dir = tempfile::tempdir().unwrap();
        let looped = dir.path().join("00001.json");
        std::os::unix::fs::symlink(&looped, &looped).unwrap();
        let prefix = Path::from_filesystem_path(dir.path()).unwrap();
        let files = DurableFiles::default();
        let listed = files.complete(Some(&prefix), None, stream::empty().boxed());
        let error = listed.try_collect::<Vec<_>>().await.unwrap_err().to_string();
        assert!(error.contains("os error") && error.contains("00001.json"), "{error}");
    }
}
