//! The storage that delta-rs writes a table's log to: the digest of each log file is written before the file, and local
//! writes are durable.
//!
//! Delta Lake stores no checksum of its log. A changed byte can turn `{"add":` into an action that every reader skips,
//! or narrow the bounds by which files are skipped: rows then disappear without an error. So each log file
//! `_delta_log/NAME` has an empty file `_digests/NAME.DIGEST` next to the log, where `DIGEST` is the blake3 of its
//! content. Other engines ignore folders whose names begin with an underscore.
//!
//! The digest is written before the log file, so a log file never lacks it. Two writers that race for one version leave
//! two digests, of which one matches. Commits of earlier releases and of other programs have none.
//!
//! `object_store` 0.13 does not sync: a power cut could leave the name of a commit on an empty file. `durable_fs` syncs.

use std::ffi::OsStr;
use std::fmt;
use std::io;
use std::path::Path as FsPath;
use std::sync::Arc;

use async_trait::async_trait;
use deltalake::logstore::object_store::local::LocalFileSystem;
use deltalake::logstore::object_store::path::Path;
use deltalake::logstore::object_store::{
    CopyOptions, Error, GetOptions, GetResult, ListResult, MultipartUpload, ObjectMeta, ObjectStore, PutMode,
    PutMultipartOptions, PutOptions, PutPayload, PutResult, Result,
};
use futures::StreamExt;
use futures::stream::{self, BoxStream};

use crate::delta::durable_fs::{self, Entry};

pub(crate) const LOG: &str = "_delta_log";
pub(crate) const DIGESTS: &str = "_digests";
const VERSION_DIGITS: usize = 20;
/// The name of a commit or checkpoint; `None` for another file of the log.
pub(crate) fn log_file(path: &FsPath) -> Option<&str> {
    let name = path.file_name()?.to_str()?;
    let is_log = path.extension().is_some_and(|kind| kind == "json" || kind == "parquet");
    (is_log && version(name).is_some()).then_some(name)
}

pub(crate) fn version(name: &str) -> Option<u64> {
    let (digits, rest) = name.split_at_checked(VERSION_DIGITS)?;
    rest.starts_with('.').then(|| digits.parse().ok()).flatten()
}

/// A folder or a prefix of a bucket.
#[derive(Debug)]
pub(crate) struct LogStorage {
    inner: Arc<dyn ObjectStore>,
    /// The same, where it is a folder.
    local: Option<LocalFileSystem>,
}

impl LogStorage {
    pub(crate) fn folder() -> Self {
        let local = LocalFileSystem::default();
        Self { inner: Arc::new(local.clone()), local: Some(local) }
    }

    pub(crate) fn bucket(inner: impl ObjectStore) -> Self {
        Self { inner: Arc::new(inner), local: None }
    }

    async fn write(&self, location: &Path, payload: PutPayload, options: PutOptions) -> Result<PutResult> {
        let Some(local) = &self.local else { return self.inner.put_opts(location, payload, options).await };
        let path = local.path_to_filesystem(location)?;
        let parts: Vec<&[u8]> = payload.iter().map(AsRef::as_ref).collect();
        match options.mode {
            PutMode::Create if durable_fs::create(&path, &parts).map_err(failed)? => {}
            PutMode::Create => {
                let source = io::Error::from(io::ErrorKind::AlreadyExists).into();
                return Err(Error::AlreadyExists { path: location.to_string(), source });
            }
            PutMode::Overwrite => durable_fs::replace(&path, &parts).map_err(failed)?,
            PutMode::Update(_) => return self.inner.put_opts(location, payload, options).await,
        }
        Ok(PutResult { e_tag: None, version: None })
    }
}

/// The files of a folder, after `offset` where there is one. `LocalFileSystem` would leave out those whose `stat` fails:
/// without the last commit, a table would be read as it was before.
fn list_folder(
    files: &LocalFileSystem,
    prefix: Option<&Path>,
    offset: Option<&Path>,
) -> BoxStream<'static, Result<ObjectMeta>> {
    let prefix = prefix.cloned().unwrap_or_default();
    let meta = |entry: Entry| {
        // A number after a hash sign ends the name of a staged file.
        let name = entry.path.file_name().and_then(OsStr::to_str).filter(|name| !name.contains('#'))?;
        let (location, last_modified) = (prefix.clone().join(name), entry.written.into());
        Some(ObjectMeta { location, last_modified, size: entry.bytes, e_tag: None, version: None })
    };
    let listed = || -> Result<Vec<ObjectMeta>> {
        match durable_fs::entries(&files.path_to_filesystem(&prefix)?) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(Vec::new()),
            found => Ok(found.map_err(failed)?.into_iter().filter_map(meta).collect()),
        }
    };
    let is_after = |found: &ObjectMeta| offset.is_none_or(|offset| found.location > *offset);
    match listed() {
        Ok(listed) => stream::iter(listed.into_iter().filter(is_after).map(Ok).collect::<Vec<_>>()).boxed(),
        Err(error) => stream::iter([Err(error)]).boxed(),
    }
}

