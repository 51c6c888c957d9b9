//! Errors of the store, with their remedies.

use std::io::ErrorKind;
use std::path::PathBuf;

use deltalake::DeltaTableError;
use records::Diagnostic;
use records::row_schema::RowError;

/// Why the store could not be opened, read or written.
#[derive(Debug, thiserror::Error)]
#[expect(
    missing_docs,
    reason = "each variant says by its message what is wrong, and names its fields for what they hold"
)]
pub enum Error {
    #[error("no store at {}", dir.display())]
    Missing { dir: PathBuf },
    #[error("{} is not a Freeplay store: it holds `{found}` and no `store.json`", dir.display())]
    Foreign { dir: PathBuf, found: String },
    /// Delta Lake takes a percent sign and two hexadecimal digits in a path for another character.
    #[error("{} cannot hold a store: Delta Lake takes `{found}` in its path for another character", dir.display())]
    Name { dir: PathBuf, found: String },
    #[error("{} has format {found}; this release supports format {known}", file.display())]
    Format { file: PathBuf, found: String, known: u64 },
    #[error("{} is truncated: it holds `{found}`", file.display())]
    Torn { file: PathBuf, found: String },
    #[error("the store is {holder}")]
    Held { holder: String },
    #[error("{} cannot be {verb}: {source}", path.display())]
    Io { path: PathBuf, verb: &'static str, source: std::io::Error },
    #[error("table `{table}` cannot be {verb}: {}", first_line(source))]
    Table { table: &'static str, verb: &'static str, source: Box<DeltaTableError> },
    /// A Delta table of another program cannot be read.
    #[error("{}", first_line(source))]
    LogTable { source: Box<DeltaTableError> },
    #[error("a data file is corrupt: its digest is {}…, but {}… was committed", short(found), short(wanted))]
    Damaged { path: PathBuf, found: String, wanted: String },
    /// A file of the Delta log is not the one that was written.
    #[error("the log of a table is damaged: {problem}")]
    LogDamaged { path: PathBuf, problem: String },
    #[error(transparent)]
    Object(#[from] object_io::Error),
    #[error(transparent)]
    Row(#[from] RowError),
    #[error("rows cannot be sorted: {0}")]
    Frame(#[from] polars::error::PolarsError),
    #[error("rows cannot be brought into columns: {0}")]
    Arrow(#[from] arrow::error::ArrowError),
    #[error("Parquet: {0}")]
    Parquet(#[from] parquet::errors::ParquetError),
}

impl Error {
    /// The error as a person meets it: with its stable code, its file and a remedy.
    pub fn diagnostic(&self) -> Diagnostic {
        let (code, remedy) = self.code_and_remedy();
        let file = self.file().map(|file| file.display().to_string());
        Diagnostic { file, ..Diagnostic::new(code, self).hint(remedy) }
    }

    /// The error of the system that caused this one, if one did: it is no finding about the content of the store.
    fn system_error(&self) -> Option<std::io::Error> {
        match self {
            // Tables are opened only in folders that were found: this one is gone, or its `stat` failed.
            Self::Table { source, .. } if source.to_string().contains("Invalid table location") => {
                Some(ErrorKind::Other.into())
            }
            Self::Table { source, .. } | Self::LogTable { source } => os_error(source),
            Self::Arrow(source) => os_error(source),
            Self::Parquet(source) => os_error(source),
            _ => None,
        }
    }

    fn file(&self) -> Option<&PathBuf> {
        match self {
            Self::Missing { dir } | Self::Foreign { dir, .. } | Self::Name { dir, .. } => Some(dir),
            Self::Format { file, .. } | Self::Torn { file, .. } => Some(file),
            Self::Io { path, .. } | Self::Damaged { path, .. } | Self::LogDamaged { path, .. } => Some(path),
            _ => None,
        }
    }

    fn code_and_remedy(&self) -> (&'static str, &'static str) {
        if let Some(error) = self.system_error() {
            return ("store_io", io_remedy(&error));
        }
        match self {
            Self::Missing { .. } => {
                ("store_missing", "create it with `freeplay run`, or correct `path` under `[store]`")
            }
            Self::Foreign { .. } => {
                ("store_foreign", "name a new or an empty folder as `store` in the configuration")
            }
            Self::Name { .. } => {
                ("store_foreign", "name a folder without a percent sign as `store` in the configuration")
            }
            Self::Format { .. } => ("store_format", "read it with the release that wrote it"),
            Self::Torn { .. } => {
                ("store_format", "restore this file from a backup; its content is in docs/store.md")
            }
            Self::Held { .. } => ("store_held", "wait for it with `--wait 20m`; readers need not wait"),
            Self::Io { source, .. } => ("store_io", io_remedy(source)),
            Self::Table { verb: "read", .. } => (
                "store_table",
                "its log (`_delta_log` in the table's folder) may be truncated: restore the store from a backup; without \
                 one, remove it and run its logs again",
            ),
            Self::Table { .. } | Self::LogTable { .. } => {
                ("store_table", "is the disk full, or does another program write into this table?")
            }
            Self::LogDamaged { .. } => (
                "store_damaged",
                "restore this file, or the whole store, from a backup; data files are not affected",
            ),
            Self::Object(error) => (error.code(), error.remedy()),
            Self::Damaged { .. } => (
                "store_damaged",
                "restore this file from a backup; without one, remove the store and run its logs again",
            ),
            Self::Row(_) | Self::Arrow(_) | Self::Frame(_) => (
                "store_value",
                "was the table changed by another program? `freeplay store verify` shows details",
            ),
            Self::Parquet(_) => ("store_unreadable", "`freeplay store verify` lists the damaged files"),
        }
    }

    pub(crate) fn io(path: impl Into<PathBuf>, verb: &'static str) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.into();
        move |source| Self::Io { path, verb, source }
    }
}

fn io_remedy(error: &std::io::Error) -> &'static str {
    match error.kind() {
        ErrorKind::NotFound => {
            "list all missing files with `freeplay store verify` and restore them from a \
             backup"
        }
        ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem => {
            "this user may not read or write there: see the owner and mode of the folder, or name another one under \
             `[store]`"
        }
        ErrorKind::NotADirectory => "name a folder, not a file, as `path` under `[store]`",
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded => {
            "free space and run again; earlier results are intact"
        }
        // `EMFILE` and `ENFILE`, which `ErrorKind` does not know.
        _ if cfg!(unix) && matches!(error.raw_os_error(), Some(23 | 24)) => {
            "allow more open files (`ulimit -n 4096`), and run again"
        }
        _ => {
            "check the disk or the mount, and run again: the system could not read or write, which says nothing about \
             the content of the store"
        }
    }
}

/// The error of the system below an error of a library.
fn os_error(error: &(dyn std::error::Error + 'static)) -> Option<std::io::Error> {
    let below = std::iter::successors(Some(error), |error| error.source());
    below.map(ToString::to_string).find_map(|text| object_io::system_error(&text))
}

/// First line of the message. The libraries add the location in their own code, which does not help users.
fn first_line(error: &DeltaTableError) -> String {
    error.to_string().lines().next().unwrap_or_default().to_owned()
}

fn short(digest: &str) -> &str {
    digest.get(..12).unwrap_or(digest)
}

#[cfg(test)]
mod tests {
    use deltalake::logstore::object_store;

    use super::*;

    /// An NFS server that restarts gives `ESTALE`, a failing disk `EIO`: neither is damage, nor a reason to remove a table.
    /// Delta Lake takes a folder whose `stat` fails for one that does not exist; the parquet crate wraps the error of the
    /// system, or keeps its text alone.
    #[test]
    fn a_system_error_below_another_error_is_no_damage() {
        let os = |code| std::io::Error::from_raw_os_error(code);
        let table = |source| Error::Table { table: "gaps", verb: "read", source: Box::new(source) };
        let of_store = |code| {
            let source = Box::new(os(code));
            table(object_store::Error::Generic { store: "LocalFileSystem", source }.into())
        };
        let not_found = DeltaTableError::InvalidTableLocation("Invalid table location: /a".to_owned());
        let of_parquet = Error::Parquet(parquet::errors::ParquetError::External(Box::new(os(24))));
        let of_arrow = Error::Arrow(arrow::error::ArrowError::ParquetError(format!("External: {}", os(24))));
        assert!([&of_parquet, &of_arrow].iter().all(|error| error.code_and_remedy().1.contains("ulimit -n")));
        for error in [of_store(116), of_store(5), table(not_found), of_parquet, of_arrow] {
            let (code, remedy) = error.code_and_remedy();
            assert_eq!(code, "store_io");
            assert!(remedy.contains("run again") && !remedy.contains("remove"), "{remedy}");
        }
        let damage = parquet::errors::ParquetError::EOF("eof".to_owned());
        assert_eq!(Error::Parquet(damage).code_and_remedy().0, "store_unreadable");
    }
}
