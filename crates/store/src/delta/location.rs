//! Location of a store: a folder, or a prefix of a bucket, whose files are copied to a folder of this process.
//!
//! Files have local paths in both: for a bucket, the path of the copy once the file was [fetched](Location::fetch). Data
//! files never change under their names, so a copy is as good as the object; it is compared with its digest like any file.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, UNIX_EPOCH};

use deltalake::logstore::object_store::prefix::PrefixStore;
use deltalake::logstore::object_store::{self, ObjectStore, ObjectStoreExt, PutMode, PutOptions, PutPayload};
use deltalake::logstore::{LogStoreRef, StorageConfig, default_logstore};
use deltalake::{DeltaTableBuilder, DeltaTableError};
use object_io::{Address, Client, block_on};
use tokio::runtime::{Builder, Handle, Runtime};
use url::Url;

use crate::delta::durable_fs::{self, Entry};
use crate::delta::log_storage::LogStorage;
use crate::error::Error;

#[derive(Debug, Clone)]
pub(crate) struct Location {
    dir: PathBuf,
    bucket: Option<BucketLocation>,
    /// Handle of the runtime of Delta's asynchronous library; for a bucket, of the threads that serve its connections.
    handle: Handle,
    /// A folder's own runtime, so that a forked process that opens a store has one too.
    _runtime: Option<Arc<Runtime>>,
}

#[derive(Debug, Clone)]
struct BucketLocation {
    address: Address,
    client: Client,
    /// Deleted when the last location that uses it is dropped.
    _copies: Arc<tempfile::TempDir>,
}

impl Location {
    /// A folder that exists, or an address.
    pub(crate) fn at(path: &Path) -> Result<Self, Error> {
        let Some(address) = Address::parse(path)? else { return Self::folder(path) };
        let copies = tempfile::tempdir().map_err(Error::io(std::env::temp_dir(), "written"))?;
        let (dir, client) = (copies.path().to_owned(), address.client()?);
        let bucket = Some(BucketLocation { address, client, _copies: Arc::new(copies) });
        Ok(Self { dir, bucket, handle: object_io::handle()?, _runtime: None })
    }

    fn folder(path: &Path) -> Result<Self, Error> {
        let dir = std::fs::canonicalize(path).map_err(Error::io(path, "opened"))?;
        let own = Builder::new_multi_thread().worker_threads(1).thread_name("store").enable_all().build();
        let runtime = own.map_err(Error::io(&dir, "opened"))?;
        Ok(Self { dir, bucket: None, handle: runtime.handle().clone(), _runtime: Some(Arc::new(runtime)) })
    }

    pub(crate) fn join(&self, name: &str) -> Self {
        let deeper = |bucket: &BucketLocation| BucketLocation {
            address: bucket.address.with_key(&joined(bucket.address.key(), name)),
            ..bucket.clone()
        };
        Self { dir: self.dir.join(name), bucket: self.bucket.as_ref().map(deeper), ..self.clone() }
    }

    /// The folder, or where copies lie.
    pub(crate) fn dir(&self) -> &Path {
        &self.dir
    }

    pub(crate) fn is_bucket(&self) -> bool {
        self.bucket.is_some()
    }

    /// A file's name for people and for other programs.
    pub(crate) fn display_path(&self, path: &Path) -> PathBuf {
        match &self.bucket {
            Some(bucket) => bucket.address.with_key(&self.key(bucket, path)).to_string().into(),
            None => path.to_owned(),
        }
    }

    pub(crate) fn block_on<F: Future>(&self, work: F) -> F::Output {
        self.handle.block_on(work)
    }

    /// Delta's view of this folder.
    pub(crate) fn log_store(&self) -> Result<LogStoreRef, DeltaTableError> {
        let invalid = || DeltaTableError::InvalidTableLocation(self.dir.display().to_string());
        let Some(bucket) = &self.bucket else {
            let url = Url::from_directory_path(&self.dir).map_err(|()| invalid())?;
            let builder = DeltaTableBuilder::from_url(url.clone())?;
            return builder.with_storage_backend(Arc::new(LogStorage::folder()), url).build_storage();
        };
        let url = Url::parse(&bucket.address.to_string()).map_err(|_| invalid())?;
        let below = PrefixStore::new(Arc::clone(&bucket.client), bucket.address.key());
        Ok(default_logstore(
            Arc::new(LogStorage::bucket(below)),
            Arc::clone(&bucket.client),
            &url,
            &StorageConfig::default(),
        ))
    }

    pub(crate) fn has(&self, name: &str) -> Result<bool, Error> {
        Ok(self.length(&self.dir.join(name))?.is_some())
    }