/// The digest file of a log file; `None` for other files.
fn digest_location(location: &Path, payload: &PutPayload) -> Option<Path> {
    let (folder, name) = location.as_ref().rsplit_once('/')?;
    let table = folder.strip_suffix(LOG)?;
    log_file(FsPath::new(name))?;
    let mut hasher = blake3::Hasher::new();
    for part in payload {
        hasher.update(part);
    }
    Path::parse(format!("{table}{DIGESTS}/{name}.{}", hasher.finalize().to_hex())).ok()
}

fn failed(source: io::Error) -> Error {
    Error::Generic { store: "durable", source: Box::new(source) }
}

impl fmt::Display for LogStorage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "digested {}", self.inner)
    }
}

#[async_trait]
impl ObjectStore for LogStorage {
    async fn put_opts(&self, location: &Path, payload: PutPayload, options: PutOptions) -> Result<PutResult> {
        if let Some(digest) = digest_location(location, &payload) {
            self.write(&digest, PutPayload::new(), PutOptions::default()).await?;
        }
        self.write(location, payload, options).await
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
        match &self.local {
            Some(files) => list_folder(files, prefix, None),
            None => self.inner.list(prefix),
        }
    }

    fn list_with_offset(
        &self,
        prefix: Option<&Path>,
        offset: &Path,
    ) -> BoxStream<'static, Result<ObjectMeta>> {
        match &self.local {
            Some(files) => list_folder(files, prefix, Some(offset)),
            None => self.inner.list_with_offset(prefix, offset),
        }
    }

    async fn list_with_delimiter(&self, prefix: Option<&Path>) -> Result<ListResult> {
        self.inner.list_with_delimiter(prefix).await
    }

    async fn copy_opts(&self, from: &Path, to: &Path, options: CopyOptions) -> Result<()> {
        self.inner.copy_opts(from, to, options).await
    }
}

#[cfg(test)]
mod tests {
    use futures::TryStreamExt;

    use super::*;

    #[tokio::test]
    async fn a_folder_is_listed_after_an_offset_without_staged_files_and_folders() {
        let dir = tempfile::tempdir().unwrap();
        for name in ["00002.json", "00000.json", "00001.json", "00003.json#7"] {
            std::fs::write(dir.path().join(name), name).unwrap();
        }
        std::fs::create_dir(dir.path().join("sidecars")).unwrap();
        let prefix = Path::from_filesystem_path(dir.path()).unwrap();
        let (files, offset) = (LogStorage::folder(), prefix.clone().join("00000.json"));
        let listed: Vec<ObjectMeta> = files.list(Some(&prefix)).try_collect().await.unwrap();
        let after: Vec<ObjectMeta> =
            files.list_with_offset(Some(&prefix), &offset).try_collect().await.unwrap();
        let names: Vec<_> = listed.iter().map(|file| file.location.filename().unwrap()).collect();
        assert_eq!(names, ["00000.json", "00001.json", "00002.json"]);
        assert_eq!(after, listed[1..]);
        let gone = files.list(Some(&prefix.join("gone"))).try_collect::<Vec<_>>().await;
        assert_eq!(gone.unwrap(), []);
        let file = LogStorage::folder().list(Some(&offset)).try_collect::<Vec<_>>().await;
        assert!(file.is_err(), "a folder that cannot be listed");
    }

    /// A loop of links has a `stat` that fails for another reason than that the file is gone.
    #[cfg(unix)]
    #[tokio::test]
    async fn a_listing_without_a_file_that_cannot_be_reached_fails() {
        let dir = tempfile::tempdir().unwrap();
        let looped = dir.path().join("00001.json");
        std::os::unix::fs::symlink(&looped, &looped).unwrap();
        let prefix = Path::from_filesystem_path(dir.path()).unwrap();
        let listed = LogStorage::folder().list(Some(&prefix)).try_collect::<Vec<_>>().await;
        let error = listed.unwrap_err().to_string();
        assert!(error.contains("os error") && error.contains("00001.json"), "{error}");
    }
}
