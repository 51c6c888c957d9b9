//! One Delta table: its snapshot, and a change to it that lands whole or not at all.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use arrow::datatypes::Schema;
use deltalake::kernel::engine::arrow_conversion::TryIntoKernel;
use deltalake::kernel::transaction::{CommitBuilder, CommitProperties, TransactionError};
use deltalake::kernel::{Action, Add, LogicalFileView, StructType, Transaction};
use deltalake::operations::create::CreateBuilder;
use deltalake::protocol::{DeltaOperation, SaveMode};
use deltalake::{DeltaTable, DeltaTableBuilder, DeltaTableError};
use jiff::Timestamp;
use tokio::runtime::Runtime;
use url::Url;

use crate::durable::DurableFiles;
use crate::error::Error;
use crate::stats::Stats;

/// Attempts at a change before its error is told, each from a fresh snapshot.
const ATTEMPTS: u32 = 5;
/// The pause after the first attempt; it doubles.
const PAUSE: Duration = Duration::from_millis(50);

/// Every change that removes files carries a transaction of this name.
///
/// Delta's conflict check passes over removals that only rearrange data, so two rearrangements of one
/// snapshot would both land and double their rows. Two transactions of one name never both land.
const REWRITE: &str = "freeplay.rewrite";

/// A table of the store.
#[derive(Debug, Clone)]
pub(crate) struct Table {
    pub(crate) name: &'static str,
    dir: PathBuf,
    runtime: Arc<Runtime>,
}

/// A table as of one version.
pub(crate) struct Snapshot {
    pub(crate) version: u64,
    pub(crate) files: Vec<DataFile>,
    delta: DeltaTable,
}

/// A data file as the log knows it.
pub(crate) struct DataFile {
    pub(crate) path: PathBuf,
    pub(crate) stats: Stats,
    view: LogicalFileView,
}

/// What a commit does.
#[derive(Default)]
pub(crate) struct Change<'a> {
    pub(crate) add: Vec<Add>,
    pub(crate) remove: Vec<&'a DataFile>,
    /// Whether the same rows only lie elsewhere afterwards.
    pub(crate) rearranges: bool,
}

impl Table {
    pub(crate) fn new(store: &Path, name: &'static str, runtime: Arc<Runtime>) -> Self {
        Self { name, dir: store.join(name), runtime }
    }

    pub(crate) fn dir(&self) -> &Path {
        &self.dir
    }

    pub(crate) fn exists(&self) -> bool {
        self.dir.join("_delta_log").join(format!("{:020}.json", 0)).exists()
            || self.dir.join("_delta_log/_last_checkpoint").exists()
    }

    fn failed(&self, verb: &'static str) -> impl FnOnce(DeltaTableError) -> Error {
        let table = self.name;
        move |source| Error::Table { table, verb, source: Box::new(source) }
    }

    fn builder(&self) -> Result<DeltaTableBuilder, DeltaTableError> {
        let invalid = || DeltaTableError::InvalidTableLocation(self.dir.display().to_string());
        let url = Url::from_directory_path(&self.dir).map_err(|()| invalid())?;
        let builder = DeltaTableBuilder::from_url(url.clone())?;
        Ok(builder.with_storage_backend(Arc::new(DurableFiles::default()), url))
    }

    /// Makes the table with the lowest protocol there is: no feature of Delta is needed to read it.
    pub(crate) fn create(&self, schema: &Schema) -> Result<(), Error> {
        std::fs::create_dir_all(&self.dir).map_err(Error::io(&self.dir, "created"))?;
        let made = self.runtime.block_on(async {
            let columns: StructType = schema.try_into_kernel().map_err(DeltaTableError::from)?;
            let log_store = self.builder()?.build_storage()?;
            let create = CreateBuilder::new().with_log_store(log_store).with_table_name(self.name);
            create.with_columns(columns.fields().cloned()).await
        });
        match made {
            // Somebody else made it in the meantime.
            Err(_) if self.exists() => Ok(()),
            made => made.map(drop).map_err(self.failed("created")),
        }
    }

    /// The table as it is now.
    pub(crate) fn snapshot(&self) -> Result<Snapshot, Error> {
        let load = async {
            let delta = self.builder()?.load().await?;
            let files = delta.snapshot()?.log_data().iter().map(|view| self.file(view)).collect();
            Ok(Snapshot { version: delta.version().unwrap_or_default(), files, delta })
        };
        self.runtime.block_on(load).map_err(self.failed("read"))
    }

    fn file(&self, view: LogicalFileView) -> DataFile {
        DataFile {
            path: self.dir.join(view.path().as_ref()),
            stats: Stats::parse(view.stats().as_deref()),
            view,
        }
    }

    /// Plans a change on the newest snapshot and commits it; when others were faster, plans it anew.
    ///
    /// # Errors
    /// What planning fails with, or [`Error::Table`] when the change cannot be committed.
    pub(crate) fn change(
        &self,
        mut plan: impl FnMut(&Snapshot) -> Result<Change<'_>, Error>,
    ) -> Result<(), Error> {
        let mut pause = PAUSE;
        for attempt in 1.. {
            let snapshot = self.snapshot()?;
            let change = plan(&snapshot)?;
            if change.add.is_empty() && change.remove.is_empty() {
                break;
            }
            match self.commit(&snapshot, change) {
                Ok(()) => break,
                Err(error) if attempt < ATTEMPTS && is_conflict(&error) => std::thread::sleep(pause),
                Err(error) => return Err(self.failed("committed to")(error)),
            }
            pause *= 2;
        }
        Ok(())
    }

    fn commit(&self, snapshot: &Snapshot, change: Change<'_>) -> Result<(), DeltaTableError> {
        let mut properties = CommitProperties::default();
        if !change.remove.is_empty() {
            let now = Timestamp::now().as_millisecond();
            let guard = Transaction::new_with_last_update(REWRITE, snapshot.version as i64, Some(now));
            properties = properties.with_application_transaction(guard);
        }
        let removes =
            change.remove.iter().map(|file| Action::Remove(file.view.remove_action(!change.rearranges)));
        let actions: Vec<Action> = removes.chain(change.add.into_iter().map(Action::Add)).collect();
        let operation = if change.rearranges {
            DeltaOperation::Optimize { predicate: None, target_size: 0 }
        } else {
            DeltaOperation::Write { mode: SaveMode::Append, partition_by: None, predicate: None }
        };
        self.runtime.block_on(async {
            let builder = CommitBuilder::from(properties).with_actions(actions);
            let state = snapshot.delta.snapshot()?;
            builder.build(Some(state), snapshot.delta.log_store(), operation).await.map(drop)
        })
    }
}

/// Whether a fresh plan may succeed where this one failed.
fn is_conflict(error: &DeltaTableError) -> bool {
    let DeltaTableError::Transaction { source } = error else { return false };
    matches!(
        source,
        TransactionError::VersionAlreadyExists(_)
            | TransactionError::CommitConflict(_)
            | TransactionError::MaxCommitAttempts(_)
    )
}
