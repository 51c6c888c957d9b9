//! Why a log or a table cannot be used: a stable code, the place, what was found and what to do.
//!
//! A cause that one place finds is described there; causes that several places find are described here.

use std::fmt::{self, Display};
use std::io;
use std::path::Path;

use records::Diagnostic;

use crate::io::retry;
use crate::mapping::column_pattern::{PLACEHOLDER, nearest};

/// Code of a read that failed for a cause which may pass by itself.
const READ_FAILED: &str = "read_failed";

/// Code of a file that the system does not open or read, because of permissions for one.
const UNREADABLE: &str = "unreadable";

/// Code of a column that holds more or fewer samples than its table.
const ROW_COUNT_DIFFERS: &str = "row_count_differs";

/// Whether an error of this code may pass within seconds, so that the log is worth another attempt at once.
pub fn is_transient(code: &str) -> bool {
    code == READ_FAILED
}

/// Whether an error of this code may pass although the log stays as it is, so that each run tries it again: the system
/// did not return the content.
pub fn is_passing(code: &str) -> bool {
    is_transient(code) || code == UNREADABLE
}

/// One file's trouble.
#[derive(Debug)]
pub struct Error(Box<Diagnostic>);

impl Error {
    /// The form in which people and scripts see it.
    pub fn diagnostic(&self) -> Diagnostic {
        self.0.as_ref().clone()
    }

    pub(crate) fn is_row_count(&self) -> bool {
        self.0.code == ROW_COUNT_DIFFERS
    }
}

impl Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.0.file.as_deref().unwrap_or_default(), self.0.message)
    }
}

impl std::error::Error for Error {}

/// An [`Error`] before its file is known. Rows of a log count from 0, rows of a table from 1.
#[derive(Debug)]
pub(crate) struct Fault(pub(crate) Box<Diagnostic>);

impl Fault {
    pub(crate) fn new(code: &str, message: impl Display, hint: impl Display) -> Self {
        Self(Box::new(Diagnostic::new(code, message).hint(hint)))
    }

    pub(crate) fn column(mut self, column: &str) -> Self {
        self.0.column = Some(column.to_owned());
        self
    }

    pub(crate) fn row(mut self, row: u64) -> Self {
        self.0.row = Some(row);
        self
    }

    pub(crate) fn found(mut self, found: impl Display) -> Self {
        self.0.found = Some(found.to_string());
        self
    }

    pub(crate) fn expected(mut self, expected: impl Display) -> Self {
        self.0.expected = Some(expected.to_string());
        self
    }

    pub(crate) fn in_file(self, file: &Path) -> Error {
        Error(Box::new(self.0.in_file(file.display())))
    }
}

/// Reworded for the usual errors of the system.
impl From<io::Error> for Fault {
    fn from(source: io::Error) -> Self {
        let other = || format!("the file cannot be read: {source}");
        let (message, hint) = match source.kind() {
            io::ErrorKind::NotFound => {
                ("no such file".into(), "check the name, and that the disk or share is mounted")
            }
            io::ErrorKind::PermissionDenied => (
                "permission denied".into(),
                "run as a user with read access, or change the file mode; the next run tries again",
            ),
            io::ErrorKind::IsADirectory => (
                "this is a folder, not a file".into(),
                "name the file, or the files in it: `FOLDER/*.parquet`",
            ),
            _ if retry::is_file_limit(&source) => {
                (other(), "allow more open files (`ulimit -n 4096`); the next run tries again")
            }
            _ => (other(), "check the disk or share; the next run tries again"),
        };
        Self::new(if retry::is_transient(&source) { READ_FAILED } else { UNREADABLE }, message, hint)
    }
}

impl From<object_io::Error> for Fault {
    fn from(source: object_io::Error) -> Self {
        Self::new(source.code(), &source, source.remedy())
    }
}

/// A file that the Parquet parser refuses; a failed read, if the parser's message contains one.
pub(crate) fn not_parquet(detail: impl Into<String>) -> Fault {
    let detail = detail.into();
    let hint = "copy the file again, or exclude it in `logs.files`; then `freeplay run --retry`";
    let of_parser = || Fault::new("not_parquet", format!("cannot read as Parquet: {detail}"), hint);
    object_io::system_error(&detail).map_or_else(of_parser, Fault::from)
}

