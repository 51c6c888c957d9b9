//! The tables a user gives beside the logs: read as text from CSV or Parquet, then checked cell by cell.
//!
//! Long ones are read in [`Chunk`]s, column by column.

mod chunk;

use std::collections::BTreeMap;
use std::path::Path;
use std::str::FromStr;

use arrow::array::RecordBatch;
use jiff::{Timestamp, civil, tz::TimeZone};
use records::{Installation, Installations};

pub use chunk::{Chunk, Chunks, Parted, Texts, chunks, trimmed};

use crate::error::{Error, Fault};
use crate::pattern::nearest;

/// A small table, every cell text; an empty cell is none.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    file: std::path::PathBuf,
    header: Vec<String>,
    rows: Vec<Vec<Option<String>>>,
    names: Names,
}

/// What a user's table calls the columns that we know: our name → theirs.
pub type Names = BTreeMap<String, String>;

/// Names that tables use for what they mean: none of them is another one misspelled.
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

impl Table {
    /// Reads a `.parquet` file as Parquet and anything else as CSV.
    ///
    /// # Errors
    /// When the file cannot be read, or is not the table its name says.
    pub fn read(file: &Path) -> Result<Self, Error> {
        let mut table = Self::empty(file);
        for chunk in chunks(file, None)? {
            table.extend(&chunk?)?;
        }
        Ok(table)
    }

    /// The same table from memory; `name` stands for its file in diagnostics.
    ///
    /// # Errors
    /// When a column is neither text, numbers nor times.
    pub fn of_batches(name: &Path, batches: &[RecordBatch]) -> Result<Self, Error> {
        let mut table = Self::empty(name);
        batches.iter().try_for_each(|batch| table.extend(&Chunk::new(name, batch.clone(), 0)))?;
        Ok(table)
    }

    fn empty(file: &Path) -> Self {
        Self { file: file.to_owned(), header: Vec::new(), rows: Vec::new(), names: Names::new() }
    }

    fn extend(&mut self, chunk: &Chunk) -> Result<(), Error> {
        self.header = chunk.header().to_vec();
        let columns = (0..self.header.len()).map(|column| chunk.texts(Some(column)));
        let columns = columns.collect::<Result<Vec<_>, _>>()?;
        let row = |row| columns.iter().map(|texts| texts.get(row).map(str::to_owned)).collect();
        self.rows.extend((0..chunk.len()).map(row));
        Ok(())
    }

    /// The same table, whose columns go by a user's own names.
    #[must_use]
    pub fn called(mut self, names: &Names) -> Self {
        self.names.clone_from(names);
        self
    }

    /// Rows without the header.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Whether there is no row.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Where a column stands, if it is there under one of its names.
    pub fn find(&self, names: &[&str]) -> Option<usize> {
        let theirs = |name: &str| self.names.get(name).map_or_else(|| name.to_owned(), Clone::clone);
        names.iter().find_map(|name| position(&self.header, &theirs(name)))
    }

    /// Where a column stands.
    ///
    /// # Errors
    /// When it is not there, with the nearest name that is.
    pub fn column(&self, names: &[&str]) -> Result<usize, Error> {
        let wanted = || self.names.get(names[0]).map_or(names[0], String::as_str);
        self.find(names).ok_or_else(|| missing(&self.file, wanted(), &self.header))
    }

    /// The text of a cell.
    pub fn text(&self, row: usize, column: usize) -> Option<&str> {
        self.rows[row].get(column)?.as_deref()
    }

    /// A cell that must hold something, read as `T`.
    ///
    /// # Errors
    /// When it is empty or cannot be read.
    pub fn required<T>(
        &self,
        row: usize,
        column: usize,
        read: impl Fn(&str) -> Result<T, String>,
    ) -> Result<T, Error> {
        let text = self.text(row, column).ok_or_else(|| self.error(row, column, "it is empty".into()))?;
        read(text).map_err(|detail| self.error(row, column, detail))
    }

    /// A cell of an optional column that may be empty.
    ///
    /// # Errors
    /// When it holds something that cannot be read.
    pub fn optional<T>(
        &self,
        row: usize,
        column: Option<usize>,
        read: impl Fn(&str) -> Result<T, String>,
    ) -> Result<Option<T>, Error> {
        let Some((column, text)) = column.and_then(|c| Some((c, self.text(row, c)?))) else {
            return Ok(None);
        };
        read(text).map(Some).map_err(|detail| self.error(row, column, detail))
    }

    fn error(&self, row: usize, column: usize, detail: String) -> Error {
        bad_cell(&self.file, row, self.header.get(column), detail)
    }
}

/// Where a header has a name.
fn position(header: &[String], name: &str) -> Option<usize> {
    header.iter().position(|h| h.trim() == name)
}

/// A column that is not there, with the nearest that is.
fn missing(file: &Path, wanted: &str, header: &[String]) -> Error {
    // A column that is one of ours already stands for what it says.
    let others = header.iter().filter(|h| !KNOWN.contains(&h.trim()));
    let nearest = nearest(wanted, others.map(String::as_str)).map(str::to_owned);
    Error::new(file, Fault::TableColumn { column: wanted.to_owned(), nearest })
}

/// A cell that is not what it should be; rows count from 0 here and from 1 for people.
fn bad_cell(file: &Path, row: usize, column: Option<&String>, detail: String) -> Error {
    Error::new(file, Fault::Table { row: Some(row as u64 + 1), column: column.cloned(), detail })
}

