//! Options for the format and destination of rows.

use std::path::PathBuf;

use clap::{Args as ClapArgs, ValueEnum};

/// Format and destination of rows.
#[derive(Debug, Clone, ClapArgs)]
#[command(next_help_heading = "Output")]
pub(crate) struct RowFormatArgs {
    /// Output format.
    #[arg(long, value_enum, default_value_t = Format::Table)]
    pub format: Format,
    /// Same as --format json.
    #[arg(long, conflicts_with = "format")]
    pub json: bool,
    /// Write to FILE instead of stdout.
    #[arg(long, short, value_name = "FILE")]
    pub output: Option<PathBuf>,
}

impl RowFormatArgs {
    /// Selected format.
    pub(crate) fn format(&self) -> Format {
        if self.json { Format::Json } else { self.format }
    }
}

/// Row formats.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Format {
    /// Human-readable table: µm, flight hours, dates.
    Table,
    /// JSON array of objects, SI.
    Json,
    /// One JSON object per line, SI.
    Jsonl,
    /// CSV with a header, SI.
    Csv,
    /// Parquet, SI.
    Parquet,
}
