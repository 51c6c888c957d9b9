//! One Delta table: its snapshot, and a change to it that lands whole or not at all.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use arrow::array::RecordBatch;
use arrow::datatypes::SchemaRef;
use deltalake::kernel::engine::arrow_conversion::TryIntoKernel;
use deltalake::kernel::transaction::{CommitBuilder, CommitProperties, TransactionError};
use deltalake::kernel::{Action, Add, LogicalFileView, MetadataExt, StructType, TombstoneView, Transaction};
use deltalake::operations::create::CreateBuilder;
use deltalake::protocol::{DeltaOperation, SaveMode};
use deltalake::{DeltaTable, DeltaTableError, TableProperty};
use futures::TryStreamExt;
use jiff::Timestamp;

use crate::delta::data_file;
use crate::delta::durable_fs::{self, Entry};
use crate::delta::file_stats::Stats;
use crate::delta::location::Location;
use crate::delta::log_digests::{self, LogDigests};
use crate::delta::log_storage::{LOG, log_file};
use crate::delta::snapshot::{DataFile, Snapshot, SnapshotCache, commit_file};
use crate::error::Error;

/// Attempts at a change before its error is returned, each from a fresh snapshot.
const ATTEMPTS: u32 = 5;
/// The same in a bucket, where no lock keeps others away.
const ATTEMPTS_WITHOUT_LOCK: u32 = 30;
const LONGEST_PAUSE: Duration = Duration::from_secs(2);
/// The pause after the first attempt; it doubles.
const PAUSE: Duration = Duration::from_millis(50);

/// Commits between two checkpoints: the maximum number of small files that are read to open the table.
const CHECKPOINT: &str = "20";

/// Every change that removes files carries a transaction of this name.
///
/// Delta's conflict check passes over removals that only rearrange data, so two rearrangements of one
/// snapshot would both land and double their rows. Two transactions of one name never both land.
const REWRITE: &str = "freeplay.rewrite";

#[derive(Clone)]
pub(crate) struct Table {
    pub(crate) name: &'static str,
    pub(crate) schema: SchemaRef,
    pub(crate) location: Location,
    latest: SnapshotCache,
}

#[derive(Default)]
pub(crate) struct Change<'a> {
    pub(crate) add: Vec<Add>,
    pub(crate) remove: Vec<&'a DataFile>,
    /// True for compaction: rows are moved, not changed.
    pub(crate) rearranges: bool,
    pub(crate) describes: Option<Action>,
}

impl Table {
    pub(crate) fn new(store: &Location, name: &'static str, schema: SchemaRef) -> Self {
        Self { name, schema, location: store.join(name), latest: SnapshotCache::default() }
    }

    pub(crate) fn exists(&self) -> Result<bool, Error> {
        Ok(self.location.has(&commit_file(0))? || self.location.has("_delta_log/_last_checkpoint")?)
    }

    fn failed(&self, verb: &'static str) -> impl FnOnce(DeltaTableError) -> Error {
        let table = self.name;
        move |source| Error::Table { table, verb, source: Box::new(source) }
    }

    /// Creates the table with the lowest protocol version: no feature of Delta is needed to read it.
    ///
    /// Its first commit brings a file without rows: an engine that is handed the list of files, as DuckDB
    /// is, fails on an empty one.
    pub(crate) fn create(&self) -> Result<(), Error> {
        let dir = self.location.dir();
        durable_fs::create_folder(dir).map_err(Error::io(dir, "created"))?;
        let empty = Action::Add(self.empty(0)?);
        let made = self.location.block_on(async {
            let columns: StructType =
                self.schema.as_ref().try_into_kernel().map_err(DeltaTableError::from)?;
            let log_store = self.location.log_store()?;
            let create = CreateBuilder::new().with_log_store(log_store).with_table_name(self.name);
            let create =
                create.with_configuration_property(TableProperty::CheckpointInterval, Some(CHECKPOINT));
            let made = create.with_columns(columns.fields().cloned()).with_actions([empty]).await?;
            self.keep(made)
        });
        match made {
            // Another process created it in the meantime.
            Err(_) if self.exists()? => Ok(()),
            made => made.map(drop).map_err(self.failed("created")),
        }
    }

