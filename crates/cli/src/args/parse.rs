//! Parsers of option values, and the words that `query` takes.

use clap::ValueEnum;
use jiff::Timestamp;

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

/// Fields by which records can be selected.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum QueryKey {
    /// Tail number.
    Tail,
    /// Serial number.
    Serial,
    /// Flight.
    Flight,
    /// Installed position.
    Position,
}

impl QueryKey {
    /// Its column of the records.
    pub(crate) fn column(self) -> &'static str {
        match self {
            Self::Tail => "tail_number",
            Self::Serial => "serial_number",
            Self::Flight => "flight_id",
            Self::Position => "position",
        }
    }
}
