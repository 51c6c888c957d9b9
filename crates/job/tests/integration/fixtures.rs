//! The flights of another engine in `tests/data/flights`.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use ingest::LogFiles;
use ingest::tables::ColumnAliases;
use job::{Config, FlightLog};
use records::{Diagnostic, Installations};

/// Their folder, with their configuration and installations table.
pub(crate) fn flights() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/flights")
}

/// Their installations.
static INSTALLATIONS: LazyLock<Installations> = LazyLock::new(|| {
    ingest::tables::installations(&flights().join("installations.csv"), &ColumnAliases::new()).unwrap()
});

/// One of their logs.
pub(crate) fn open<'c>(log: &str, config: &'c Config) -> Result<FlightLog<'c>, Diagnostic> {
    let file = LogFiles::one(flights().join(format!("{log}.parquet")));
    FlightLog::open(&file, log, config, &INSTALLATIONS)
}