    fn empty(&self, version: u64) -> Result<Add, Error> {
        data_file::write(&self.location, version, &RecordBatch::new_empty(Arc::clone(&self.schema)), true)
    }

    /// Brings a table of an earlier release up to this one: a file without rows where it has none, and the
    /// columns it does not know.
    pub(crate) fn renew(&self) -> Result<(), Error> {
        self.change(|snapshot| {
            let add =
                if snapshot.files.is_empty() { vec![self.empty(snapshot.version + 1)?] } else { vec![] };
            let describes = self.wider(snapshot).map_err(self.failed("read"))?;
            Ok(Change { add, describes, ..Change::default() })
        })
    }

    /// The metadata action that adds missing columns of a later release to the table's schema: older
    /// files lack them, which reads as null.
    fn wider(&self, snapshot: &Snapshot) -> Result<Option<Action>, DeltaTableError> {
        let state = snapshot.delta.snapshot()?;
        let wanted: StructType = self.schema.as_ref().try_into_kernel().map_err(DeltaTableError::from)?;
        let known = state.schema();
        if wanted.fields().all(|field| known.field(field.name()).is_some()) {
            return Ok(None);
        }
        // Columns of later releases are kept.
        let others = known.fields().filter(|field| wanted.field(field.name()).is_none());
        let all =
            StructType::try_new(wanted.fields().chain(others).cloned()).map_err(DeltaTableError::from)?;
        Ok(Some(Action::Metadata(MetadataExt::with_schema(state.metadata().clone(), &all)?)))
    }

    pub(crate) fn snapshot(&self) -> Result<Snapshot, Error> {
        if let Some(newest) = self.latest.get(&self.location) {
            return Ok(newest);
        }
        let load = async {
            let mut delta = DeltaTable::new(self.location.log_store()?);
            delta.load().await?;
            Ok(delta)
        };
        let loaded = self.location.block_on(load);
        let log = self.location.dir().join(LOG);
        if loaded.is_err()
            && !self.location.is_bucket()
            && let Err(cause) = std::fs::read_dir(&log)
            && cause.kind() != std::io::ErrorKind::NotFound
        {
            return Err(Error::io(log, "read")(cause));
        }
        // A damaged file is named before the library's own error about it.
        self.check_log()?;
        loaded.and_then(|delta| self.keep(delta)).map_err(self.failed("read"))
    }

    /// Checks the log files that the current version is read from. In a bucket they would be fetched twice: there
    /// [`Table::damaged_log_files`] checks them on request.
    fn check_log(&self) -> Result<(), Error> {
        if self.location.is_bucket() {
            return Ok(());
        }
        let log = LogDigests::list(&self.location)?;
        log.current().try_for_each(|file| log.check(file))
    }

    /// Every log file that is damaged, or that another program wrote and that has no digest.
    pub(crate) fn damaged_log_files(&self) -> Result<(Vec<Error>, Vec<PathBuf>), Error> {
        let log = LogDigests::list(&self.location)?;
        let (mut damaged, mut foreign) = (Vec::new(), Vec::new());
        for file in log.files.values() {
            self.location.fetch(file)?;
            damaged.extend(log.check(file).err());
            foreign.extend(log.is_foreign(file).then(|| file.to_owned()));
        }
        Ok((damaged, foreign))
    }

    fn keep(&self, delta: DeltaTable) -> Result<Snapshot, DeltaTableError> {
        let files = delta.snapshot()?.log_data().iter().map(|view| self.file(view)).collect();
        let snapshot = Snapshot { version: delta.version().unwrap_or_default(), files, delta };
        self.latest.keep(&self.location, &snapshot);
        Ok(snapshot)
    }

    fn file(&self, view: LogicalFileView) -> DataFile {
        DataFile {
            path: self.location.dir().join(view.path().as_ref()),
            size_bytes: u64::try_from(view.size()).unwrap_or_default(),
            stats: Stats::parse(view.stats().as_deref()),
            view,
        }
    }

