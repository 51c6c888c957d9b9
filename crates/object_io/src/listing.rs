//! Object listing, page by page, and metadata of one object.

use std::path::PathBuf;

use futures::StreamExt;
use object_store::{ObjectMeta, ObjectStore, ObjectStoreExt};

use crate::address::Address;
use crate::client::block_on;
use crate::error::Error;

/// Entry of a listing: address, size, modification time and entity tag of an object.
#[derive(Debug, Clone, PartialEq, Eq)]
#[expect(missing_docs, reason = "each field is named for what it holds")]
pub struct ListEntry {
    pub path: PathBuf,
    pub size_bytes: u64,
    pub modified_utc_ns: i64,
    /// Entity tag (ETag) of the content; empty if the store has none.
    pub e_tag: String,
}

impl ListEntry {
    fn of(folder: &Address, meta: ObjectMeta) -> Self {
        Self {
            path: folder.with_key(meta.location.as_ref()).to_string().into(),
            size_bytes: meta.size,
            modified_utc_ns: meta.last_modified.timestamp_nanos_opt().unwrap_or(0),
            e_tag: meta.e_tag.unwrap_or_default(),
        }
    }
}

/// Passes the first `most` objects below a folder to `take`, by name; one page (1000 objects) is held in memory at a time.
///
/// # Errors
/// The error of the failed request; entries passed before it are valid.
pub fn list(folder: &Address, most: usize, mut take: impl FnMut(ListEntry)) -> Result<(), Error> {
    block_on(folder.request(async |client, location| {
        let mut found = client.list(Some(location)).take(most);
        while let Some(meta) = found.next().await {
            take(ListEntry::of(folder, meta?));
        }
        Ok(())
    }))?
}

/// Metadata of one object.
///
/// # Errors
/// [`Error::Missing`] when the object does not exist, else the error of the request.
pub fn head(address: &Address) -> Result<ListEntry, Error> {
    let meta = block_on(address.request(async |client, location| client.head(location).await))??;
    Ok(ListEntry::of(address, meta))
}
