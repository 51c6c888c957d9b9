//! Folders of logs that are tables: the table's log lists its live files; others were withdrawn.

use std::collections::{BTreeMap, HashMap};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use records::Diagnostic;

use crate::logs::local_files::parts_written_out;

/// The format of a table, by the files in its folder.
#[derive(Debug, Clone, Copy, PartialEq, Eq, strum::Display)]
enum TableFormat {
    Delta,
    Iceberg,
    Hudi,
}

/// Tables among the folders of logs. Local folders are searched when they contain a log; those of object stores are known
/// from the listing.
#[derive(Debug, Default)]
pub(crate) struct TableFolders {
    /// What each folder is; none where it is no table.
    folders: HashMap<PathBuf, Option<TableFormat>>,
    /// The live files of each table that was met, or none where the table cannot be used.
    tables: BTreeMap<PathBuf, Option<BTreeMap<PathBuf, bool>>>,
}

/// A table, or a file of it, that cannot be used, and why.
pub(crate) type TableFault = (PathBuf, Box<Diagnostic>);

impl TableFolders {
    /// The folders in which tables keep their logs.
    pub(crate) const LOGS: [&str; 3] = ["_delta_log", ".hoodie", "metadata"];

    /// Notes an object of a listing that makes its folder a table.
    pub(crate) fn note(&mut self, object: &Path) {
        let Some(folder) = object.parent() else { return };
        let format = match folder.file_name().and_then(|name| name.to_str()) {
            Some("_delta_log") => TableFormat::Delta,
            Some(".hoodie") => TableFormat::Hudi,
            Some("metadata") if is_iceberg_metadata(object) => TableFormat::Iceberg,
            _ => return,
        };
        if let Some(root) = folder.parent() {
            self.folders.insert(root.to_owned(), Some(format));
        }
    }

    /// Whether a file that fits a pattern is a log: in no table, or live in its table.
    ///
    /// # Errors
    /// A table that cannot be used, once, or a file with deleted rows.
    pub(crate) fn is_log(&mut self, file: &Path, pattern: &Path) -> Result<bool, TableFault> {
        for folder in file.ancestors().skip(1) {
            let format = match self.folders.get(folder) {
                Some(format) => *format,
                // What an object store has was noted from its listing.
                None if object_io::is_address(file) => None,
                None => {
                    let format = local_format(folder, pattern).map_err(|e| self.unknown(folder, &e))?;
                    self.folders.insert(folder.to_owned(), format);
                    format
                }
            };
            if let Some(format) = format {
                return self.member(file, folder, format);
            }
        }
        Ok(true)
    }

    /// A folder that may be a table: any of its files may be withdrawn. It is one fault for all of them.
    fn unknown(&mut self, folder: &Path, error: &std::io::Error) -> TableFault {
        self.folders.insert(folder.to_owned(), Some(TableFormat::Delta));
        self.tables.insert(folder.to_owned(), None);
        let what =
            format!("whether the folder is a Delta, Iceberg or Hudi table cannot be determined: {error}");
        let hint = "check its owner and mode, or the share; then `freeplay run`";
        (folder.to_owned(), Box::new(Diagnostic::new("folder_unreadable", what).hint(hint)))
    }

    fn member(&mut self, file: &Path, root: &Path, format: TableFormat) -> Result<bool, TableFault> {
        if !self.tables.contains_key(root) {
            let (live, fault) =
                live_files(root, format).map_or_else(|e| (None, Some(e)), |live| (Some(live), None));
            self.tables.insert(root.to_owned(), live);
            if let Some(diagnostic) = fault {
                return Err((root.to_owned(), Box::new(diagnostic)));
            }
        }
        let live = self.tables.get(root).and_then(Option::as_ref);
        match live.and_then(|live| live.get(file)) {
            None => Ok(false),
            Some(false) => Ok(true),
            Some(true) => {
                let what =
                    "rows of this file were deleted from its Delta table, and the file still holds them";
                let hint = "rewrite the table without deletion vectors: `REORG TABLE … APPLY (PURGE)`, or `OPTIMIZE`";
                Err((file.to_owned(), Box::new(Diagnostic::new("table_unsupported", what).hint(hint))))
            }
        }
    }
}