    /// Plans a change on the newest snapshot and commits it; after a concurrent commit, plans it again.
    pub(crate) fn change(
        &self,
        mut plan: impl FnMut(&Snapshot) -> Result<Change<'_>, Error>,
    ) -> Result<(), Error> {
        let attempts = if self.location.is_bucket() { ATTEMPTS_WITHOUT_LOCK } else { ATTEMPTS };
        let mut pause = PAUSE;
        for attempt in 1.. {
            let snapshot = self.snapshot()?;
            let mut change = plan(&snapshot)?;
            if change.add.is_empty() && change.remove.is_empty() && change.describes.is_none() {
                break;
            }
            if change.add.is_empty() && change.remove.len() == snapshot.files.len() {
                change.add.push(self.empty(snapshot.version + 1)?);
            }
            match self.commit(&snapshot, change) {
                Ok(()) => break,
                Err(error) if attempt < attempts && is_conflict(&error) => std::thread::sleep(pause),
                Err(error) => return Err(self.failed("committed to")(error)),
            }
            pause = (pause * 2).min(LONGEST_PAUSE);
        }
        Ok(())
    }

    fn commit(&self, snapshot: &Snapshot, change: Change<'_>) -> Result<(), DeltaTableError> {
        let mut properties = CommitProperties::default();
        // Without a lock, two who add the same flight must not both land either.
        if !change.remove.is_empty() || self.location.is_bucket() {
            let now = Timestamp::now().as_millisecond();
            let guard = Transaction::new_with_last_update(REWRITE, snapshot.version as i64, Some(now));
            properties = properties.with_application_transaction(guard);
        }
        let removes =
            change.remove.iter().map(|file| Action::Remove(file.view.remove_action(!change.rearranges)));
        let adds = change.add.into_iter().map(Action::Add);
        let actions: Vec<Action> = change.describes.into_iter().chain(removes).chain(adds).collect();
        let operation = if change.rearranges {
            DeltaOperation::Optimize { predicate: None, target_size: 0 }
        } else {
            DeltaOperation::Write { mode: SaveMode::Append, partition_by: None, predicate: None }
        };
        self.location.block_on(async {
            let builder = CommitBuilder::from(properties).with_actions(actions);
            let state = snapshot.delta.snapshot()?;
            let done = builder.build(Some(state), snapshot.delta.log_store(), operation).await?;
            let mut delta = snapshot.delta.clone();
            delta.state = Some(done.snapshot);
            self.keep(delta).map(drop)
        })
    }

    /// Deletes files that no snapshot younger than `kept` needs, and counts them.
    ///
    /// Ages are summed over the intervals between the table's commits, each counted as two days at most: a clock that
    /// was once ahead or back ages no file by more than that, and a file is kept that much longer. After a clock that
    /// runs back nothing is deleted until the log has forgotten it.
    pub(crate) fn vacuum(&self, kept: Duration) -> Result<usize, Error> {
        let snapshot = self.snapshot()?;
        let active: HashSet<&Path> = snapshot.files.iter().map(|file| file.path.as_path()).collect();
        let superseded = self.superseded(&snapshot).map_err(self.failed("read"))?;
        let commits = self.commit_times()?;
        let is_due = |since| kept.is_zero() || is_older(since, &commits, kept);
        let mut deleted = 0;
        for Entry { path, written, .. } in self.location.entries()? {
            let since = superseded.get(&path).copied().unwrap_or(written);
            // Data files, and those half written.
            let is_data = path.to_str().is_some_and(|path| path.contains(".parquet"));
            if is_data && !active.contains(path.as_path()) && is_due(since) {
                self.location.delete(&path)?;
                deleted += 1;
            }
        }
        log_digests::prune(&self.location)?;
        Ok(deleted)
    }

    /// When the commits that the log remembers were written, in their order, and the time now.
    fn commit_times(&self) -> Result<Vec<SystemTime>, Error> {
        let log = self.location.join("_delta_log").entries()?;
        let is_commit = |entry: &Entry| {
            log_file(&entry.path).is_some() && entry.path.extension().is_some_and(|kind| kind == "json")
        };
        let commits = log.into_iter().filter(is_commit).map(|entry| entry.written);
        Ok(commits.chain([SystemTime::now()]).collect())
    }

