//! The tables a user gives beside the logs: read as text from CSV or Parquet, then checked cell by cell.

use std::collections::BTreeMap;
use std::io::Read;
use std::path::Path;
use std::str::FromStr;

use arrow::array::{Array, AsArray, RecordBatch};
use arrow::compute::cast;
use arrow::datatypes::DataType;
use fleet::{Installation, Installations};
use jiff::{Timestamp, civil, tz::TimeZone};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;

use crate::error::{Error, Fault};
use crate::pattern::nearest;
use crate::source::whole;

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
        let parquet = file.extension().is_some_and(|e| e.eq_ignore_ascii_case("parquet"));
        let (header, rows) =
            if parquet { read_parquet(file) } else { read_csv(file) }.map_err(|f| Error::new(file, f))?;
        Ok(Self { file: file.to_owned(), header, rows, names: Names::new() })
    }

    /// The same table from memory; `name` stands for its file in complaints.
    ///
    /// # Errors
    /// When a column is neither text, numbers nor times.
    pub fn of_batches(name: &Path, batches: &[RecordBatch]) -> Result<Self, Error> {
        let header = batches.first().map(header).unwrap_or_default();
        let rows = batches.iter().map(texts).collect::<Result<Vec<_>, _>>();
        let rows = rows.map_err(|f| Error::new(name, f))?.into_iter().flatten().collect();
        Ok(Self { file: name.to_owned(), header, rows, names: Names::new() })
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
        names.iter().find_map(|name| self.header.iter().position(|h| h.trim() == theirs(name)))
    }

    /// Where a column stands.
    ///
    /// # Errors
    /// When it is not there, with the nearest name that is.
    pub fn column(&self, names: &[&str]) -> Result<usize, Error> {
        self.find(names).ok_or_else(|| {
            let wanted = self.names.get(names[0]).map_or(names[0], String::as_str);
            // A column that is one of ours already stands for what it says.
            let others = self.header.iter().filter(|h| !KNOWN.contains(&h.trim()));
            let nearest = nearest(wanted, others.map(String::as_str)).map(str::to_owned);
            Error::new(&self.file, Fault::TableColumn { column: wanted.to_owned(), nearest })
        })
    }

    /// The text of a cell.
    pub fn text(&self, row: usize, column: usize) -> Option<&str> {
        self.rows[row].get(column)?.as_deref().map(str::trim).filter(|t| !t.is_empty())
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
        let column = self.header.get(column).cloned();
        Error::new(&self.file, Fault::Table { row: Some(row as u64 + 1), column, detail })
    }
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
    let contradiction = |e: fleet::installation::Error| {
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
pub fn name<T: TryFrom<String, Error = fleet::ids::EmptyName>>(text: &str) -> Result<T, String> {
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

type Cells = (Vec<String>, Vec<Vec<Option<String>>>);

fn read_csv(file: &Path) -> Result<Cells, Fault> {
    let bad = |e: &csv::Error| {
        let row = e.position().map(csv::Position::record);
        Fault::Table { row, column: None, detail: e.to_string() }
    };
    let mut text = Vec::new();
    whole(file)?.read_to_end(&mut text).map_err(|source| Fault::Unreadable { source })?;
    // Spreadsheets open their UTF-8 with a byte order mark.
    let text = text.strip_prefix("\u{feff}".as_bytes()).unwrap_or(&text);
    let mut reader = csv::ReaderBuilder::new().comment(Some(b'#')).trim(csv::Trim::All).from_reader(text);
    let header = reader.headers().map_err(|e| bad(&e))?.iter().map(str::to_owned).collect();
    let mut rows = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|e| bad(&e))?;
        rows.push(record.iter().map(|cell| (!cell.is_empty()).then(|| cell.to_owned())).collect());
    }
    Ok((header, rows))
}

fn read_parquet(file: &Path) -> Result<Cells, Fault> {
    let torn = |e: String| Fault::NotParquet { detail: e };
    let reader = ParquetRecordBatchReaderBuilder::try_new(whole(file)?).map_err(|e| torn(e.to_string()))?;
    let header: Vec<String> = reader.schema().fields().iter().map(|f| f.name().clone()).collect();
    let mut rows: Vec<Vec<Option<String>>> = Vec::new();
    for batch in reader.build().map_err(|e| torn(e.to_string()))? {
        rows.extend(texts(&batch.map_err(|e| torn(e.to_string()))?)?);
    }
    Ok((header, rows))
}

fn header(batch: &RecordBatch) -> Vec<String> {
    batch.schema_ref().fields().iter().map(|f| f.name().clone()).collect()
}

/// The cells of a batch, row by row.
fn texts(batch: &RecordBatch) -> Result<Vec<Vec<Option<String>>>, Fault> {
    let text = |(name, array): (&String, &arrow::array::ArrayRef)| {
        cast(array, &DataType::Utf8).map_err(|_| Fault::ColumnType {
            column: name.clone(),
            found: array.data_type().to_string(),
            wanted: "text, numbers or times",
        })
    };
    let columns = header(batch).iter().zip(batch.columns()).map(text).collect::<Result<Vec<_>, _>>()?;
    let cell = |column: &arrow::array::ArrayRef, row| {
        let column = column.as_string::<i32>();
        column.is_valid(row).then(|| column.value(row).to_owned())
    };
    Ok((0..batch.num_rows()).map(|row| columns.iter().map(|c| cell(c, row)).collect()).collect())
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
        let places: Vec<_> = errors.iter().map(|e| e.complaint().place().unwrap()).collect();
        assert_eq!(places, ["column `serial_number`, row 1", "column `installed_utc`, row 2"]);
    }

    #[test]
    fn a_missing_column_is_told_with_its_neighbour() {
        let (_dir, file) = table("tail_number,position,part_number,serial_no,installed_utc\n");
        let errors = installations(&file, &Names::new()).unwrap_err();
        assert!(errors[0].complaint().hint.unwrap().starts_with("`serial_no`?"));
    }
}