    pub(crate) fn length(&self, path: &Path) -> Result<Option<u64>, Error> {
        let Some(bucket) = &self.bucket else {
            return match std::fs::metadata(path) {
                Ok(data) => Ok(Some(data.len())),
                Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(None),
                Err(e) => Err(Error::io(path, "read")(e)),
            };
        };
        match bucket.request(&self.key(bucket, path), async |client, location| client.head(location).await) {
            Ok(meta) => Ok(Some(meta.size)),
            Err(object_io::Error::Missing { .. }) => Ok(None),
            Err(error) => Err(error.into()),
        }
    }

    pub(crate) fn read(&self, name: &str) -> Result<String, Error> {
        let path = self.dir.join(name);
        self.fetch(&path)?;
        std::fs::read_to_string(&path).map_err(Error::io(path, "read"))
    }

    /// Makes a file available under its local path: a file in a bucket is copied there.
    pub(crate) fn fetch(&self, path: &Path) -> Result<(), Error> {
        let Some(bucket) = &self.bucket else { return Ok(()) };
        let content = bucket.request(&self.key(bucket, path), async |client, location| {
            client.get(location).await?.bytes().await
        })?;
        let folder = path.parent().unwrap_or(&self.dir);
        let written = std::fs::create_dir_all(folder).and_then(|()| std::fs::write(path, content));
        written.map_err(Error::io(path, "copied"))
    }

    /// Writes a file whose name contains the digest of its content.
    ///
    /// A file of that name with other content is damaged and is replaced: no commit names it.
    pub(crate) fn create(&self, path: &Path, content: &[u8]) -> Result<(), Error> {
        if !self.put(path, content, PutMode::Create)? {
            self.put(path, content, PutMode::Overwrite)?;
        }
        Ok(())
    }

    /// Writes a whole file; `false` when it is to be created, and another file has that name.
    pub(crate) fn put(&self, path: &Path, content: &[u8], mode: PutMode) -> Result<bool, Error> {
        let Some(bucket) = &self.bucket else {
            let written = match mode {
                PutMode::Create => durable_fs::create(path, &[content]),
                _ => durable_fs::replace(path, &[content]).map(|()| true),
            };
            return written.map_err(Error::io(path, "written"));
        };
        let payload = PutPayload::from(content.to_vec());
        let options = PutOptions { mode, ..PutOptions::default() };
        let put = bucket.request(&self.key(bucket, path), async |client, location| {
            client.put_opts(location, payload, options).await
        });
        match put {
            Err(object_io::Error::Exists { .. }) => Ok(false),
            put => Ok(put.map(|_| true)?),
        }
    }

    pub(crate) fn delete(&self, path: &Path) -> Result<(), Error> {
        match &self.bucket {
            Some(bucket) => Ok(bucket
                .request(&self.key(bucket, path), async |client, location| client.delete(location).await)?),
            None => std::fs::remove_file(path).map_err(Error::io(path, "deleted")),
        }
    }

    /// The files of this folder itself, in the order of names.
    pub(crate) fn entries(&self) -> Result<Vec<Entry>, Error> {
        let Some(bucket) = &self.bucket else {
            return durable_fs::entries(&self.dir).map_err(Error::io(&self.dir, "read"));
        };
        let (prefix, mut found) = (joined(bucket.address.key(), ""), Vec::new());
        object_io::list(&bucket.address, usize::MAX, |entry| {
            let name = Address::parse_required(&entry.path).ok();
            let name = name.as_ref().and_then(|address| address.key().strip_prefix(&prefix));
            let written =
                UNIX_EPOCH + Duration::from_nanos(u64::try_from(entry.modified_utc_ns).unwrap_or_default());
            let entry = |name| Entry { path: self.dir.join(name), bytes: entry.size_bytes, written };
            found.extend(name.filter(|name| !name.contains('/')).map(entry));
        })?;
        Ok(found)
    }

    fn key(&self, bucket: &BucketLocation, path: &Path) -> String {
        let below = path.strip_prefix(&self.dir).unwrap_or(path).to_string_lossy().replace('\\', "/");
        if below.is_empty() { bucket.address.key().to_owned() } else { joined(bucket.address.key(), &below) }
    }
}

impl BucketLocation {
    fn request<T>(
        &self,
        key: &str,
        question: impl AsyncFnOnce(&Client, &object_store::path::Path) -> object_store::Result<T>,
    ) -> Result<T, object_io::Error> {
        block_on(self.address.with_key(key).request(question))?
    }
}

fn joined(folder: &str, name: &str) -> String {
    if folder.is_empty() { name.to_owned() } else { format!("{folder}/{name}") }
}
