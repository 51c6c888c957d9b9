//! Latest row of each key of a versioned table, read batch by batch without a query engine.
//!
//! Polars starts pools of threads and plans a query before it reads a row. Every run reads the accounts first, and
//! for them that was a third of what a run with nothing to do takes.

use std::collections::BTreeMap;
use std::path::PathBuf;

use arrow::array::AsArray;
use arrow::datatypes::Int64Type;

use crate::delta::snapshot::DataFile;
use crate::delta::table::Table;
use crate::delta::versioned;
use crate::error::Error;
use crate::handle::Store;
use crate::read::scan::{self, Condition};
use records::row_schema::{self, FromCells, Row};

impl Store {
    /// Of the rows that meet some conditions, the newest of each name, by name; files that cannot hold one are passed over.
    ///
    /// # Errors
    /// As [`Store::records`].
    pub(crate) fn newest<R: Row + FromCells>(
        &self,
        table: &Table,
        wanted: &[Condition],
        name: impl Fn(&R) -> String,
    ) -> Result<Vec<R>, Error> {
        let snapshot = table.snapshot()?;
        let may_hold = |file: &&DataFile| file.has_rows() && wanted.iter().all(|w| w.may_be_in(&file.stats));
        let files: Vec<PathBuf> =
            snapshot.files.iter().filter(may_hold).map(|file| file.path.clone()).collect();
        self.check(&files)?;
        newest_of(&files, wanted, name)
    }
}

fn newest_of<R: Row + FromCells>(
    files: &[PathBuf],
    wanted: &[Condition],
    name: impl Fn(&R) -> String,
) -> Result<Vec<R>, Error> {
    let schema = versioned::schema::<R>();
    let commit_column = schema.index_of(versioned::COMMIT)?;
    // By name: the row, and the commit that it came with.
    let mut newest: BTreeMap<String, (i64, R)> = BTreeMap::new();
    for file in files {
        for batch in scan::read_file(file, &schema, wanted)? {
            let commits = batch.column(commit_column).as_primitive::<Int64Type>();
            for (&commit, row) in commits.values().iter().zip(row_schema::from_batch::<R>(&batch)?) {
                let name = name(&row);
                if newest.get(&name).is_none_or(|(known, _)| *known <= commit) {
                    newest.insert(name, (commit, row));
                }
            }
        }
    }
    Ok(newest.into_values().map(|(_, row)| row).collect())
}

#[cfg(test)]
mod tests {
    use std::fs::File;
    use std::sync::Arc;

    use arrow::array::{ArrayRef, Int64Array, LargeStringArray, RecordBatch, TimestampNanosecondArray};
    use parquet::arrow::ArrowWriter;

    use super::*;
    use records::RunRecord;

    /// Runs as another program may write them: long texts, nanoseconds, columns in another order and one of its own,
    /// and none of those that may be empty.
    fn foreign(ids: &[&str], found: i64, commit: i64) -> RecordBatch {
        let texts = |text: &str| Arc::new(LargeStringArray::from(vec![text; ids.len()])) as ArrayRef;
        let counts = |count: i64| Arc::new(Int64Array::from(vec![count; ids.len()])) as ArrayRef;
        let times = TimestampNanosecondArray::from(vec![3_000_000_000; ids.len()]).with_timezone("UTC");
        let mut columns = vec![
            ("commit", counts(commit)),
            ("own", counts(7)),
            ("run_id", Arc::new(LargeStringArray::from(ids.to_vec())) as ArrayRef),
            ("started_utc", Arc::new(times) as ArrayRef),
            ("program_version", texts("0")),
            ("config_path", texts("a")),
            ("found", counts(found)),
        ];
        let others = ["known", "done", "estimated", "refused", "errors", "not_reached"];
        columns.extend(others.map(|name| (name, counts(0))));
        RecordBatch::try_from_iter(columns).unwrap()
    }

    fn taken(batches: &[RecordBatch]) -> Result<Vec<(String, i64)>, Error> {
        let dir = tempfile::tempdir().unwrap();
        let files: Vec<PathBuf> = (0..batches.len()).map(|k| dir.path().join(k.to_string())).collect();
        for (path, batch) in files.iter().zip(batches) {
            let mut writer = ArrowWriter::try_new(File::create(path).unwrap(), batch.schema(), None).unwrap();
            writer.write(batch).unwrap();
            writer.close().unwrap();
        }
        let newest = newest_of(&files, &[], |run: &RunRecord| run.run_id.clone())?;
        Ok(newest.into_iter().map(|run| (run.run_id, run.found)).collect())
    }

    #[test]
    fn the_commit_tells_which_is_newest_whatever_the_order_of_files() {
        let batches = [foreign(&["b", "a"], 20, 2), foreign(&["b", "c"], 30, 3), foreign(&["a", "c"], 10, 1)];
        let expected = [("a", 20), ("b", 30), ("c", 30)].map(|(name, found)| (name.to_owned(), found));
        assert_eq!(taken(&batches).unwrap(), expected);
    }

    #[test]
    fn a_column_that_must_be_there_and_is_not_is_an_error() {
        let batch = foreign(&["a"], 1, 1);
        let without: Vec<usize> = (1..batch.num_columns()).collect();
        assert!(taken(&[batch.project(&without).unwrap()]).is_err());
    }
}
