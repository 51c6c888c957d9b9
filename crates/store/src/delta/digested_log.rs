//! Object store that writes the digest of each log file.
//!
//! Delta Lake stores no checksum of its log. A changed byte can turn `{"add":` into an action that every reader skips,
//! or narrow the bounds by which files are skipped: rows then disappear without an error. So each log file
//! `_delta_log/NAME` has an empty file `_digests/NAME.DIGEST` next to the log, where `DIGEST` is the blake3 of its
//! content. Other engines ignore folders whose names begin with an underscore.
//!
//! The digest is written before the log file, so a log file never lacks it. Two writers that race for one version leave
//! two digests, of which one matches. Commits of earlier releases and of other programs have none.

use std::fmt;
use std::path::Path as FsPath;

use async_trait::async_trait;
use deltalake::logstore::object_store::path::Path;
use deltalake::logstore::object_store::{
    CopyOptions, GetOptions, GetResult, ListResult, MultipartUpload, ObjectMeta, ObjectStore, ObjectStoreExt,
    PutMultipartOptions, PutOptions, PutPayload, PutResult, RenameOptions, Result,
};
use futures::stream::BoxStream;

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

/// Object store that writes the digest of each log file before the file.
#[derive(Debug)]
pub(crate) struct DigestedLog<S> {
    inner: S,
}

impl<S> DigestedLog<S> {
    pub(crate) fn new(inner: S) -> Self {
        Self { inner }
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

impl<S: fmt::Display> fmt::Display for DigestedLog<S> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "digested {}", self.inner)
    }
}

#[async_trait]
impl<S: ObjectStore> ObjectStore for DigestedLog<S> {
    async fn put_opts(&self, location: &Path, payload: PutPayload, options: PutOptions) -> Result<PutResult> {
        if let Some(digest) = digest_location(location, &payload) {
            self.inner.put(&digest, PutPayload::new()).await?;
        }
        self.inner.put_opts(location, payload, options).await
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
        self.inner.list(prefix)
    }

    fn list_with_offset(
        &self,
        prefix: Option<&Path>,
        offset: &Path,
    ) -> BoxStream<'static, Result<ObjectMeta>> {
        self.inner.list_with_offset(prefix, offset)
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
