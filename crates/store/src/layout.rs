//! The folder: what lies in it, how it is made, and how it is known to be ours.

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use records::GapRecord;
use serde::{Deserialize, Serialize};

use crate::account::{LogAccount, RunAccount};
use crate::error::Error;
use crate::lock::{Holder, Lock};
use crate::numbered;
use crate::place::Place;
use crate::table::Table;
use crate::writer::Writer;
use crate::{datafile, durable, tabled};

/// The format of the folder; it grows when an older release could no longer read or write it.
///
/// 1: accounts of logs are *done* or *error*. 2: they may be *known*, *not reached* or *unaccounted* too.
/// 3: files of one table may differ in columns that came later.
/// Every format so far is read, and grows when it is next written to.
const FORMAT: u32 = 3;
const MARK: &str = "store.json";
const LOCK: &str = "lock";

/// What `store.json` says.
#[derive(Serialize, Deserialize)]
struct Mark {
    freeplay_store: u32,
}

/// A store, open for reading.
#[derive(Debug, Clone)]
pub struct Store {
    pub(crate) place: Place,
    named: PathBuf,
    pub(crate) gaps: Table,
    pub(crate) logs: Table,
    pub(crate) runs: Table,
    /// Data files whose digests this process has compared.
    sound: Arc<Mutex<HashSet<PathBuf>>>,
}

impl Store {
    /// Opens a store for reading.
    ///
    /// # Errors
    /// [`Error::Missing`] when there is none, [`Error::Foreign`] when the folder holds something else,
    /// [`Error::Format`] when another release wrote it.
    pub fn open(dir: impl AsRef<Path>) -> Result<Self, Error> {
        let dir = dir.as_ref();
        let missing = || Error::Missing { dir: dir.to_owned() };
        if !object_io::is_address(dir) && !is_there(dir)? {
            return Err(missing());
        }
        let place = Place::at(check_name(dir)?)?;
        match first_entry(&place)? {
            None => return Err(missing()),
            Some(found) => drop(check_mark(&place, &found)?),
        }
        let store = Self::at(place);
        for table in store.tables() {
            if !table.exists()? {
                return Err(missing());
            }
        }
        Ok(store)
    }

    /// Opens a store, and makes it where the folder is missing or empty.
    ///
    /// # Errors
    /// As [`Store::open`], except that a missing store is made; [`Error::Io`] when it cannot be.
    pub fn create_or_open(dir: impl AsRef<Path>) -> Result<Self, Error> {
        let dir = dir.as_ref();
        check_name(dir)?;
        if !object_io::is_address(dir) {
            make_folder(dir)?;
        }
        let place = Place::at(dir)?;
        match first_entry(&place)? {
            None => write_mark(&place)?,
            Some(found) => drop(check_mark(&place, &found)?),
        }
        let store = Self::at(place);
        for table in store.tables() {
            if table.exists()? {
                table.renew()?;
            } else {
                table.create()?;
            }
        }
        store.place.sync()?;
        Ok(store)
    }

    /// Takes the store for writing, and waits for another writer as long as is allowed.
    ///
    /// A bucket has no lock: there every commit is refused that another one came before, and is planned anew.
    ///
    /// # Errors
    /// [`Error::Held`] names who holds it; [`Error::Io`] when the folder cannot be written.
    pub fn lock(&self, holder: &Holder, wait: Option<Duration>) -> Result<Writer, Error> {
        let lock = self.lock_file().map(|file| Lock::take(&file, holder, wait)).transpose()?;
        if check_mark(&self.place, MARK)? < FORMAT {
            write_mark(&self.place)?;
        }
        Ok(Writer::new(self.clone(), lock))
    }

    /// The lock's file; none in a bucket.
    pub(crate) fn lock_file(&self) -> Option<PathBuf> {
        (!self.place.is_bucket()).then(|| self.place.dir().join(LOCK))
    }

    /// The folder, or the address.
    pub fn dir(&self) -> &Path {
        &self.named
    }

    fn at(place: Place) -> Self {
        let table = |name, schema| Table::new(&place, name, schema);
        let gaps = table("gaps", tabled::schema::<GapRecord>());
        let logs = table("logs", numbered::schema::<LogAccount>());
        let runs = table("runs", numbered::schema::<RunAccount>());
        Self { gaps, logs, runs, sound: Arc::default(), named: place.named(place.dir()), place }
    }

