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
//! `object_store` 0.13 does not sync, so a power cut can leave the name of a commit on an empty file.

use std::fmt;
use std::io;
use std::path::Path as FsPath;
use std::sync::Arc;

use async_trait::async_trait;
use deltalake::logstore::object_store::local::LocalFileSystem;
use deltalake::logstore::object_store::path::Path;
use deltalake::logstore::object_store::{
    CopyOptions, Error, GetOptions, GetResult, ListResult, MultipartUpload, ObjectMeta, ObjectStore,
    ObjectStoreExt, PutMode, PutMultipartOptions, PutOptions, PutPayload, PutResult, Result,
};
use futures::stream::{self, BoxStream};
use futures::{StreamExt, TryStreamExt};

use crate::delta::durable_fs;

/// Folder of the log.
pub(crate) const LOG: &str = "_delta_log";
/// Folder of the digests.
pub(crate) const DIGESTS: &str = "_digests";
/// Digits of the version at the beginning of a log file's name.
const VERSION_DIGITS: usize = 20;
/// The name of a commit or checkpoint; `None` for another file of the log.
pub(crate) fn log_file(path: &FsPath) -> Option<&str> {
    let name = path.file_name()?.to_str()?;
    let is_log = path.extension().is_some_and(|kind| kind == "json" || kind == "parquet");
    (is_log && version(name).is_some()).then_some(name)
}

/// The version that a log file belongs to.
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

    /// Adds the files of the folder that `object_store` leaves out because their `stat` fails, or fails: without the last
    /// commit, a table would be read as it was before.
    fn complete(
        &self,
        prefix: Option<&Path>,
        offset: Option<&Path>,
        listed: BoxStream<'static, Result<ObjectMeta>>,
    ) -> BoxStream<'static, Result<ObjectMeta>> {
        let Some(files) = self.local.clone() else { return listed };
        let prefix = prefix.cloned().unwrap_or_default();
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
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let files = LogStorage::folder();
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
        let files = LogStorage::folder();
        let listed = files.complete(Some(&prefix), None, stream::empty().boxed());
        let error = listed.try_collect::<Vec<_>>().await.unwrap_err().to_string();
        assert!(error.contains("os error") && error.contains("00001.json"), "{error}");
    }
}
