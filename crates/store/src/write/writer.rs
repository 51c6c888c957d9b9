//! The writer: finished logs become records and accounts, whole flights at a time, each flight once.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use arrow::array::{AsArray, BooleanArray, RecordBatch};
use arrow::compute::kernels::cmp::distinct;
use arrow::compute::{concat_batches, filter_record_batch, or};
use arrow::datatypes::{Schema, SchemaRef, TimestampMicrosecondType};
use arrow::error::ArrowError;
use records::row_schema::{self, FromCells, Row, from_batch, to_batch};
use records::{GapRecord, LogRecord, RecordKey, Status, stored_row};

use crate::delta::data_file;
use crate::delta::file_stats::Stats;
use crate::delta::snapshot::{DataFile, Snapshot};
use crate::delta::table::{Change, Table};
use crate::delta::versioned;
use crate::error::Error;
use crate::handle::Store;
use crate::read::column_scan::not_withdrawn;
use crate::read::scan::Condition;
use crate::store_dir::{FORMAT, MARKER, check_marker, write_marker};
use crate::write::lock::Lock;

/// What came of one log.
#[derive(Debug, Clone, PartialEq)]
pub struct LogResult {
    /// The status of the log.
    pub account: LogRecord,
    /// Its records; each takes the place of a stored one with the same key.
    pub records: Vec<GapRecord>,
    /// Keys and log digests of the stored records of the same samples, whose flight was given another identity since.
    pub moved_from: Vec<(RecordKey, String)>,
}

stored_row! {
    /// The columns of a record that show from which log and from which samples it was computed.
    #[derive(Debug, Clone, PartialEq)]
    pub struct HeldRecord {
        pub log_path: String,
        pub log_digest: String,
        status: Status,
        gap_m: Option<f64>,
        gap_midrange_m: Option<f64>,
        load_p05_n: Option<f64>,
        load_p95_n: Option<f64>,
        samples: i64,
    }
}

impl HeldRecord {
    /// Of a record that is about to be stored.
    pub fn of(record: &GapRecord) -> Self {
        let (estimate, provenance) = (&record.estimate, &record.provenance);
        Self {
            log_path: provenance.log_path.clone(),
            log_digest: provenance.log_digest.clone(),
            status: estimate.status,
            gap_m: estimate.gap_m,
            gap_midrange_m: estimate.gap_midrange_m,
            load_p05_n: estimate.load_p05_n,
            load_p95_n: estimate.load_p95_n,
            samples: estimate.samples,
        }
    }

    /// Whether it has a gap.
    pub fn is_estimated(&self) -> bool {
        self.status == Status::Estimated
    }

    /// The number of samples, and the bits of what was estimated from them: equal samples give equal bits.
    pub fn samples_key(&self) -> (i64, [Option<u64>; 4]) {
        let numbers = [self.gap_m, self.gap_midrange_m, self.load_p05_n, self.load_p95_n];
        (self.samples, numbers.map(|number| number.map(f64::to_bits)))
    }

    /// Whether both were computed from the same log, or from the same samples.
    pub fn is_same_as(&self, other: &Self) -> bool {
        self.log_digest == other.log_digest || self.samples_key() == other.samples_key()
    }
}

/// The right to write to the store, until it is dropped.
#[derive(Debug)]
pub struct Writer {
    store: Store,
    _lock: Option<Lock>,
}

