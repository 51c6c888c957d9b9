//! Files with the rows of several flights: which flights a file holds, and which rows are of one.
//!
//! Each flight of such a file is a log of its own. Its path is that of the file, with the texts of its identity columns:
//! `logs/2026-11-19.parquet#N412FP/FL0123`.

use std::path::{Path, PathBuf};

use percent_encoding::{AsciiSet, CONTROLS, percent_decode_str, utf8_percent_encode};

use crate::error::Error;
use crate::log::row_partition::DistinctTexts;
use crate::mapping::{IdentityField, IdentityMapping};
use crate::parquet::log_file::LogFile;

/// Fields that tell one flight from another, in the order of their texts in a path.
const FIELDS: [IdentityField; 4] = [
    IdentityField::TailNumber,
    IdentityField::FlightId,
    IdentityField::DepartureUtc,
    IdentityField::LandingUtc,
];

/// Separates the texts from the path of the file.
const MARK: char = '#';

/// Characters of a text that a path writes as `%` and two digits.
const ESCAPED: &AsciiSet = &CONTROLS.add(b'%').add(b'#').add(b'/').add(b'\\');

/// The columns that tell the flights of a file apart; none where a file holds one flight.
pub fn flight_columns(mapping: &IdentityMapping) -> Vec<&str> {
    let columns = FIELDS.iter().filter_map(|field| mapping.columns.get(field));
    columns.map(String::as_str).filter(|_| mapping.by_row).collect()
}

/// The file of a path, and the columns and texts that mark the rows of the flight; none where all of its rows are meant.
pub fn split_path(path: &Path, mapping: &IdentityMapping) -> (PathBuf, Vec<(String, String)>) {
    let columns = flight_columns(mapping);
    let parts = path.to_str().and_then(|path| path.rsplit_once(MARK)).filter(|_| !columns.is_empty());
    let Some((file, texts)) = parts else { return (path.to_owned(), Vec::new()) };
    let texts: Vec<_> = texts.split('/').map(|text| percent_decode_str(text).decode_utf8_lossy()).collect();
    if texts.len() != columns.len() {
        return (path.to_owned(), Vec::new());
    }
    let rows = columns.into_iter().zip(texts).map(|(column, text)| (column.to_owned(), text.into_owned()));
    (PathBuf::from(file), rows.collect())
}

/// The paths of the flights in a file, in order of their texts; the path itself where the file holds one flight, or lacks
/// a column that tells flights apart. A row without one of these texts is of no flight.
///
/// Row groups that hold one flight by their statistics are not read; of the others only the identity columns.
///
/// # Errors
/// When the file cannot be read.
pub fn flights_in(path: &Path, mapping: &IdentityMapping) -> Result<Vec<PathBuf>, Error> {
    let columns = flight_columns(mapping);
    let whole = || Ok(vec![path.to_owned()]);
    if columns.is_empty() || !split_path(path, mapping).1.is_empty() {
        return whole();
    }
    let file = LogFile::open(path)?;
    if !columns.iter().all(|column| file.has(column)) {
        return whole();
    }
    let mut distinct = DistinctTexts::default();
    distinct.take_file(&file, &columns)?;
    if distinct.found.is_empty() {
        return whole();
    }
    let escaped = |text: &String| utf8_percent_encode(text, ESCAPED).to_string();
    let path_of = |texts: &Vec<String>| {
        let texts: Vec<String> = texts.iter().map(escaped).collect();
        let mut whole = path.as_os_str().to_owned();
        whole.push(format!("{MARK}{}", texts.join("/")));
        PathBuf::from(whole)
    };
    Ok(distinct.found.iter().map(path_of).collect())
}
