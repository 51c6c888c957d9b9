//! Errors that end a run; errors of single logs are in the run summary.

use records::Diagnostic;

/// Error that ends a run.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "each field is named for what it holds")]
pub enum Error {
    /// Configuration, tables or the request are wrong: nothing was processed.
    #[error("{} errors in configuration or tables", .0.len())]
    Refused(Vec<Diagnostic>),
    /// The store cannot be read or written: what was stored before is intact.
    #[error(transparent)]
    Store(#[from] store::Error),
    #[error(transparent)]
    Objects(#[from] object_io::Error),
    #[error("a trend cannot be stated: {0}")]
    Trend(#[from] trend::Error),
    #[error(transparent)]
    Page(#[from] ::report::Error),
    #[error("the report cannot be written to {}: {source}", .path.display())]
    Pages { path: std::path::PathBuf, source: std::io::Error },
    #[error("rows cannot be made: {0}")]
    Rows(#[from] arrow::error::ArrowError),
    #[error("the engine that does the logs failed: {0}")]
    Engine(String),
    #[error("the workers cannot be started: {0}")]
    Workers(#[from] rayon::ThreadPoolBuildError),
    #[error("a worker cannot be started: {0}")]
    Thread(std::io::Error),
}

impl From<records::row_schema::RowError> for Error {
    fn from(error: records::row_schema::RowError) -> Self {
        Self::Store(error.into())
    }
}

impl From<ingest::Error> for Error {
    fn from(error: ingest::Error) -> Self {
        Self::refused(error.diagnostic())
    }
}

impl Error {
    pub(crate) fn refused(diagnostic: Diagnostic) -> Self {
        Self::Refused(vec![diagnostic])
    }
}

/// Whether the cause of a log's error may pass without a change of the log or a setting: each run tries the log again.
pub(crate) fn is_passing(code: &str) -> bool {
    ["log_timeout", "departure_ahead"].contains(&code)
        || is_unlisted(code)
        || ingest::is_passing(code)
        || object_io::Error::is_passing(code)
}

/// Whether an error is of a path that cannot be listed: each run lists it again, and reports it again.
pub(crate) fn is_unlisted(code: &str) -> bool {
    ["folder_unreadable", "file_unreadable", "table_unreadable", "table_unsupported"].contains(&code)
}
