//! Latest row of each key of a versioned table, read batch by batch without a query engine.
//!
//! Polars starts pools of threads and plans a query before it reads a row. Every run reads the accounts first, and
//! for them that was a third of what a run with nothing to do takes.

use std::collections::BTreeMap;

use arrow::array::{AsArray, RecordBatch};
use arrow::datatypes::Int64Type;

use crate::delta::table::Table;
use crate::delta::versioned;
use crate::error::Error;
use crate::handle::Store;
use crate::read::scan::Condition;
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
        let schema = versioned::schema::<R>();
        let files = table.snapshot()?.paths_where(|stats| wanted.iter().all(|w| w.may_be_in(stats)));
        let mut newest = BTreeMap::new();
        for file in files {
            for batch in self.read_file(&file, &schema, wanted)? {
                update(&mut newest, &batch, &name)?;
            }
        }
        Ok(newest.into_values().map(|(_, row)| row).collect())
    }
}

/// Puts the rows of a batch in the place of older ones of their names. Each row has the commit that it came with.
fn update<R: Row + FromCells>(
    newest: &mut BTreeMap<String, (i64, R)>,
    batch: &RecordBatch,
    name: impl Fn(&R) -> String,
) -> Result<(), Error> {
    let commits = batch.column(batch.schema_ref().index_of(versioned::COMMIT)?).as_primitive::<Int64Type>();
    for (&commit, row) in commits.values().iter().zip(row_schema::from_batch::<R>(batch)?) {
        let name = name(&row);
        if newest.get(&name).is_none_or(|(known, _)| *known <= commit) {
            newest.insert(name, (commit, row));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::fs::File;
    use std::sync::Arc;

    use arrow::array::{ArrayRef, Int64Array, LargeStringArray, TimestampNanosecondArray};
    use parquet::arrow::ArrowWriter;

    use super::*;
    use crate::read::scan;
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
        let (dir, mut newest) = (tempfile::tempdir().unwrap(), BTreeMap::new());
        let path = dir.path().join("file");
        for batch in batches {
            let mut writer =
                ArrowWriter::try_new(File::create(&path).unwrap(), batch.schema(), None).unwrap();
            writer.write(batch).unwrap();
            writer.close().unwrap();
            for batch in scan::read_file(&path, &versioned::schema::<RunRecord>(), &[])? {
                update(&mut newest, &batch, |run: &RunRecord| run.run_id.clone())?;
            }
        }
        Ok(newest.into_values().map(|(_, run)| (run.run_id, run.found)).collect())
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