    fn superseded(&self, snapshot: &Snapshot) -> Result<HashMap<PathBuf, SystemTime>, DeltaTableError> {
        let tombstones: Vec<TombstoneView> = self.location.block_on(async {
            let log_store = snapshot.delta.log_store();
            snapshot.delta.snapshot()?.all_tombstones(&log_store).try_collect().await
        })?;
        let since = |ms: i64| UNIX_EPOCH + Duration::from_millis(u64::try_from(ms).unwrap_or_default());
        let entry = |t: &TombstoneView| {
            Some((self.location.dir().join(t.path().as_ref()), since(t.deletion_timestamp()?)))
        };
        Ok(tombstones.iter().filter_map(entry).collect())
    }
}

/// Data files of the current version of a Delta table of another program, by its log: files that were withdrawn or compacted away may
/// still be in its folder. Each has its path below the folder, with `/` between folders, and whether a deletion vector marks
/// some of its rows as deleted.
///
/// # Errors
/// When the log cannot be read, or maps columns to other names in the files.
pub fn live_files(folder: &Path) -> Result<BTreeMap<String, bool>, Error> {
    let location = Location::at(folder)?;
    let load = async {
        let mut delta = DeltaTable::new(location.log_store()?);
        delta.load().await?;
        let snapshot = delta.snapshot()?;
        let mode = snapshot.metadata().configuration().get("delta.columnMapping.mode");
        if mode.is_some_and(|mode| mode != "none") {
            let unsupported =
                "the table maps its columns to other names in the files (`delta.columnMapping.mode`)";
            return Err(DeltaTableError::Generic(unsupported.into()));
        }
        let files = snapshot.log_data();
        let live =
            |view: LogicalFileView| (view.path().into_owned(), view.deletion_vector_descriptor().is_some());
        Ok(files.iter().map(live).collect())
    };
    location.block_on(load).map_err(|source| Error::LogTable { source: Box::new(source) })
}

/// An interval between two commits counts as this long at most: longer ones may be a clock that was set.
const LONGEST_INTERVAL: Duration = Duration::from_hours(48);
/// File systems and buckets have clocks of their own, which differ by less than this.
const CLOCK_TOLERANCE: Duration = Duration::from_hours(1);

