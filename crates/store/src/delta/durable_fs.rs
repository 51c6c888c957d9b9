//! What is written stays written: content reaches the disk before its name does, and the name before we return.
//!
//! `object_store` 0.13 never syncs, so a power cut can leave a commit's name on an empty file. This
//! wraps its local store for every write Delta makes (commits, checkpoints), and is used as it is
//! for data files.

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
use futures::stream::BoxStream;

/// Writes a whole file under a new name, or fails when the name is taken.
pub(crate) fn create(path: &FsPath, content: &[u8]) -> io::Result<()> {
    write(path, [content].into_iter(), WriteMode::New)
}

/// Writes a whole file, in place of one of the same name.
pub(crate) fn replace(path: &FsPath, content: &[u8]) -> io::Result<()> {
    write(path, [content].into_iter(), WriteMode::Replace)
}

/// Makes a folder's entries last.
pub(crate) fn sync_dir(dir: &FsPath) -> io::Result<()> {
    if cfg!(unix) { File::open(dir)?.sync_all() } else { Ok(()) }
}

#[derive(Clone, Copy)]
enum WriteMode {
    New,
    Replace,
}

fn write<'a>(path: &FsPath, parts: impl Iterator<Item = &'a [u8]>, naming: WriteMode) -> io::Result<()> {
    let dir = path.parent().unwrap_or(FsPath::new("."));
    std::fs::create_dir_all(dir)?;
    let staged = staged(path);
    let written = stage(&staged, parts).and_then(|()| match naming {
        WriteMode::New => std::fs::hard_link(&staged, path).and_then(|()| std::fs::remove_file(&staged)),
        WriteMode::Replace => std::fs::rename(&staged, path),
    });
    if written.is_err() {
        // Best effort: the error that is reported is the one that happened first.
        let _ = std::fs::remove_file(&staged);
    }
    written.and_then(|()| sync_dir(dir))
}

fn stage<'a>(staged: &FsPath, parts: impl Iterator<Item = &'a [u8]>) -> io::Result<()> {
    let mut file = File::create(staged)?;
    for part in parts {
        file.write_all(part)?;
    }
    file.sync_all()
}

/// A name that the local object store does not list: a number after a hash sign.
fn staged(path: &FsPath) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(format!("#{}", std::process::id()));
    PathBuf::from(name)
}

/// The local file system, with writes that last.
#[derive(Debug, Default)]
pub(crate) struct DurableFiles {
    inner: LocalFileSystem,
}

impl fmt::Display for DurableFiles {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "durable {}", self.inner)
    }
}

fn failed(path: &Path, source: io::Error) -> Error {
    let (path, source) = (path.to_string(), Box::new(source));
    match source.kind() {
        io::ErrorKind::AlreadyExists => Error::AlreadyExists { path, source },
        _ => Error::Generic { store: "durable", source },
    }
}

#[async_trait]
impl ObjectStore for DurableFiles {
    async fn put_opts(&self, location: &Path, payload: PutPayload, options: PutOptions) -> Result<PutResult> {
        let naming = match options.mode {
            PutMode::Create => WriteMode::New,
            PutMode::Overwrite => WriteMode::Replace,
            PutMode::Update(_) => return self.inner.put_opts(location, payload, options).await,
        };
        let path = self.inner.path_to_filesystem(location)?;
        write(&path, payload.iter().map(AsRef::as_ref), naming).map_err(|e| failed(location, e))?;
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
