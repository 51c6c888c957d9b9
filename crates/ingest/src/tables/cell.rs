//! Cells and headers of tables: names, numbers, instants, and the errors that name row and column.

use std::path::Path;
use std::str::FromStr;

use jiff::{Timestamp, civil, tz::TimeZone};

use crate::error::{Error, Fault};
use crate::mapping::column_pattern::nearest;

/// Standard names of columns: none of them is a misspelling of another.
const KNOWN: [&str; 12] = [
    "tail_number",
    "position",
    "part_number",
    "serial_number",
    "installed_utc",
    "removed_utc",
    "departure_utc",
    "flight_id",
    "flight_hours",
    "tail_hours_end",
    "gap_m",
    "date_utc",
];

/// A column that is not there, with the nearest that is, in a table whose names the configuration maps or not.
pub(super) fn missing(file: &Path, wanted: &str, header: &[String], is_mapped: bool) -> Error {
    // A column with a name of ours keeps its meaning.
    let others = header.iter().filter(|h| !KNOWN.contains(&h.trim()));
    let nearest = nearest(wanted, others.map(String::as_str));
    let hint = match (nearest, is_mapped) {
        (Some(near), true) => format!("`{near}`? A table may call its columns otherwise: see `[columns]`"),
        (None, true) => "map the column names under `[columns]` (docs/configuration.md)".to_owned(),
        (near, false) => {
            let near = near.map(|near| format!("`{near}`? ")).unwrap_or_default();
            format!("{near}docs/configuration.md has the names of this table's columns")
        }
    };
    Fault::new("bad_table", format!("the table has no column `{wanted}`"), hint).column(wanted).in_file(file)
}

/// Reads a name.
///
/// # Errors
/// When it is blank.
pub fn name<T: TryFrom<String, Error = records::ids::IdError>>(text: &str) -> Result<T, String> {
    T::try_from(text.to_owned()).map_err(|e| e.to_string())
}

/// Reads a finite number.
///
/// # Errors
/// When it is none.
pub fn number(text: &str) -> Result<f64, String> {
    match f64::from_str(text) {
        Ok(value) if value.is_finite() => Ok(value),
        _ if text.contains(',') => {
            Err(format!("`{text}` is not a number: write decimals with a point, such as 1168.5"))
        }
        _ => Err(format!("`{text}` is not a number")),
    }
}

/// Reads a finite number that is not below zero.
pub(crate) fn not_negative(text: &str) -> Result<f64, String> {
    number(text)
        .and_then(|value| if value < 0.0 { Err(format!("`{text}` is below zero")) } else { Ok(value) })
}

/// Parses an instant. A date, or a time without a zone, is UTC.
///
/// # Errors
/// When it is neither a date nor a time.
pub fn utc(text: &str) -> Result<Timestamp, String> {
    let civil = || text.parse::<civil::DateTime>().and_then(|civil| TimeZone::UTC.to_timestamp(civil));
    text.parse::<Timestamp>().or_else(|_| civil()).map_err(|_| not_utc(text))
}

/// Why a text is no instant: a day that no calendar has, or another form.
fn not_utc(text: &str) -> String {
    let is_date = |day: &str| {
        let digits = |part: &str, n: usize| part.len() == n && part.bytes().all(|b| b.is_ascii_digit());
        let parts: Vec<&str> = day.split('-').collect();
        matches!(parts[..], [year, month, day] if digits(year, 4) && digits(month, 2) && digits(day, 2))
    };
    match text.get(..10).filter(|day| is_date(day)) {
        Some(day) if day.parse::<civil::Date>().is_err() => format!("there is no day `{day}`"),
        _ => format!("`{text}` is not a UTC date or time such as 2026-11-19 or 2026-11-19T04:13:00Z"),
    }
}
