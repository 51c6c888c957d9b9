//! The folder: what lies in it, how it is made, and how it is known to be ours.

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use fleet::GapRecord;
use serde::{Deserialize, Serialize};
use tokio::runtime::{Builder, Runtime};

use crate::account::{LogAccount, RunAccount};
use crate::error::Error;
use crate::lock::{Holder, Lock};
use crate::numbered;
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
    dir: PathBuf,
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
        match first_entry(dir)? {
            None => return Err(missing()),
            Some(found) => drop(check_mark(dir, &found)?),
        }
        let store = Self::at(dir)?;
        let whole = store.tables().iter().all(|table| table.exists());
        if whole { Ok(store) } else { Err(missing()) }
    }

    /// Opens a store, and makes it where the folder is missing or empty.
    ///
    /// # Errors
    /// As [`Store::open`], except that a missing store is made; [`Error::Io`] when it cannot be.
    pub fn create_or_open(dir: impl AsRef<Path>) -> Result<Self, Error> {
        let dir = dir.as_ref();
        match first_entry(dir)? {
            None => make_mark(dir)?,
            Some(found) => drop(check_mark(dir, &found)?),
        }
        let store = Self::at(dir)?;
        for table in store.tables() {
            if table.exists() {
                table.renew()?;
            } else {
                table.create()?;
            }
        }
        durable::sync_dir(&store.dir).map_err(Error::io(&store.dir, "synced"))?;
        Ok(store)
    }

    /// Takes the store for writing, and waits for another writer as long as is allowed.
    ///
    /// # Errors
    /// [`Error::Held`] names who holds it; [`Error::Io`] when the folder cannot be written.
    pub fn lock(&self, holder: &Holder, wait: Option<Duration>) -> Result<Writer, Error> {
        let lock = Lock::take(&self.lock_file(), holder, wait)?;
        if check_mark(&self.dir, MARK)? < FORMAT {
            write_mark(&self.dir)?;
        }
        Ok(Writer::new(self.clone(), lock))
    }

    pub(crate) fn lock_file(&self) -> PathBuf {
        self.dir.join(LOCK)
    }

    /// The folder.
    pub fn dir(&self) -> &Path {
        &self.dir
    }

    fn at(dir: &Path) -> Result<Self, Error> {
        let dir = std::fs::canonicalize(dir).map_err(Error::io(dir, "opened"))?;
        let runtime = Arc::new(runtime().map_err(Error::io(&dir, "opened"))?);
        let table = |name, schema| Table::new(&dir, name, schema, Arc::clone(&runtime));
        let gaps = table("gaps", tabled::schema::<GapRecord>());
        let logs = table("logs", numbered::schema::<LogAccount>());
        let runs = table("runs", numbered::schema::<RunAccount>());
        Ok(Self { gaps, logs, runs, sound: Arc::default(), dir })
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
        let mut sound = self.sound.lock().unwrap_or_else(PoisonError::into_inner);
        for file in files {
            if !sound.contains(file) {
                datafile::check(file)?;
                sound.insert(file.clone());
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

/// Delta's library is asynchronous; one worker beside the caller's thread serves it.
fn runtime() -> std::io::Result<Runtime> {
    Builder::new_multi_thread().worker_threads(1).thread_name("store").enable_all().build()
}

/// Something that lies in the folder, our mark before anything else; nothing when it is missing or empty.
fn first_entry(dir: &Path) -> Result<Option<String>, Error> {
    let path = std::path::absolute(dir).map_err(Error::io(dir, "opened"))?;
    if let Some(found) = percent_code(&path.to_string_lossy()) {
        return Err(Error::Name { found: found.to_owned(), dir: dir.to_owned() });
    }
    let entries = match std::fs::read_dir(dir) {
        Ok(entries) => entries,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        Err(e) => return Err(Error::io(dir, "opened")(e)),
    };
    let names = entries.flatten().map(|entry| entry.file_name().to_string_lossy().into_owned());
    let mut names: Vec<String> = names.filter(|name| !name.starts_with(&format!("{MARK}#"))).collect();
    names.sort_by_key(|name| name != MARK);
    Ok(names.into_iter().next())
}

fn write_mark(dir: &Path) -> Result<(), Error> {
    let mark = serde_json::json!(Mark { freeplay_store: FORMAT }).to_string();
    let path = dir.join(MARK);
    durable::replace(&path, mark.as_bytes()).map_err(Error::io(path, "written"))
}

fn make_mark(dir: &Path) -> Result<(), Error> {
    write_mark(dir)?;
    // A bare name such as `results` has an empty parent, which is the current folder.
    let parent = dir.parent().map(|p| if p.as_os_str().is_empty() { Path::new(".") } else { p });
    parent.map_or(Ok(()), |parent| durable::sync_dir(parent).map_err(Error::io(parent, "synced")))
}

/// The format of the folder, when it is ours and known.
fn check_mark(dir: &Path, found: &str) -> Result<u32, Error> {
    let file = dir.join(MARK);
    if found != MARK {
        return Err(Error::Foreign { dir: dir.to_owned(), found: found.to_owned() });
    }
    let text = std::fs::read_to_string(&file).map_err(Error::io(&file, "read"))?;
    match serde_json::from_str::<Mark>(&text) {
        Ok(Mark { freeplay_store: format @ 1..=FORMAT }) => Ok(format),
        Ok(mark) => Err(Error::Format { file, found: mark.freeplay_store.to_string(), known: FORMAT }),
        Err(_) => Err(Error::Torn { file, found: text.trim().chars().take(40).collect() }),
    }
}
