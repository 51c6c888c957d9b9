//! Delta tables of other programs: which of the files in a folder of logs belong to the table now.

use std::collections::BTreeMap;
use std::path::Path;

use deltalake::kernel::LogicalFileView;
use deltalake::{DeltaTable, DeltaTableError};

use crate::delta::location::Location;
use crate::error::Error;

/// Data files of the current version of a Delta table, by its log: files that were withdrawn or compacted away may
/// still be in its folder. Each has its path below the folder, with `/` between folders, and whether a deletion vector marks
/// some of its rows as deleted. A log that maps columns to other names in the files is an error.
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
