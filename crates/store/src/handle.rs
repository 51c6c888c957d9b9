//! Store handle: the location, the tables and the digest check of data files.

use std::collections::HashSet;
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use arrow::array::RecordBatch;
use arrow::error::ArrowError;
use records::{AlertRecord, GapRecord, LogRecord, RunRecord, UnitState, WorkEvent};

use crate::delta::data_file;
use crate::delta::location::Location;
use crate::delta::table::Table;
use crate::delta::versioned;
use crate::error::Error;

const LOCK: &str = "lock";

pub(crate) type Join = Arc<dyn Fn(&RecordBatch) -> Result<RecordBatch, ArrowError> + Send + Sync>;

/// Result store, open for reading.
#[derive(Clone)]
pub struct Store {
    pub(crate) location: Location,
    display_path: PathBuf,
    pub(crate) gaps: Table,
    pub(crate) logs: Table,
    pub(crate) runs: Table,
    // These exist from their first row on.
    pub(crate) alerts: Table,
    pub(crate) work: Table,
    pub(crate) states: Table,
    /// Bookkeeping that is joined to records when they are read.
    pub(crate) join: Option<Join>,
    /// Data files whose digests this process has verified.
    verified: Arc<Mutex<HashSet<PathBuf>>>,
}

impl fmt::Debug for Store {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Store").field(&self.display_path).finish()
    }
}

impl Store {
    pub(crate) fn at(location: Location) -> Self {
        let table = |name, schema| Table::new(&location, name, schema);
        Self {
            gaps: table("gaps", GapRecord::schema()),
            logs: table("logs", versioned::schema::<LogRecord>()),
            runs: table("runs", versioned::schema::<RunRecord>()),
            alerts: table("alerts", versioned::schema::<AlertRecord>()),
            work: table("work", versioned::schema::<WorkEvent>()),
            states: table("states", versioned::schema::<UnitState>()),
            join: None,
            verified: Arc::default(),
            display_path: location.display_path(location.dir()),
            location,
        }
    }

    /// The folder or the object address.
    pub fn dir(&self) -> &Path {
        &self.display_path
    }

    pub(crate) fn lock_file(&self) -> Option<PathBuf> {
        (!self.location.is_bucket()).then(|| self.location.dir().join(LOCK))
    }

    /// The tables of every store.
    pub(crate) fn tables(&self) -> [&Table; 3] {
        [&self.gaps, &self.logs, &self.runs]
    }

    /// The tables of this store: those of every store, and those of alerts, work and states where they exist.
    pub(crate) fn existing_tables(&self) -> Vec<&Table> {
        // A table that cannot be read is kept: its reader reports why.
        let later = [&self.alerts, &self.work, &self.states]
            .into_iter()
            .filter(|table| table.exists().unwrap_or(true));
        self.tables().into_iter().chain(later).collect()
    }

    /// Verifies the digest of a data file, once per store handle and its clones.
    ///
    /// Neither Delta Lake nor Polars detects a changed byte of a data file.
    ///
    /// # Errors
    /// [`Error::Damaged`] when it differs.
    pub(crate) fn check(&self, file: &Path) -> Result<(), Error> {
        let verified = || self.verified.lock().unwrap_or_else(PoisonError::into_inner);
        // The mutex is not held during the check, so that threads verify different files in parallel.
        let is_known = verified().contains(file);
        if !is_known {
            self.location.fetch(file)?;
            data_file::check(file)?;
            verified().insert(file.to_owned());
        }
        Ok(())
    }
}