#[derive(Clone, Copy)]
enum Decision<'a> {
    Replaced(&'a GapRecord),
    /// The stored record goes if its log has this digest: its samples are stored under another key now.
    Moved(&'a str),
}

type MergeDecisions<'a> = BTreeMap<RecordKey, Decision<'a>>;

impl Store {
    /// Locks the store for writing; waits at most `wait` for another writer.
    ///
    /// A bucket has no lock: a commit that another one preceded is rejected there, and planned again.
    ///
    /// # Errors
    /// [`Error::Held`] names the holder; [`Error::Io`] when the folder cannot be written.
    pub fn lock(&self, wait: Option<Duration>) -> Result<Writer, Error> {
        let lock = self.lock_file().map(|file| Lock::take(&file, wait)).transpose()?;
        if check_marker(&self.location, MARKER)? < FORMAT {
            write_marker(&self.location)?;
        }
        Ok(Writer { store: self.clone(), _lock: lock })
    }
}

impl Writer {
    /// The store as readers see it.
    pub fn store(&self) -> &Store {
        &self.store
    }

    /// Stores what came of some logs; where two of them speak of one record, the later one counts. A record is only ever
    /// replaced by one of the same key, or by one of the same samples under another key.
    ///
    /// The records of all of them appear in one commit, and their accounts in the next. A process that
    /// dies in between has stored whole flights without accounts: its logs are run again, and supersede
    /// their own records. Superseding copies those files only that hold a superseded record. An error leaves what was
    /// stored before as it was.
    ///
    /// # Errors
    /// [`Error::Io`] and [`Error::Table`] when the disk refuses, [`Error::Damaged`] when a file to be
    /// copied is not the one that was committed. What was stored before is intact.
    pub fn commit(&mut self, results: &[LogResult]) -> Result<(), Error> {
        let decisions = decisions(results);
        if !decisions.is_empty() {
            self.store.gaps.change(|snapshot| self.supersede(snapshot, &decisions))?;
        }
        let newest: BTreeMap<&str, &LogRecord> =
            results.iter().map(|result| (result.account.log_path.as_str(), &result.account)).collect();
        account(&self.store.logs, &newest.into_values().cloned().collect::<Vec<_>>())
    }

    /// The stored records of some keys; withdrawn ones are left out.
    ///
    /// # Errors
    /// As [`Store::records`].
    pub fn held(&self, keys: &BTreeSet<RecordKey>) -> Result<BTreeMap<RecordKey, HeldRecord>, Error> {
        self.held_where(&[not_withdrawn()], |stats| may_hold_any(stats, keys), |key| keys.contains(key))
    }

    /// The stored records of flights that departed from a time to another, µs since 1970 UTC; withdrawn ones are left out.
    ///
    /// # Errors
    /// As [`Store::records`].
    pub fn held_between(
        &self,
        first_us: i64,
        last_us: i64,
    ) -> Result<BTreeMap<RecordKey, HeldRecord>, Error> {
        let departed = Condition::times("departure_utc", first_us, last_us);
        let conditions = [not_withdrawn(), departed.clone()];
        self.held_where(&conditions, |stats| departed.may_be_in(stats), |_| true)
    }

    fn held_where(
        &self,
        conditions: &[Condition],
        may_hold: impl Fn(&Stats) -> bool,
        is_wanted: impl Fn(&RecordKey) -> bool,
    ) -> Result<BTreeMap<RecordKey, HeldRecord>, Error> {
        let files = self.store.gaps.snapshot()?.paths_where(may_hold);
        let all = GapRecord::schema();
        let names = row_schema::columns::<HeldRecord>().into_iter().map(|column| column.name);
        let columns = RecordKey::COLUMNS.into_iter().chain(names).map(|name| all.index_of(name));
        let schema = Arc::new(all.project(&columns.collect::<Result<Vec<_>, _>>()?)?);
        let mut held = BTreeMap::new();
        for batch in self.store.read_files(&files, &schema, conditions)? {
            let is_wanted = keys_of(&batch)?.iter().map(|key| Some(is_wanted(key))).collect();
            let batch = filter_record_batch(&batch, &is_wanted)?;
            held.extend(keys_of(&batch)?.into_iter().zip(from_batch::<HeldRecord>(&batch)?));
        }
        Ok(held)
    }

    /// Rewrites those data files whose rows a function changes, in one commit, and returns the number of changed rows.
    /// The function sees some columns of the stored records, in this order, and returns them with as many rows.
    ///
    /// # Errors
    /// As [`Writer::commit`], and what the function fails with.
    pub fn rewrite(
        &mut self,
        columns: &[&str],
        mut change: impl FnMut(&RecordBatch) -> Result<RecordBatch, ArrowError>,
    ) -> Result<usize, Error> {
        let schema = GapRecord::schema();
        let places = columns.iter().map(|name| schema.index_of(name)).collect::<Result<Vec<_>, _>>()?;
        let some = Arc::new(schema.project(&places)?);
        let mut changed = 0;
        self.store.gaps.change(|snapshot| {
            changed = 0;
            let (location, version) = (&self.store.gaps.location, snapshot.version + 1);
            let mut commit = Change::default();
            for file in snapshot.files.iter().filter(|file| file.has_rows()) {
                let before = self.read_all(file, &some)?;
                let after = change(&before)?;
                let rows = differing_rows(&before, &after)?;
                if rows == 0 {
                    continue;
                }
                changed += rows;
                let all = self.read_all(file, &schema)?;
                let mut arrays = all.columns().to_vec();
                for (place, array) in places.iter().zip(after.columns()) {
                    arrays[*place] = Arc::clone(array);
                }
                let all = RecordBatch::try_new(Arc::clone(&schema), arrays)?;
                commit.remove.push(file);
                commit.add.push(data_file::write(location, version, &all, true)?);
            }
            Ok(commit)
        })?;
        Ok(changed)
    }

    fn supersede<'a>(
        &self,
        snapshot: &'a Snapshot,
        decisions: &MergeDecisions<'_>,
    ) -> Result<Change<'a>, Error> {
        let mut change = Change::default();
        let (location, version) = (&self.store.gaps.location, snapshot.version + 1);
        let keys = decisions.keys().cloned().collect();
        for file in snapshot.files.iter().filter(|file| file.has_rows() && may_hold_any(&file.stats, &keys)) {
            if let Some(rest) = self.without(file, decisions)? {
                change.remove.push(file);
                if rest.num_rows() > 0 {
                    change.add.push(data_file::write(location, version, &rest, true)?);
                }
            }
        }
        let new = decisions.values().filter_map(|decision| match decision {
            Decision::Replaced(record) => Some((*record).clone()),
            Decision::Moved(_) => None,
        });
        let new: Vec<GapRecord> = new.collect();
        if !new.is_empty() {
            change.add.push(data_file::write(location, version, &to_batch(&new)?, true)?);
        }
        Ok(change)
    }

    /// The rows of a file that no decision removes; none if all of them stay.
    fn without(&self, file: &DataFile, decisions: &MergeDecisions<'_>) -> Result<Option<RecordBatch>, Error> {
        let schema = GapRecord::schema();
        let columns = key_columns(&schema)?.into_iter().chain([schema.index_of("log_digest")?]);
        let keys = Arc::new(schema.project(&columns.collect::<Vec<_>>())?);
        if is_kept(&self.read_all(file, &keys)?, decisions)?.false_count() == 0 {
            return Ok(None);
        }
        let all = self.read_all(file, &schema)?;
        Ok(Some(filter_record_batch(&all, &is_kept(&all, decisions)?)?))
    }

    fn read_all(&self, file: &DataFile, schema: &SchemaRef) -> Result<RecordBatch, Error> {
        Ok(concat_batches(schema, &self.store.read_file(&file.path, schema, &[])?)?)
    }
}