const CORRUPT: &str = "the file is corrupt: fetch it again from the recorder, then `freeplay run --retry`";

/// A column chunk that cannot be decoded; a failed read, if `detail` contains one.
pub(crate) fn decode_failed(column: &str, row_group: usize, detail: &str) -> Fault {
    if let Some(failed_read) = object_io::system_error(detail) {
        return failed_read.into();
    }
    let message = format!("a column cannot be decoded: {detail}");
    let mut fault = Fault::new("decode_failed", message, CORRUPT).column(column);
    fault.0.row_group = Some(row_group as u64);
    fault
}

pub(crate) fn row_count(column: &str, found: usize, declared: usize) -> Fault {
    let message = format!("the column holds {found} rows where the footer declares {declared}");
    Fault::new(ROW_COUNT_DIFFERS, message, CORRUPT).column(column)
}

pub(crate) fn encrypted(column: Option<&str>) -> Fault {
    let hint = "have it decrypted before it arrives here: keys of encrypted Parquet files are not supported";
    match column {
        Some(column) => Fault::new("encrypted", format!("column `{column}` is encrypted"), hint),
        None => Fault::new("encrypted", "the file is encrypted", hint),
    }
}

/// A column that a log lacks, with the nearest of the known names.
pub(crate) fn column_missing<'n>(column: &str, known: impl IntoIterator<Item = &'n str>) -> Fault {
    let hint = match nearest(column, known) {
        None => MAPPED_UNDER.to_owned(),
        Some(near) => match hidden_difference(column, near) {
            Some(characters) => format!("`{near}`? {characters}"),
            None => format!("`{near}`? Names are mapped under `[channel]`, `[clock]` and `[identity]`"),
        },
    };
    Fault::new("column_missing", format!("the log has no column `{column}`"), hint).column(column)
}

const MAPPED_UNDER: &str = "names are mapped under `[channel]`, `[clock]` and `[identity]`";

/// How the type of a column of structs begins.
pub(crate) const STRUCT: &str = "a struct of ";

pub(crate) fn column_type(column: &str, found: &str, wanted: &str) -> Fault {
    let hint = if found.starts_with(STRUCT) {
        format!("name a field of it, as in `{column}.FIELD` (`freeplay check` lists them)")
    } else {
        "map another column, or have the recorder write numbers".to_owned()
    };
    Fault::new("column_type", format!("column `{column}` holds {found}, not {wanted}"), hint).column(column)
}

pub(crate) fn list_lengths(column: &str, other: &str) -> Fault {
    let hint = "if the channel has timestamps of its own, name them in its `time_column`; else all lists of a row must hold as many samples";
    Fault::new("list_lengths", format!("the lists in `{column}` and `{other}` differ in length"), hint)
        .column(column)
}

pub(crate) fn channel_empty(column: &str, rows: usize) -> Fault {
    let hint = "check the sensor, or map the redundant channel";
    Fault::new("channel_empty", format!("column `{column}` holds no value in {rows} rows"), hint)
        .column(column)
}

pub(crate) fn time_unit_unknown(column: &str, found: &str) -> Fault {
    let message = format!("the unit of the time column `{column}` is not known");
    Fault::new("time_unit_unknown", message, "set `clock.unit` to s, ms, us or ns")
        .column(column)
        .found(found)
        .expected("`clock.unit` = \"s\", \"ms\", \"us\", \"ns\", or \"count\" with `clock.rate_hz`")
}

pub(crate) fn time_text_unknown(column: &str, found: &str) -> Fault {
    let message = format!("the time column `{column}` holds a text that is no ISO 8601 time");
    let hint = "convert it to timestamps, or map another clock by `clock.column`";
    let expected = "2026-11-19T04:13:00Z, or 04:13:00 with `clock.epoch` = \"midnight\"";
    Fault::new("time_unit_unknown", message, hint).column(column).found(found).expected(expected)
}

/// A fact for which no source was found in the `looked` places.
pub(crate) fn identity_missing(fact: &str, looked: &[String]) -> Fault {
    let looked = if looked.is_empty() {
        "nowhere: `[identity]` has no source for it".into()
    } else {
        looked.join(", ")
    };
    let hint = "set its source under `[identity]`: `metadata`, `columns` or `path`";
    Fault::new("identity_missing", format!("cannot determine {fact} for this log"), hint)
        .found(format!("looked in {looked}"))
}

