//! Compaction: many small files become few, sorted by tail, unit and departure, so that a query opens few of them.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Duration;

use crate::delta::data_file;
use crate::delta::snapshot::{DataFile, Snapshot};
use crate::delta::table::{Change, Table};
use crate::delta::versioned;
use crate::error::Error;
use crate::handle::Store;
use crate::read::frame;
use crate::read::scan::{self, Condition};
use crate::write::writer::Writer;

/// Rows of a full file: smaller files make a query open more of them; larger ones make a replaced flight copy more rows.
const FILE_ROWS: usize = 100_000;
/// Number of new files of one pass; each pass reads the old files that may contain their rows.
const FILES_AT_ONCE: usize = 5;

/// Age at which superseded files are deleted, so that readers that use them can finish: Delta's default.
const KEPT: Duration = Duration::from_hours(7 * 24);

/// What a compaction did.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Compaction {
    /// Data files before, of all tables.
    pub before: usize,
    /// Data files after.
    pub after: usize,
    /// Number of deleted files that no snapshot within the retention uses.
    pub deleted: usize,
}

/// Number of superfluous files from which a compaction pays.
const MANY_FILES: usize = 100;

impl Store {
    /// Whether compaction pays: a table has over a hundred files more than twice the number that its rows fill.
    ///
    /// # Errors
    /// [`Error::Table`] when a table's log cannot be read.
    pub fn needs_compaction(&self) -> Result<bool, Error> {
        for table in self.existing_tables() {
            let snapshot = table.snapshot()?;
            let files = &snapshot.files;
            let rows: i64 = files.iter().filter_map(|file| file.stats.num_records).sum();
            if files.len() > MANY_FILES + 2 * (rows.max(0) as usize).div_ceil(FILE_ROWS) {
                return Ok(true);
            }
        }
        Ok(false)
    }
}

impl Writer {
    /// Merges the files of every table and deletes superseded ones older than seven days.
    ///
    /// Rows do not change. Memory holds the rows of five files, or of five tails if these have more rows.
    ///
    /// # Errors
    /// As [`Writer::commit`]; the table of the error is unchanged.
    pub fn compact(&mut self) -> Result<Compaction, Error> {
        let store = self.store();
        let mut total = Compaction { before: 0, after: 0, deleted: 0 };
        for table in store.existing_tables() {
            let before = table.snapshot()?.files.len();
            table.change(|snapshot| merged(store, table, snapshot))?;
            total.before += before;
            total.after += table.snapshot()?.files.len();
        }
        total.deleted = self.vacuum(KEPT)?;
        Ok(total)
    }

    /// Deletes data files that were superseded, or written and never committed, longer ago than `kept`.
    ///
    /// # Errors
    /// [`Error::Io`] when a file cannot be deleted, [`Error::Table`] when the log cannot be read.
    pub fn vacuum(&mut self, kept: Duration) -> Result<usize, Error> {
        let tables = self.store().existing_tables();
        tables.iter().map(|table| table.vacuum(kept)).sum()
    }
}

/// Columns by which a compacted table is sorted; rows with the same value of the first column are written together.
fn order(table: &Table) -> &'static [&'static str] {
    match table.name {
        "gaps" => &["tail_number", "serial_number", "departure_utc"],
        "logs" => &["log_path", versioned::COMMIT],
        "alerts" => &["alert_id", versioned::COMMIT],
        "work" => &["request_id", "number", versioned::COMMIT],
        _ => &["run_id", versioned::COMMIT],
    }
}

/// The change that merges the files of a table; empty if that would not lower their number and all have a digest.
fn merged<'a>(store: &Store, table: &Table, snapshot: &'a Snapshot) -> Result<Change<'a>, Error> {
    let order = order(table);
    let (slice_by, files, schema) = (order[0], snapshot.paths().collect::<Vec<_>>(), &table.schema);
    let values = store.read_files(&files, &scan::only(schema, &[slice_by])?, &[])?;
    let counts = frame::counts(&frame::frame(&values, &[slice_by])?, slice_by)?;
    let slices = slices(&counts.into_iter().collect(), FILE_ROWS);
    let planned: usize = slices.iter().map(|slice| slice.rows.div_ceil(FILE_ROWS)).sum();
    let all_ours = snapshot.files.iter().all(DataFile::has_digest);
    if planned.max(1) >= files.len() && all_ours {
        return Ok(Change::default());
    }
    let mut change =
        Change { remove: snapshot.files.iter().collect(), rearranges: true, ..Change::default() };
    for slices in slices.chunks(FILES_AT_ONCE) {
        let (first, last) = (&slices[0].first, &slices[slices.len() - 1].last);
        let conditions = [Condition::texts(slice_by, first, last)];
        let read =
            |files: &[PathBuf]| frame::sorted(&store.read_files(files, schema, &conditions)?, order, None);
        let mut rows = read(&snapshot.paths_where(|stats| conditions[0].may_be_in(stats)))?;
        // The statistics of a file are wrong: read all files, so that no row is lost.
        if rows.num_rows() != slices.iter().map(|slice| slice.rows).sum::<usize>() {
            rows = read(&files)?;
        }
        let mut begin = 0;
        for slice in slices {
            for first in (0..slice.rows).step_by(FILE_ROWS) {
                let part = rows.slice(begin + first, FILE_ROWS.min(slice.rows - first));
                change.add.push(data_file::write(&table.location, snapshot.version + 1, &part, false)?);
            }
            begin += slice.rows;
        }
    }
    Ok(change)
}

/// A range of values of the first sort column; its rows are written together.
#[derive(Debug, PartialEq)]
struct OutputRange {
    first: String,
    last: String,
    rows: usize,
}

fn slices(counts: &BTreeMap<String, usize>, file_rows: usize) -> Vec<OutputRange> {
    let mut slices: Vec<OutputRange> = Vec::new();
    for (value, &rows) in counts {
        match slices.last_mut() {
            Some(slice) if slice.rows + rows <= file_rows => {
                slice.last.clone_from(value);
                slice.rows += rows;
            }
            _ => slices.push(OutputRange { first: value.clone(), last: value.clone(), rows }),
        }
    }
    slices
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_is_never_cut_and_a_file_never_overfull_with_several() {
        let counts = [("a", 4), ("b", 6), ("c", 1), ("d", 30), ("e", 2)];
        let found = slices(&counts.map(|(name, rows)| (name.to_owned(), rows)).into(), 10);
        let found: Vec<_> = found.iter().map(|s| (s.first.as_str(), s.last.as_str(), s.rows)).collect();
        assert_eq!(found, [("a", "b", 10), ("c", "c", 1), ("d", "d", 30), ("e", "e", 2)]);
    }
}