fn differing_rows(before: &RecordBatch, after: &RecordBatch) -> Result<usize, ArrowError> {
    let mut differs = BooleanArray::from(vec![false; before.num_rows()]);
    for (before, after) in before.columns().iter().zip(after.columns()) {
        differs = or(&differs, &distinct(before, after)?)?;
    }
    Ok(differs.true_count())
}

/// Appends rows to a table of which the newest counts; without a row there is no commit.
pub(crate) fn account<R: Row + FromCells>(table: &Table, rows: &[R]) -> Result<(), Error> {
    if rows.is_empty() {
        return Ok(());
    }
    table.change(|snapshot| {
        let version = snapshot.version + 1;
        let add = data_file::write(&table.location, version, &versioned::to_batch(rows, version)?, true)?;
        Ok(Change { add: vec![add], ..Change::default() })
    })
}

/// What becomes of each key. Samples that leave a key take their own record with them, and no other log's.
fn decisions(results: &[LogResult]) -> MergeDecisions<'_> {
    let mut decisions = MergeDecisions::new();
    for result in results {
        for (key, digest) in &result.moved_from {
            let is_of_other = |record: &GapRecord| record.provenance.log_digest != *digest;
            if !matches!(decisions.get(key), Some(Decision::Replaced(record)) if is_of_other(record)) {
                decisions.insert(key.clone(), Decision::Moved(digest));
            }
        }
        let replaced = |record| (RecordKey::of(record), Decision::Replaced(record));
        decisions.extend(result.records.iter().map(replaced));
    }
    decisions
}

/// Whether the file may hold one of the records, by its bounds.
fn may_hold_any(stats: &Stats, keys: &BTreeSet<RecordKey>) -> bool {
    let (earliest_us, latest_us) = stats.times_us("departure_utc");
    let from = |departure_us| RecordKey { departure_us, tail_number: String::new(), position: String::new() };
    let mut in_time = keys.range(from(earliest_us)..from(latest_us.saturating_add(1)));
    in_time.any(|key| stats.may_hold("tail_number", &key.tail_number, &key.tail_number))
}

fn is_kept(batch: &RecordBatch, decisions: &MergeDecisions<'_>) -> Result<BooleanArray, Error> {
    let digests = batch.column(batch.schema_ref().index_of("log_digest")?).as_string::<i32>();
    let is_kept = |(row, key): (usize, RecordKey)| match decisions.get(&key) {
        None => true,
        Some(Decision::Replaced(_)) => false,
        Some(Decision::Moved(digest)) => *digest != digests.value(row),
    };
    Ok(keys_of(batch)?.into_iter().enumerate().map(|row| Some(is_kept(row))).collect())
}

pub(crate) fn keys_of(batch: &RecordBatch) -> Result<Vec<RecordKey>, Error> {
    let keys = batch.project(&key_columns(batch.schema_ref())?)?;
    let departures = keys.column(0).as_primitive::<TimestampMicrosecondType>();
    let [tails, positions] = [1, 2].map(|column| keys.column(column).as_string::<i32>());
    let key = |row| RecordKey {
        departure_us: departures.value(row),
        tail_number: tails.value(row).to_owned(),
        position: positions.value(row).to_owned(),
    };
    Ok((0..departures.len()).map(key).collect())
}

pub(crate) fn key_columns(schema: &Schema) -> Result<Vec<usize>, Error> {
    RecordKey::COLUMNS.iter().map(|name| Ok(schema.index_of(name)?)).collect()
}
