//! What lies below an address, handed over page by page.

use std::path::{Path, PathBuf};
use std::time::Instant;

use futures::StreamExt;
use object_store::{ObjectMeta, ObjectStore, ObjectStoreExt};

use crate::address::Address;
use crate::client::block_on;
use crate::error::Error;

/// An object as a listing tells of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Entry {
    /// Its address.
    pub path: PathBuf,
    /// Bytes.
    pub size_bytes: u64,
    /// Nanoseconds since 1970 UTC.
    pub modified_utc_ns: i64,
    /// The store's own mark of this content; empty where it has none.
    pub e_tag: String,
}

impl Entry {
    fn of(folder: &Address, meta: ObjectMeta) -> Self {
        Self {
            path: folder.with_key(meta.location.as_ref()).to_string().into(),
            size_bytes: meta.size,
            modified_utc_ns: meta.last_modified.timestamp_nanos_opt().unwrap_or(0),
            e_tag: meta.e_tag.unwrap_or_default(),
        }
    }
}

/// Hands over every object below a folder; a page of a thousand is held at a time.
///
/// # Errors
/// What a request fails with; objects handed over before are sound.
pub fn list(folder: &Address, mut take: impl FnMut(Entry)) -> Result<(), Error> {
    let (client, location, clock) = (folder.client()?, folder.location()?, Instant::now());
    block_on(async {
        let mut found = client.list(Some(&location));
        while let Some(meta) = found.next().await {
            let failed = |e| Error::of(folder, clock.elapsed().as_secs_f64(), &e);
            take(Entry::of(folder, meta.map_err(failed)?));
        }
        Ok(())
    })?
}

/// One object, without its content.
///
/// # Errors
/// [`Error::Missing`] when it is not there; what the request fails with.
pub fn look(path: &Path) -> Result<Entry, Error> {
    let address = Address::must(path)?;
    let (client, location, clock) = (address.client()?, address.location()?, Instant::now());
    let meta = block_on(client.head(&location))?;
    Ok(Entry::of(&address, meta.map_err(|e| Error::of(&address, clock.elapsed().as_secs_f64(), &e))?))
}
