//! Parsers of option values, and the words that `query` takes.

use clap::builder::{PossibleValuesParser, TypedValueParser};
use ingest::parquet::writer::Encoding;
use jiff::Timestamp;
use pipeline::State;

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

/// The words by which `query` selects records, each with its column.
pub(crate) const QUERY_KEYS: [(&str, &str); 4] =
    [("tail", "tail_number"), ("serial", "serial_number"), ("flight", "flight_id"), ("position", "position")];
