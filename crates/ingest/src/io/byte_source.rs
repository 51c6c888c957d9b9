//! Where the bytes of a file come from: this machine, or an object store.
//!
//! An object is mirrored in a temporary file, into which the requested ranges are copied: both are
//! read the same way, once their bytes are [wanted](ByteSource::want).

use std::fs::File;
use std::io;
use std::iter::once;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use object_io::{Address, ObjectFile};

use crate::error::Fault;
use crate::io::retry;

#[derive(Debug)]
pub(crate) struct ByteSource {
    /// The local file, or the mirror of the object.
    pub(crate) file: Arc<File>,
    object: Option<ObjectFile>,
}

impl ByteSource {
    pub(crate) fn open(path: &Path) -> Result<Self, Fault> {
        let address = Address::parse(path)?;
        let object = address.map(|address| ObjectFile::open(&address)).transpose()?;
        let file = match &object {
            Some(object) => retry::with_retry(|| object.file().try_clone())?,
            None => open_local(path)?,
        };
        Ok(Self { file: Arc::new(file), object })
    }

    /// Fetches these bytes: a local file has them all.
    pub(crate) fn want(&self, ranges: impl IntoIterator<Item = Range<u64>>) -> Result<(), Fault> {
        Ok(self.object.as_ref().map_or(Ok(()), |object| object.ensure_range(ranges))?)
    }
}

/// A whole file: for tables, all of which is read.
pub(crate) fn whole(path: &Path) -> Result<Arc<File>, Fault> {
    let source = ByteSource::open(path)?;
    source.want(once(0..u64::MAX))?;
    Ok(source.file)
}

/// Opens a regular file; opening a named pipe would wait for its writer for ever.
fn open_local(path: &Path) -> Result<File, Fault> {
    Ok(retry::with_retry(|| match std::fs::metadata(path)?.file_type() {
        kind if kind.is_file() => File::open(path),
        kind if kind.is_dir() => Err(io::ErrorKind::IsADirectory.into()),
        _ => Err(io::Error::new(io::ErrorKind::InvalidInput, "it is a pipe, a socket or a device")),
    })?)
}