/// As [`format_of`]; folders above the part of a pattern that its user wrote out may forbid to be listed.
fn local_format(folder: &Path, pattern: &Path) -> std::io::Result<Option<TableFormat>> {
    let is_above = || folder.components().count() < parts_written_out(pattern.parent().unwrap_or(pattern));
    match format_of(folder) {
        Err(e) if e.kind() == ErrorKind::PermissionDenied && is_above() => Ok(None),
        format => format,
    }
}

/// The table that a folder is, if it is one. Folders that do not exist are the answer *no*; every other failure is an error.
fn format_of(folder: &Path) -> std::io::Result<Option<TableFormat>> {
    let is_folder = |name: &str| match std::fs::metadata(folder.join(name)) {
        Ok(data) => Ok(data.is_dir()),
        Err(e) if is_absent(&e) => Ok(false),
        Err(e) => Err(e),
    };
    if is_folder("_delta_log")? {
        return Ok(Some(TableFormat::Delta));
    }
    if is_folder(".hoodie")? {
        return Ok(Some(TableFormat::Hudi));
    }
    let metadata = match std::fs::read_dir(folder.join("metadata")) {
        Err(e) if is_absent(&e) => return Ok(None),
        entries => entries?,
    };
    for entry in metadata {
        if is_iceberg_metadata(&entry?.path()) {
            return Ok(Some(TableFormat::Iceberg));
        }
    }
    Ok(None)
}

fn is_absent(error: &std::io::Error) -> bool {
    matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory)
}

fn is_iceberg_metadata(path: &Path) -> bool {
    path.file_name().and_then(|name| name.to_str()).is_some_and(|name| name.ends_with(".metadata.json"))
}

/// The live files of a table, and whether rows of each were deleted.
fn live_files(root: &Path, format: TableFormat) -> Result<BTreeMap<PathBuf, bool>, Diagnostic> {
    if format != TableFormat::Delta {
        let what = format!("the folder is a table of Apache {format}, which is not supported");
        let hint = format!(
            "export its current snapshot to a folder of Parquet files and name that folder in `logs.files` \
             (DuckDB: `COPY (FROM {}) TO 'logs' (FORMAT parquet, PARTITION_BY (tail, flight))`)",
            if format == TableFormat::Iceberg { "iceberg_scan('…')" } else { "'…'" }
        );
        return Err(Diagnostic::new("table_unsupported", what).hint(hint));
    }
    let live = store::live_files(root).map_err(|e| {
        Diagnostic::new("table_unreadable", format!("the Delta table cannot be read: {e}"))
            .hint("repair the table, or name its files without the table: copy them to a folder of their own")
    })?;
    // A path of a table's log is below its folder, a local path of its own, or an address.
    let absolute = std::path::absolute(root).unwrap_or_else(|_| root.to_owned());
    let whole = |name: &str| match name.strip_prefix("file://") {
        None if name.contains("://") => PathBuf::from(name),
        local => {
            let name = Path::new(local.unwrap_or(name));
            root.join(name.strip_prefix(&absolute).unwrap_or(name))
        }
    };
    let live: BTreeMap<_, _> = live.into_iter().map(|(name, deleted)| (whole(&name), deleted)).collect();
    match live.keys().find(|file| !file.starts_with(root)) {
        None => Ok(live),
        Some(file) => {
            let what = format!("a live file of the Delta table is outside of its folder: {}", file.display());
            let hint =
                "copy the table with its files (a deep clone), or name folders of files without the table";
            Err(Diagnostic::new("table_unsupported", what).hint(hint))
        }
    }
}
