//! Latest row of each key of a versioned table, read batch by batch without a query engine.
//!
//! Polars starts pools of threads and plans a query before it reads a row. Every run reads the accounts first, and
//! for them that was a third of what a run with nothing to do takes.

use std::collections::BTreeMap;

use arrow::array::{AsArray, RecordBatch};
use arrow::datatypes::Int64Type;
use records::row_schema::{self, FromCells, Row};

use crate::delta::table::Table;
use crate::delta::versioned;
use crate::error::Error;
use crate::handle::Store;
use crate::read::scan::Condition;

impl Store {
    /// Of the rows that meet some conditions, the newest of each name, by name; files that cannot hold one are passed over.
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
    use super::*;
    use records::RunRecord;

    #[test]
    fn the_commit_tells_which_is_newest_whatever_the_order_of_files() {
        let mut newest = BTreeMap::new();
        for (ids, found, commit) in [(["b", "a"], 20, 2), (["b", "c"], 30, 3), (["a", "c"], 10, 1)] {
            let run = |id: &str| RunRecord { run_id: id.to_owned(), found, ..RunRecord::default() };
            let batch = versioned::to_batch(&ids.map(run), commit).unwrap();
            update(&mut newest, &batch, |run: &RunRecord| run.run_id.clone()).unwrap();
        }
        let found: Vec<_> = newest.values().map(|(_, run)| (run.run_id.as_str(), run.found)).collect();
        assert_eq!(found, [("a", 20), ("b", 30), ("c", 30)]);
    }
}
