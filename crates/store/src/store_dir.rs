//! Store directory: creation, opening and format version.

use std::path::Path;

use deltalake::logstore::object_store::PutMode;
use serde_json::Value;

use crate::delta::durable_fs;
use crate::delta::location::Location;
use crate::error::Error;
use crate::handle::Store;

/// Format version of the store; it is raised when an older release could no longer read or write the store.
///
/// 1: log records are *done* or *error*. 2: they may also be *known*, *not reached* or *unaccounted*.
/// 3: files of one table may differ in later columns.
/// Every earlier format is read, and is raised to the current one when the store is next written.
pub(crate) const FORMAT: u64 = 3;
const FIRST_FORMAT: u64 = 1;
pub(crate) const MARKER: &str = "store.json";

impl Store {
    /// Opens a store for reading.
    ///
    /// # Errors
    /// [`Error::Missing`] when there is no store, [`Error::Foreign`] when the folder holds other files,
    /// [`Error::Format`] when a newer release wrote it.
    pub fn open(dir: impl AsRef<Path>) -> Result<Self, Error> {
        let dir = dir.as_ref();
        let missing = || Error::Missing { dir: dir.to_owned() };
        if !object_io::is_address(dir) && !is_there(dir)? {
            return Err(missing());
        }
        let location = Location::at(check_name(dir)?)?;
        match first_entry(&location)? {
            None => return Err(missing()),
            Some(found) => drop(check_marker(&location, &found)?),
        }
        let store = Self::at(location);
        for table in store.tables() {
            if !table.exists()? {
                return Err(missing());
            }
        }
        Ok(store)
    }

    /// Opens a store; creates it if the folder is missing or empty.
    ///
    /// # Errors
    /// As [`Store::open`], except that a missing store is created; [`Error::Io`] when it cannot be.
    pub fn create_or_open(dir: impl AsRef<Path>) -> Result<Self, Error> {
        let dir = dir.as_ref();
        check_name(dir)?;
        if !object_io::is_address(dir) && !is_there(dir)? {
            durable_fs::create_folder(dir).map_err(Error::io(dir, "created"))?;
            // A bare name such as `results` has an empty parent, which is the current folder.
            let parent = dir.parent().map(|p| if p.as_os_str().is_empty() { Path::new(".") } else { p });
            parent
                .map_or(Ok(()), |parent| durable_fs::sync_dir(parent).map_err(Error::io(parent, "synced")))?;
        }
        let location = Location::at(dir)?;
        match first_entry(&location)? {
            None => write_marker(&location)?,
            Some(found) => drop(check_marker(&location, &found)?),
        }
        let store = Self::at(location);
        for table in store.tables() {
            if table.exists()? {
                table.renew()?;
            } else {
                table.create()?;
            }
        }
        if !store.location.is_bucket() {
            let dir = store.location.dir();
            durable_fs::sync_dir(dir).map_err(Error::io(dir, "synced"))?;
        }
        Ok(store)
    }
}

/// Rejects names with a percent sign and two hexadecimal digits: delta-rs decodes them twice.
fn check_name(dir: &Path) -> Result<&Path, Error> {
    let path = if object_io::is_address(dir) {
        // Parsed before any message prints the address, which may contain credentials.
        object_io::Address::parse(dir)?;
        dir.to_owned()
    } else {
        std::path::absolute(dir).map_err(Error::io(dir, "opened"))?
    };
    let path = path.to_string_lossy();
    let mut codes = path.match_indices('%').filter_map(|(at, _)| path.get(at..at + 3));
    match codes.find(|code| code.bytes().skip(1).all(|digit| digit.is_ascii_hexdigit())) {
        Some(found) => Err(Error::Name { found: found.to_owned(), dir: dir.to_owned() }),
        None => Ok(dir),
    }
}

/// An entry of the folder, the format marker first; `None` when the folder is empty.
fn first_entry(location: &Location) -> Result<Option<String>, Error> {
    if location.is_bucket() {
        return Ok(location.has(MARKER)?.then(|| MARKER.to_owned()));
    }
    let dir = location.dir();
    let entries = std::fs::read_dir(dir).map_err(Error::io(dir, "opened"))?;
    let entries = entries.collect::<Result<Vec<_>, _>>().map_err(Error::io(dir, "read"))?;
    let names = entries.into_iter().map(|entry| entry.file_name().to_string_lossy().into_owned());
    // `mkfs.ext4` puts `lost+found` into the root of every volume.
    let is_ours = |name: &String| !name.starts_with(&format!("{MARKER}#")) && name != "lost+found";
    let mut names: Vec<String> = names.filter(is_ours).collect();
    names.sort_by_key(|name| name != MARKER);
    Ok(names.into_iter().next())
}

pub(crate) fn write_marker(location: &Location) -> Result<(), Error> {
    let marker = serde_json::json!({ "freeplay_store": FORMAT }).to_string();
    location.put(&location.dir().join(MARKER), marker.as_bytes(), PutMode::Overwrite).map(drop)
}

fn is_there(dir: &Path) -> Result<bool, Error> {
    match std::fs::read_dir(dir) {
        Ok(_) => Ok(true),
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(false),
        Err(e) => Err(Error::io(dir, "opened")(e)),
    }
}

/// The format version, if the folder is a store of a known format. A store that lost its marker counts as one of the
/// first format, so that the next writer writes the marker again.
pub(crate) fn check_marker(location: &Location, found: &str) -> Result<u64, Error> {
    let file = location.display_path(&location.dir().join(MARKER));
    // A copied store may lack only the marker. In a bucket, opening the store for writing creates a missing marker.
    if !location.is_bucket() && !location.has(MARKER)? {
        let store = Store::at(location.clone());
        if store.tables().iter().try_fold(true, |all, table| Ok::<_, Error>(all && table.exists()?))? {
            return Ok(FIRST_FORMAT);
        }
    }
    if found != MARKER {
        return Err(Error::Foreign { dir: location.display_path(location.dir()), found: found.to_owned() });
    }
    let text = location.read(MARKER)?;
    let marker: Option<Value> = serde_json::from_str(&text).ok();
    match marker.and_then(|marker| marker["freeplay_store"].as_u64()) {
        Some(format @ 1..=FORMAT) => Ok(format),
        Some(other) => Err(Error::Format { file, found: other.to_string(), known: FORMAT }),
        None => Err(Error::Torn { file, found: text.trim().chars().take(40).collect() }),
    }
}
