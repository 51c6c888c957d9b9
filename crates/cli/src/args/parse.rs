//! Parsers of option values.

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