    /// Every table.
    pub(crate) fn tables(&self) -> [&Table; 3] {
        [&self.gaps, &self.logs, &self.runs]
    }

    /// Compares data files with their digests, each once in the life of this store.
    ///
    /// Neither Delta nor Polars would notice a flipped byte: it came through as a wrong number.
    ///
    /// # Errors
    /// [`Error::Damaged`] for the first that differs.
    pub(crate) fn check(&self, files: &[PathBuf]) -> Result<(), Error> {
        let sound = || self.sound.lock().unwrap_or_else(PoisonError::into_inner);
        for file in files {
            // Not held meanwhile: those who read side by side compare side by side.
            let is_known = sound().contains(file);
            if !is_known {
                self.place.bring(file)?;
                datafile::check(file)?;
                sound().insert(file.clone());
            }
        }
        Ok(())
    }
}

/// A percent sign and two hexadecimal digits, which Delta's library decodes once too often.
fn percent_code(path: &str) -> Option<&str> {
    let codes = path.match_indices('%').filter_map(|(at, _)| path.get(at..at + 3));
    codes.into_iter().find(|code| code.bytes().skip(1).all(|digit| digit.is_ascii_hexdigit()))
}

/// Refuses names that Delta's library cannot take.
fn check_name(dir: &Path) -> Result<&Path, Error> {
    let path = if object_io::is_address(dir) {
        dir.to_owned()
    } else {
        std::path::absolute(dir).map_err(Error::io(dir, "opened"))?
    };
    match percent_code(&path.to_string_lossy()) {
        Some(found) => Err(Error::Name { found: found.to_owned(), dir: dir.to_owned() }),
        None => Ok(dir),
    }
}

/// Something that lies in the folder, our mark before anything else; nothing when it is empty.
fn first_entry(place: &Place) -> Result<Option<String>, Error> {
    if place.is_bucket() {
        return Ok(place.has(MARK)?.then(|| MARK.to_owned()));
    }
    let dir = place.dir();
    let entries = std::fs::read_dir(dir).map_err(Error::io(dir, "opened"))?;
    let names = entries.flatten().map(|entry| entry.file_name().to_string_lossy().into_owned());
    let mut names: Vec<String> = names.filter(|name| !name.starts_with(&format!("{MARK}#"))).collect();
    names.sort_by_key(|name| name != MARK);
    Ok(names.into_iter().next())
}

fn write_mark(place: &Place) -> Result<(), Error> {
    let mark = serde_json::json!(Mark { freeplay_store: FORMAT }).to_string();
    place.replace(MARK, mark.as_bytes())
}

/// Whether the folder is there; something else of its name is an error.
fn is_there(dir: &Path) -> Result<bool, Error> {
    match std::fs::read_dir(dir) {
        Ok(_) => Ok(true),
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(false),
        Err(e) => Err(Error::io(dir, "opened")(e)),
    }
}

/// Makes the folder where it is not there, and its name last.
fn make_folder(dir: &Path) -> Result<(), Error> {
    if is_there(dir)? {
        return Ok(());
    }
    std::fs::create_dir_all(dir).map_err(Error::io(dir, "created"))?;
    // A bare name such as `results` has an empty parent, which is the current folder.
    let parent = dir.parent().map(|p| if p.as_os_str().is_empty() { Path::new(".") } else { p });
    parent.map_or(Ok(()), |parent| durable::sync_dir(parent).map_err(Error::io(parent, "synced")))
}

/// The format of the folder, when it is ours and known.
fn check_mark(place: &Place, found: &str) -> Result<u32, Error> {
    let file = place.named(&place.dir().join(MARK));
    if found != MARK {
        return Err(Error::Foreign { dir: place.named(place.dir()), found: found.to_owned() });
    }
    let text = place.read(MARK)?;
    match serde_json::from_str::<Mark>(&text) {
        Ok(Mark { freeplay_store: format @ 1..=FORMAT }) => Ok(format),
        Ok(mark) => Err(Error::Format { file, found: mark.freeplay_store.to_string(), known: FORMAT }),
        Err(_) => Err(Error::Torn { file, found: text.trim().chars().take(40).collect() }),
    }
}