pub(crate) fn identity_invalid(fact: &str, found: &dyn Display, detail: &dyn Display) -> Fault {
    let hint = if fact.ends_with("_utc") {
        "see `identity.departure_format` and `identity.time_zone`".to_owned()
    } else {
        format!("check this value, and where `[identity]` takes the {fact} from")
    };
    Fault::new("identity_invalid", format!("`{found}` is no {fact}: {detail}"), hint)
}

#[expect(clippy::needless_pass_by_value, reason = "`map_err` passes the error")]
pub(crate) fn bad_table(detail: impl ToString) -> Fault {
    let hint =
        "columns and formats: docs/configuration.md (tables of the fleet), docs/columns.md (estimates)";
    let detail = detail.to_string();
    Fault::new("bad_table", format!("the table cannot be used: {detail}"), hint)
}

pub(crate) fn no_position(pattern: &str, columns: &[String]) -> Fault {
    let hint = if pattern.contains('{') && !pattern.contains(PLACEHOLDER) {
        format!("the placeholder of the position is {PLACEHOLDER}")
    } else if let Some(near) = closest_to_pattern(pattern, columns) {
        let hidden = hidden_difference(&pattern.replace(PLACEHOLDER, ""), near);
        let hidden = hidden.map(|hidden| format!(" {hidden}.")).unwrap_or_default();
        format!(
            "closest column: `{near}`.{hidden} Fix `column` under `[channel]`: {PLACEHOLDER} stands for the position"
        )
    } else {
        MAPPED_UNDER.to_owned()
    };
    Fault::new("no_position", format!("no column matches `{pattern}`"), hint)
        .found(format!("columns {}", shortened(columns)))
}

/// The column that shares the longest beginning and end with a pattern, and of those the most similar one.
fn closest_to_pattern<'c>(pattern: &str, columns: &'c [String]) -> Option<&'c String> {
    let (before, after) = pattern.split_once(PLACEHOLDER).unwrap_or((pattern, ""));
    let common = |(a, b): &(char, char)| a == b;
    let shared = |column: &str| {
        let start = before.chars().zip(column.chars()).take_while(common).count();
        start + after.chars().rev().zip(column.chars().rev()).take_while(common).count()
    };
    let scored = columns.iter().map(|name| (shared(name), strsim::jaro_winkler(pattern, name), name));
    let best = scored.max_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    best.map(|(_, _, name)| name)
}

/// How two names differ that look equal: by the code points of their characters beyond ASCII.
fn hidden_difference(wanted: &str, found: &str) -> Option<String> {
    let points = |name: &str| {
        let beyond = name.chars().filter(|c| !c.is_ascii() || c.is_ascii_control());
        let points: Vec<String> = beyond.map(|c| format!("U+{:04X}", u32::from(c))).collect();
        if points.is_empty() { "no such character".to_owned() } else { points.join(" ") }
    };
    let looks = |name: &str| -> String {
        name.chars().filter(char::is_ascii_alphanumeric).map(|c| c.to_ascii_lowercase()).collect()
    };
    let (a, b) = (looks(wanted), looks(found));
    let is_alike = b.contains(&a) || strsim::levenshtein(&a, &b) <= 2;
    let has_hidden = [wanted, found].iter().any(|name| !name.is_ascii() || name.contains(char::is_control));
    (is_alike && has_hidden && points(wanted) != points(found)).then(|| {
        format!(
            "The names differ in characters that look equal or are invisible: {} in the log, {} in the configuration",
            points(found),
            points(wanted)
        )
    })
}

/// A list a person can take in: the first eight, and how many more there are.
fn shortened(names: &[String]) -> String {
    const SHOWN: usize = 8;
    let head = names.iter().take(SHOWN).map(|n| format!("`{n}`")).collect::<Vec<_>>().join(", ");
    match names.len().saturating_sub(SHOWN) {
        0 if head.is_empty() => "nothing".into(),
        0 => head,
        more => format!("{head} and {more} more"),
    }
}