/// Whether a file was superseded longer ago than `kept`, by any clock that wrote these commits.
fn is_older(since: SystemTime, commits: &[SystemTime], kept: Duration) -> bool {
    let runs_back = commits.windows(2).any(|pair| pair[1] + CLOCK_TOLERANCE < pair[0]);
    if runs_back {
        return false;
    }
    let before = [since].into_iter().filter(|since| commits.first().is_some_and(|first| since < first));
    let instants: Vec<SystemTime> = before.chain(commits.iter().copied()).collect();
    let counted = |pair: &[SystemTime]| {
        pair[1].duration_since(pair[0].max(since)).unwrap_or_default().min(LONGEST_INTERVAL)
    };
    instants.windows(2).map(counted).sum::<Duration>() >= kept + LONGEST_INTERVAL
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

#[cfg(test)]
mod tests {
    use arrow::array::TimestampMicrosecondArray;
    use arrow::datatypes::{Field, Schema};

    use super::*;
    use records::row_schema::time_type;

    fn schema() -> SchemaRef {
        Arc::new(Schema::new(vec![Field::new("at", time_type(), false)]))
    }

    fn table(dir: &Path) -> Table {
        let table = Table::new(&Location::at(dir).unwrap(), "numbers", schema());
        table.create().unwrap();
        table
    }

    fn batch(numbers: Vec<i64>) -> RecordBatch {
        let at = TimestampMicrosecondArray::from(numbers).with_timezone("UTC");
        RecordBatch::try_new(schema(), vec![Arc::new(at)]).unwrap()
    }

    /// A file that was superseded one minute ago, under clocks that were right, ahead and ten years back.
    #[test]
    fn no_clock_makes_a_file_old() {
        const DAY: Duration = Duration::from_hours(24);
        let start = UNIX_EPOCH + 20_000 * DAY;
        let nights = |count: u32| (0..count).map(|night| start + night * DAY).collect::<Vec<_>>();
        let week = 7 * DAY;
        assert!(is_older(start, &nights(11), week));
        assert!(!is_older(start, &nights(7), week), "six days");
        let mut back = nights(20);
        let superseded = start.checked_sub(3650 * DAY).unwrap();
        back.extend([superseded, start + 20 * DAY, start + 21 * DAY]);
        assert!(!is_older(superseded, &back, week), "the clock was ten years back when it was superseded");
        let mut ahead = nights(6);
        ahead.push(start + 3650 * DAY);
        assert!(!is_older(start, &ahead, week), "the clock is ten years ahead now");
    }

    fn append(table: &Table, n: i64) {
        let write = |snapshot: &Snapshot| {
            data_file::write(&table.location, snapshot.version + 1, &batch(vec![n]), true)
        };
        table.change(|snapshot| Ok(Change { add: vec![write(snapshot)?], ..Change::default() })).unwrap();
    }

    fn merged<'a>(table: &Table, snapshot: &'a Snapshot, name: u64) -> Change<'a> {
        let add = data_file::write(&table.location, name, &batch(vec![1, 2]), false).unwrap();
        Change {
            add: vec![add],
            remove: snapshot.files.iter().collect(),
            rearranges: true,
            ..Change::default()
        }
    }

    fn rows(table: &Table) -> i64 {
        table.snapshot().unwrap().files.iter().filter_map(|file| file.stats.num_records).sum()
    }

    #[test]
    fn a_compaction_loses_nothing_that_is_appended_meanwhile_and_a_second_one_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        let table = table(dir.path());
        append(&table, 1);
        append(&table, 2);
        let snapshot = table.snapshot().unwrap();
        append(&table, 3);
        table.commit(&snapshot, merged(&table, &snapshot, 8)).unwrap();
        let second = table.commit(&snapshot, merged(&table, &snapshot, 9)).unwrap_err();
        assert!(is_conflict(&second), "{second}");
        assert_eq!(rows(&table), 3);
    }

    #[test]
    fn the_cached_snapshot_equals_the_log_after_every_commit_of_two_writers() {
        let dir = tempfile::tempdir().unwrap();
        let location = Location::at(dir.path()).unwrap();
        let opened = || Table::new(&location, "numbers", schema());
        let (own, other) = (table(dir.path()), opened());
        let listed_files = |snapshot: &Snapshot| -> Vec<String> {
            let files = snapshot.files.iter();
            files.map(|file| format!("{:?} {} {:?}", file.path, file.size_bytes, file.stats)).collect()
        };
        // Past two checkpoints, with files that come and go.
        for n in 1..=45 {
            append(if n % 2 == 0 { &own } else { &other }, n);
            if n % 7 == 0 {
                own.change(|snapshot| Ok(merged(&own, snapshot, 1000 + n as u64))).unwrap();
            }
            let read = opened().snapshot().unwrap();
            for kept in [&own, &other].map(|table| table.snapshot().unwrap()) {
                assert_eq!(kept.version, read.version);
                assert_eq!(listed_files(&kept), listed_files(&read), "after {n}");
            }
        }
        let (one, another) = (own.snapshot().unwrap(), own.snapshot().unwrap());
        assert!(Arc::ptr_eq(&one.files, &another.files), "what is known was read again");
    }

    #[test]
    fn a_kept_table_that_was_torn_is_an_error_and_one_in_its_place_is_read_anew() {
        let dir = tempfile::tempdir().unwrap();
        let (own, folder) = (table(dir.path()), dir.path().join("numbers"));
        (1..=3).for_each(|n| append(&own, n));
        let first = folder.join(commit_file(1));
        std::fs::write(&first, &std::fs::read(&first).unwrap()[..40]).unwrap();
        assert!(own.snapshot().is_err());
        std::fs::remove_dir_all(&folder).unwrap();
        (4..=5).for_each(|n| append(&table(dir.path()), n));
        assert_eq!(rows(&own), 2);
        std::fs::remove_dir_all(&folder).unwrap();
        assert!(own.snapshot().is_err());
    }
}
