//! Options that several commands share, and the parsers of option values.

use std::path::PathBuf;

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args as ClapArgs, ValueEnum};
use ingest::parquet::writer::Encoding;
use jiff::Timestamp;
use pipeline::State;

use crate::completion;

/// Selection of units.
#[derive(Debug, Clone, ClapArgs)]
#[command(next_help_heading = "Selection")]
pub(crate) struct UnitFilterArgs {
    /// Only units on this tail.
    #[arg(long, add = completion::of("tail_number"))]
    pub tail: Option<String>,
    /// Only this unit.
    #[arg(long, add = completion::of("serial_number"))]
    pub serial: Option<String>,
    /// Only this part number.
    #[arg(long, add = completion::of("part_number"))]
    pub part: Option<String>,
}

/// Range of departures.
#[derive(Debug, Clone, ClapArgs)]
#[command(next_help_heading = "Selection")]
pub(crate) struct DepartureArgs {
    /// Only departures at or after this UTC time.
    #[arg(long, value_parser = parse_utc, value_name = "UTC")]
    pub since: Option<Timestamp>,
    /// Only departures before this UTC time.
    #[arg(long, value_parser = parse_utc, value_name = "UTC")]
    pub until: Option<Timestamp>,
}

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

pub(super) fn parse_utc(text: &str) -> Result<Timestamp, String> {
    ingest::tables::utc(text)
}

pub(super) fn parse_count(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(0) | Err(_) => Err(format!("`{text}` is not a number of at least 1")),
        Ok(count) => Ok(count),
    }
}

pub(super) fn parse_workers(text: &str) -> Result<u16, String> {
    match text.parse() {
        Ok(0) | Err(_) => Err(format!("`{text}` is not a number of workers from 1 to {}", u16::MAX)),
        Ok(count) => Ok(count),
    }
}

pub(super) fn parse_limit(text: &str) -> Result<f64, String> {
    let limit_m = text.parse().map_err(|_| format!("`{text}` is not a length in metres such as 150e-6"))?;
    job::config::limits::plausible_limit_m(limit_m)
}

pub(super) fn parse_span(text: &str) -> Result<std::time::Duration, String> {
    let span: jiff::SignedDuration =
        text.parse().map_err(|_| format!("`{text}` is not a duration with its unit, such as 20m or 30h"))?;
    span.try_into().map_err(|_| format!("`{text}` is negative"))
}

/// The states that can make a run fail.
pub(super) fn state_parser() -> impl TypedValueParser<Value = State> {
    PossibleValuesParser::new(["watch", "unassessed", "plan", "act"]).try_map(|word| word.parse::<State>())
}

pub(super) fn encoding_parser() -> impl TypedValueParser<Value = Encoding> {
    let encoding = |word: String| if word == "compatible" { Encoding::Compatible } else { Encoding::Split };
    PossibleValuesParser::new(["split", "compatible"]).map(encoding)
}