/// Reads the installations table: `tail_number, position, part_number, serial_number, installed_utc,
/// removed_utc` and optionally `unit_hours_at_install`, `tail_hours_at_install`.
///
/// # Errors
/// Every cell that cannot be read, or, when all can, every contradiction between rows.
pub fn installations(file: &Path, names: &Names) -> Result<Installations, Vec<Error>> {
    let table = Table::read(file).map_err(|e| vec![e])?.called(names);
    let columns = InstallationColumns::find(&table)?;
    let (mut rows, mut errors) = (Vec::new(), Vec::new());
    for row in 0..table.len() {
        match columns.installation(&table, row) {
            Ok(stay) => rows.push(stay),
            Err(error) => errors.push(error),
        }
    }
    if !errors.is_empty() {
        return Err(errors);
    }
    let contradiction = |e: records::installation::Error| {
        Error::new(file, Fault::Table { row: None, column: None, detail: e.to_string() })
    };
    Installations::new(rows).map_err(|found| found.into_iter().map(contradiction).collect())
}

struct InstallationColumns {
    names: [usize; 5],
    removed: Option<usize>,
    hours: [Option<usize>; 2],
}

impl InstallationColumns {
    fn find(table: &Table) -> Result<Self, Vec<Error>> {
        let wanted = ["tail_number", "position", "part_number", "serial_number", "installed_utc"];
        let found = wanted.map(|name| table.column(&[name]));
        if found.iter().any(Result::is_err) {
            return Err(found.into_iter().filter_map(Result::err).collect());
        }
        let names = found.map(Result::unwrap_or_default);
        let hours = ["unit_hours_at_install", "tail_hours_at_install"].map(|name| table.find(&[name]));
        Ok(Self { names, removed: table.find(&["removed_utc"]), hours })
    }

    fn installation(&self, table: &Table, row: usize) -> Result<Installation, Error> {
        let [tail, position, part, serial, installed] = self.names;
        Ok(Installation {
            tail_number: table.required(row, tail, name)?,
            position: table.required(row, position, name)?,
            part_number: table.required(row, part, name)?,
            serial_number: table.required(row, serial, name)?,
            installed_utc: table.required(row, installed, utc)?,
            removed_utc: table.optional(row, self.removed, utc)?,
            unit_hours_at_install: table.optional(row, self.hours[0], number)?,
            tail_hours_at_install: table.optional(row, self.hours[1], number)?,
        })
    }
}

/// Reads a name.
///
/// # Errors
/// When it is blank.
pub fn name<T: TryFrom<String, Error = records::ids::EmptyIdError>>(text: &str) -> Result<T, String> {
    T::try_from(text.to_owned()).map_err(|e| e.to_string())
}

/// Reads a finite number.
///
/// # Errors
/// When it is none.
pub fn number(text: &str) -> Result<f64, String> {
    match f64::from_str(text) {
        Ok(value) if value.is_finite() => Ok(value),
        _ => Err(format!("`{text}` is no number")),
    }
}

/// Reads an instant; in a column that says UTC, a date or a time without zone is UTC.
///
/// # Errors
/// When it is neither a date nor a time.
pub fn utc(text: &str) -> Result<Timestamp, String> {
    let civil = || {
        text.parse::<civil::DateTime>()
            .or_else(|e| text.parse::<civil::Date>().map(civil::DateTime::from).map_err(|_| e))
    };
    match text.parse::<Timestamp>() {
        Ok(instant) => Ok(instant),
        Err(_) => {
            let instant = civil().and_then(|civil| TimeZone::UTC.to_timestamp(civil));
            instant.map_err(|_| not_utc(text))
        }
    }
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
        _ => format!("`{text}` is no UTC date or time such as 2026-11-19 or 2026-11-19T04:13:00Z"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(text: &str) -> (tempfile::TempDir, std::path::PathBuf) {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("installations.csv");
        std::fs::write(&file, text).unwrap();
        (dir, file)
    }

    const HEADER: &str = "tail_number,position,part_number,serial_number,installed_utc,removed_utc\n";

    #[test]
    fn dates_in_a_utc_column_are_utc() {
        let (_dir, file) = table(&format!("\u{feff}{HEADER}N1,aileron,EMA,17,2026-01-01,2026-02-01 06:00\n"));
        let stays = installations(&file, &Names::new()).unwrap();
        let stay = stays.iter().next().unwrap();
        assert_eq!(stay.installed_utc.to_string(), "2026-01-01T00:00:00Z");
        assert_eq!(stay.removed_utc.unwrap().to_string(), "2026-02-01T06:00:00Z");
    }

    #[test]
    fn every_bad_cell_is_named_by_row_and_column() {
        let (_dir, file) =
            table(&format!("{HEADER}N1,aileron,EMA,,2026-01-01,\nN1,elevator,EMA,18,yesterday,\n"));
        let errors = installations(&file, &Names::new()).unwrap_err();
        let places: Vec<_> = errors.iter().map(|e| e.diagnostic().location().unwrap()).collect();
        assert_eq!(places, ["column `serial_number`, row 1", "column `installed_utc`, row 2"]);
    }

    #[test]
    fn a_missing_column_is_told_with_its_neighbour() {
        let (_dir, file) = table("tail_number,position,part_number,serial_no,installed_utc\n");
        let errors = installations(&file, &Names::new()).unwrap_err();
        assert!(errors[0].diagnostic().hint.unwrap().starts_with("`serial_no`?"));
    }
}
