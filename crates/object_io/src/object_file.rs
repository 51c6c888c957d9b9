//! Sparse temporary file that mirrors the requested byte ranges of one object.
//!
//! The file is as long as the object and sparse where no range was requested, so it occupies as much disk as was
//! fetched. It has no name and is deleted when the process ends. Readers must request a range before reading it.

use std::fs::File;
use std::ops::Range;
use std::sync::{Mutex, PoisonError};

use bytes::Bytes;
use futures::{StreamExt, stream};
use object_store::{GetOptions, GetRange, ObjectMeta, ObjectStore, ObjectStoreExt};

use crate::address::Address;
use crate::byte_ranges::FetchedBlocks;
use crate::client::block_on;
use crate::error::Error;

/// Requests in flight at once, for one object.
const AT_ONCE: usize = 4;

/// An object and its fetched byte ranges.
#[derive(Debug)]
pub struct ObjectFile {
    address: Address,
    meta: ObjectMeta,
    file: File,
    had: Mutex<FetchedBlocks>,
}

impl ObjectFile {
    /// Opens the object; no content is fetched yet.
    ///
    /// # Errors
    /// [`Error::Missing`], [`Error::Denied`], [`Error::Unreachable`]; [`Error::Spool`] when the
    /// temporary file cannot be created.
    pub fn open(address: &Address) -> Result<Self, Error> {
        let meta = block_on(address.request(async |client, location| client.head(location).await))??;
        let file = tempfile::tempfile().map_err(|e| spool_error(address, e))?;
        file.set_len(meta.size).map_err(|e| spool_error(address, e))?;
        Ok(Self { address: address.clone(), meta, file, had: Mutex::default() })
    }

    /// The file: as long as the object, with content in the ranges that were [fetched](ObjectFile::ensure_range).
    pub fn file(&self) -> &File {
        &self.file
    }

    /// Fetches the ranges that are not in the file yet; ranges are clipped to the object's length.
    ///
    /// # Errors
    /// [`Error::Changed`] when the object is no longer the one that was opened, [`Error::Unreachable`] when no
    /// complete response came in time, [`Error::Spool`] when the disk is full.
    pub fn ensure_range(&self, ranges: impl IntoIterator<Item = Range<u64>>) -> Result<(), Error> {
        let clip = |range: Range<u64>| range.start.min(self.meta.size)..range.end.min(self.meta.size);
        let wanted: Vec<Range<u64>> =
            ranges.into_iter().map(clip).filter(|range| !range.is_empty()).collect();
        // The lock is held during the fetch, so that two actuators that need the same column fetch it once.
        let mut had = self.had.lock().unwrap_or_else(PoisonError::into_inner);
        let missing = had.missing(&wanted, self.meta.size);
        if missing.is_empty() {
            return Ok(());
        }
        block_on(async {
            let pieces = missing.into_iter().map(|range| async { (range.clone(), self.fetch(range).await) });
            let mut pieces = stream::iter(pieces).buffer_unordered(AT_ONCE);
            while let Some((range, bytes)) = pieces.next().await {
                write_at(&self.file, &bytes?, range.start).map_err(|e| spool_error(&self.address, e))?;
                had.add(&range);
            }
            Ok(())
        })?
    }

    async fn fetch(&self, range: Range<u64>) -> Result<Bytes, Error> {
        let options = GetOptions {
            if_match: self.meta.e_tag.clone(),
            range: Some(GetRange::Bounded(range.clone())),
            ..GetOptions::default()
        };
        let (given, bytes) = self
            .address
            .request(async |client, location| {
                let answer = client.get_opts(location, options).await?;
                Ok((answer.range.clone(), answer.bytes().await?))
            })
            .await?;
        if given == range {
            return Ok(bytes);
        }
        let detail = format!("bytes {range:?} were requested, bytes {given:?} received");
        Err(Error::Unreachable { address: self.address.to_string(), tried_s: 0.0, detail })
    }
}

fn spool_error(address: &Address, source: std::io::Error) -> Error {
    Error::Spool { address: address.to_string(), folder: std::env::temp_dir(), source }
}

#[cfg(unix)]
fn write_at(file: &File, bytes: &[u8], at: u64) -> std::io::Result<()> {
    std::os::unix::fs::FileExt::write_all_at(file, bytes, at)
}

#[cfg(windows)]
fn write_at(file: &File, mut bytes: &[u8], mut at: u64) -> std::io::Result<()> {
    while !bytes.is_empty() {
        let count = std::os::windows::fs::FileExt::seek_write(file, bytes, at)?;
        (bytes, at) = (&bytes[count..], at + count as u64);
    }
    Ok(())
}
