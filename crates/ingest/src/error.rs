//! Why a log or a table cannot be used: a stable code, the place, what was found and what to do.

use std::io;
use std::path::{Path, PathBuf};

use records::Diagnostic;
use strum::EnumMessage;

use crate::bounds::Excess;
use crate::io::transient;
use crate::mapping::column_pattern::PLACEHOLDER;

/// Code of a read that failed for a cause which may pass by itself.
const READ_FAILED: &str = "read_failed";

/// Code of a file that the system does not open or read, because of permissions for one.
const UNREADABLE: &str = "unreadable";

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
#[derive(Debug, thiserror::Error)]
#[error("{}: {kind}", file.display())]
pub struct Error {
    file: PathBuf,
    #[source]
    pub(crate) kind: Box<ErrorKind>,
}

impl Error {
    /// A failed read in place of what a parser made of it.
    pub(crate) fn new(file: &Path, kind: ErrorKind) -> Self {
        let failed_read = match &kind {
            ErrorKind::NotParquet { detail } | ErrorKind::Decode { detail, .. } => {
                object_io::system_error(detail)
            }
            _ => None,
        };
        let kind = failed_read.map_or(kind, |source| ErrorKind::Unreadable { source });
        Self { file: file.to_owned(), kind: Box::new(kind) }
    }

    /// The form in which people and scripts see it.
    pub fn diagnostic(&self) -> Diagnostic {
        self.kind.diagnostic().in_file(self.file.display())
    }
}

/// Kind of an error: one variant for each different remedy.
///
/// The name of a variant is its code where no other is given; its message is the remedy. Rows count from 0.
#[derive(Debug, thiserror::Error, strum::IntoStaticStr, strum::EnumMessage)]
#[strum(serialize_all = "snake_case")]
pub(crate) enum ErrorKind {
    #[error("{}", unreadable(source).0)]
    Unreadable {
        #[from]
        source: io::Error,
    },
    #[error(transparent)]
    Object(#[from] object_io::Error),
    #[error("the log has no rows")]
    #[strum(
        serialize = "empty_log",
        message = "file is empty; delete it or ignore it. It is skipped until it changes"
    )]
    Empty,
    #[error("cannot read as Parquet: {detail}")]
    #[strum(message = "copy the file again, or exclude it in `logs.files`; then `freeplay run --retry`")]
    NotParquet { detail: String },
    #[error("this is {format}, not a Parquet file")]
    #[strum(
        serialize = "not_parquet",
        message = "convert it to Parquet (docs/convert-logs.md), or exclude it in `logs.files`"
    )]
    ForeignFormat { format: &'static str },
    #[error(transparent)]
    #[strum(
        message = "the file is damaged or made to exhaust memory: fetch it again, or exclude it in `logs.files` (docs/limits.md)"
    )]
    BeyondLimit(#[from] Excess),
    #[error("{}", match column { Some(column) => format!("column `{column}` is encrypted"), None => "the file is encrypted".into() })]
    #[strum(
        message = "have it decrypted before it arrives here: keys of encrypted Parquet files are not supported"
    )]
    Encrypted { column: Option<String> },
    #[error("the file uses the encoding {encoding}, which is not supported")]
    #[strum(
        message = "have the recorder write PLAIN, BYTE_STREAM_SPLIT or dictionary encoding, or rewrite the file with the tool that wrote it"
    )]
    EncodingUnsupported { encoding: String },
    #[error("the log has {count} columns called `{column}`")]
    #[strum(message = "give each column a name of its own where the file is written, or map another column")]
    DuplicateColumn { column: String, count: usize },
    #[error("a column cannot be decoded: {detail}")]
    #[strum(serialize = "decode_failed")]
    Decode { column: String, row_group: Option<u64>, detail: String },
    #[error("the column holds {found} rows where the footer declares {declared}")]
    #[strum(serialize = "row_count_differs")]
    RowCount { column: String, found: u64, declared: u64 },
    #[error("the log has no column `{column}`")]
    ColumnMissing { column: String, nearest: Option<String> },
    #[error("no file of group `{group}` belongs to this flight")]
    #[strum(
        message = "check that the file has arrived and has the same tail and flight (see `freeplay check`)"
    )]
    GroupMissing { group: String },
    #[error("the lists in `{column}` and `{other}` differ in length")]
    #[strum(
        message = "if the channel has timestamps of its own, name them in its `time_column`; else all lists of a row must hold as many samples"
    )]
    ListLengths { column: String, other: String },
    #[error("the clocks `{column}` and `{other}` cannot be brought together")]
    #[strum(
        message = "both must be instants, or both numbers from the same zero: see `clock.epoch` and `identity.time_zone`"
    )]
    ClocksDiffer { column: String, other: String },
    #[error("normalized log was written with other settings: {detail}")]
    #[strum(
        serialize = "normalized_otherwise",
        message = "write it again from the recorded log: `freeplay normalize`"
    )]
    Normalized { detail: String },
    #[error("the file notes {key} {noted} for column `{column}`, and the mapping has {known}")]
    MetadataContradicts { column: String, key: &'static str, noted: String, known: String },
    #[error("column `{column}` holds {found}, not {wanted}")]
    #[strum(message = "map another column, or have the recorder write numbers")]
    ColumnType { column: String, found: String, wanted: &'static str },
    #[error("no column matches `{pattern}`")]
    NoPosition { pattern: String, columns: Vec<String> },
    #[error("the unit of the time column `{column}` is not known")]
    #[strum(serialize = "time_unit_unknown", message = "set `clock.unit` to s, ms, us or ns")]
    TimeUnit { column: String, found: String },
    #[error("the log has no clock: neither `clock.column` nor `clock.rate_hz` is given")]
    #[strum(message = "name the time column, or give the rate when rows are evenly spaced")]
    NoClock,
    #[error("time runs backwards")]
    #[strum(
        message = "if the file joins several recordings, set `clock.split_at_jumps = true`; if a counter starts again, set `clock.wraps_at` to the value at which it does"
    )]
    TimeGoesBack { column: String, row: u64, before_s: f64, after_s: f64, max_back_s: f64, times: u64 },
    #[error("the log seems to hold two flights")]
    #[strum(
        message = "write each flight to a file of its own, or name the column with the flight or the departure in `identity.columns`; if it is one flight, raise `clock.max_gap_s`"
    )]
    SeveralFlights { column: String, row: u64, before_s: f64, after_s: f64, end_s: f64, max_gap_s: f64 },
    #[error("timestamps give {seen_hz} Hz but `clock.rate_hz` = {declared_hz}")]
    #[strum(message = "check `clock.unit`; omit `clock.rate_hz` to use the rate of the timestamps")]
    RateContradicts { column: String, declared_hz: f64, seen_hz: f64 },
    #[error("the clock is not plausible: {what} is {value_s:e} s")]
    #[strum(message = "check `clock.column` and `clock.unit`, and that the file is intact")]
    TimeImplausible { column: String, what: &'static str, value_s: f64, least_s: f64, most_s: f64 },
    #[error("time does not advance")]
    #[strum(message = "map the column with the time, or give only `clock.rate_hz`")]
    TimeStandsStill { column: String, rows: u64 },
    #[error("column `{column}` holds no value in {rows} rows")]
    #[strum(serialize = "channel_empty", message = "check the sensor, or map the redundant channel")]
    AllMissing { column: String, rows: u64 },
    #[error(
        "column `{column}` leaps to {raw} and back in {percent:.1} % of the samples: a code for missing values"
    )]
    #[strum(serialize = "missing_code")]
    MissingCode { column: String, raw: f64, percent: f64 },
    #[error("column `{column}` is logged in {unit}, which cannot be converted to screw travel for this part")]
    #[strum(message = "give the part `lead_m_per_rev`, or `kind = \"rotary\"` with `reference_radius_m`")]
    UnitForPart { column: String, unit: &'static str, wanted: &'static str },
    #[error("cannot determine {fact} for this log")]
    #[strum(message = "set its source under `[identity]`: `metadata`, `columns` or `path`")]
    IdentityMissing { fact: &'static str, looked: Vec<String> },
    #[error("`{found}` is no {fact}: {detail}")]
    #[strum(message = "see `identity.departure_format` and `identity.time_zone`")]
    IdentityInvalid { fact: &'static str, found: String, detail: String },
    #[error("column `{column}` should hold one {fact}, but changes")]
    #[strum(
        message = "where a file holds many flights, set `identity.by_row = true`; else a log must hold one flight"
    )]
    IdentityChanges { fact: &'static str, column: String, row: u64, found: String, before: String },
    #[error("the table has no column `{column}`")]
    #[strum(
        serialize = "bad_table",
        message = "map the column names under `[columns]` (docs/configuration.md)"
    )]
    TableColumn { column: String, nearest: Option<String>, is_mapped: bool },
    #[error("the table cannot be used: {detail}")]
    #[strum(serialize = "bad_table", message = "columns and formats are in docs/configuration.md")]
    Table { row: Option<u64>, column: Option<String>, detail: String },
}

impl ErrorKind {
    /// What is wrong with a table as a whole.
    #[expect(clippy::needless_pass_by_value, reason = "`map_err` passes the error")]
    pub(crate) fn table(detail: impl ToString) -> Self {
        Self::Table { row: None, column: None, detail: detail.to_string() }
    }

    /// The stable code; `docs/errors.md` has a paragraph for each.
    fn code(&self) -> &'static str {
        match self {
            Self::Unreadable { source } if transient::is_transient(source) => READ_FAILED,
            Self::Object(source) => source.code(),
            other => other.into(),
        }
    }

    fn diagnostic(&self) -> Diagnostic {
        let remedy = self.named_remedy().or_else(|| self.get_message().map(str::to_owned));
        let mut c = Diagnostic::new(self.code(), self).hint(remedy.unwrap_or_default());
        c.column = self.column().cloned();
        match self {
            Self::Decode { row_group, .. } => c.row_group = *row_group,
            Self::Table { row, .. } => c.row = *row,
            Self::NoPosition { columns, .. } => c.found = Some(format!("columns {}", shortened(columns))),
            Self::IdentityMissing { looked, .. } => {
                c.found = Some(format!("looked in {}", join_places(looked)));
            }
            Self::IdentityChanges { row, found, before, .. } => {
                (c.row, c.found) = (Some(*row), Some(format!("`{found}` after `{before}`")));
            }
            Self::TimeUnit { found, .. } => {
                c.found = Some(found.clone());
                c.expected = Some("`clock.unit` = \"s\", \"ms\", \"us\", \"ns\", or \"count\" with `clock.rate_hz`; of texts, 2026-11-19T04:13:00Z, or 04:13:00 with `clock.epoch` = \"midnight\"".into());
            }
            Self::TimeGoesBack { row, before_s, after_s, max_back_s, times, .. } => {
                c.row = Some(*row);
                c.found = Some(format!("{after_s} s after {before_s} s; {times} rows lie so far back"));
                let most = format!("stamps that fall by no more than {max_back_s} s (`clock.max_back_s`)");
                c.expected = Some(most);
            }
            Self::SeveralFlights { row, before_s, after_s, end_s, max_gap_s, .. } => {
                c.row = Some(*row);
                c.found = Some(format!(
                    "samples from 0 to {before_s:.0} s and from {after_s:.0} to {end_s:.0} s after the first one"
                ));
                c.expected = Some(format!("pauses of no more than {max_gap_s} s (`clock.max_gap_s`)"));
            }
            Self::TimeStandsStill { rows, .. } => c.found = Some(format!("{rows} rows with one stamp")),
            Self::TimeImplausible { least_s, most_s, .. } => {
                c.expected = Some(format!("{least_s:e} to {most_s:e} s"));
            }
            Self::RateContradicts { declared_hz, seen_hz, .. } => {
                c.found = Some(format!("{seen_hz:.6} Hz by the median step"));
                c.expected = Some(format!("{declared_hz} Hz (`clock.rate_hz`)"));
            }
            Self::MetadataContradicts { key, noted, known, .. } => {
                c.found = Some(format!("`{key}` = {noted} in the Arrow metadata"));
                c.expected = Some(format!("`{key}` = {known}"));
            }
            Self::UnitForPart { wanted, .. } => c.expected = Some((*wanted).into()),
            _ => {}
        }
        c
    }

    fn column(&self) -> Option<&String> {
        match self {
            Self::Decode { column, .. }
            | Self::RowCount { column, .. }
            | Self::DuplicateColumn { column, .. }
            | Self::ColumnMissing { column, .. }
            | Self::TableColumn { column, .. }
            | Self::ColumnType { column, .. }
            | Self::MetadataContradicts { column, .. }
            | Self::TimeUnit { column, .. }
            | Self::TimeGoesBack { column, .. }
            | Self::SeveralFlights { column, .. }
            | Self::RateContradicts { column, .. }
            | Self::TimeImplausible { column, .. }
            | Self::TimeStandsStill { column, .. }
            | Self::AllMissing { column, .. }
            | Self::MissingCode { column, .. }
            | Self::ListLengths { column, .. }
            | Self::ClocksDiffer { column, .. }
            | Self::UnitForPart { column, .. }
            | Self::IdentityChanges { column, .. } => Some(column),
            Self::Table { column, .. } => column.as_ref(),
            _ => None,
        }
    }

    /// A remedy that depends on what was found, or that several errors share.
    fn named_remedy(&self) -> Option<String> {
        Some(match self {
            Self::Unreadable { source } => unreadable(source).1.into(),
            Self::Object(source) => source.remedy().into(),
            Self::BeyondLimit(Excess { key: Some(key), .. }) => {
                format!("if the file is sound, raise `{key}`; docs/limits.md lists all limits")
            }
            Self::ColumnMissing { column, nearest: Some(near) } => match hidden_difference(column, near) {
                Some(characters) => format!("`{near}`? {characters}"),
                None => format!("`{near}`? Names are mapped under `[channel]`, `[clock]` and `[identity]`"),
            },
            Self::TableColumn { nearest: Some(near), is_mapped: true, .. } => {
                format!("`{near}`? A table may call its columns otherwise: see `[columns]`")
            }
            Self::TableColumn { nearest, is_mapped: false, .. } => {
                let near = nearest.as_ref().map(|near| format!("`{near}`? ")).unwrap_or_default();
                format!("{near}docs/configuration.md has the names of this table's columns")
            }
            Self::ColumnType { found, column, .. } if found.starts_with(STRUCT) => {
                format!("name a field of it, as in `{column}.FIELD` (`freeplay check` lists them)")
            }
            Self::IdentityInvalid { fact, .. } if !fact.ends_with("_utc") => {
                format!("check this value, and where `[identity]` takes the {fact} from")
            }
            Self::MissingCode { raw, .. } => {
                format!("list it: `missing = [{raw}]` in the channel's table of the configuration")
            }
            Self::MetadataContradicts { key, noted, .. } => format!(
                "set `{key}` of the channel to {noted}; if the file is wrong, set its `ignore_metadata = true`"
            ),
            Self::NoPosition { pattern, .. } if pattern.contains('{') && !pattern.contains(PLACEHOLDER) => {
                format!("the placeholder of the position is {PLACEHOLDER}")
            }
            Self::NoPosition { pattern, columns }
                if let Some(near) = closest_to_pattern(pattern, columns) =>
            {
                let hidden = hidden_difference(&pattern.replace(PLACEHOLDER, ""), near);
                let hidden = hidden.map(|hidden| format!(" {hidden}.")).unwrap_or_default();
                format!(
                    "closest column: `{near}`.{hidden} Fix `column` under `[channel]`: {PLACEHOLDER} stands for the position"
                )
            }
            Self::Decode { .. } | Self::RowCount { .. } => {
                "the file is corrupt: fetch it again from the recorder, then `freeplay run --retry`".into()
            }
            Self::ColumnMissing { .. } | Self::NoPosition { .. } => {
                "names are mapped under `[channel]`, `[clock]` and `[identity]`".into()
            }
            Self::Table { detail, .. } if detail.contains("is not a UTC date") => {
                "write dates as 2026-11-19, times as 2026-11-19T04:13:00Z".into()
            }
            Self::Table { detail, .. } if detail.contains(',') && detail.ends_with("is not a number") => {
                "write decimals with a point, such as 1168.5".into()
            }
            _ => return None,
        })
    }
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

/// Message of the operating system, reworded for the usual cases, and the remedy.
fn unreadable(source: &io::Error) -> (String, &'static str) {
    let other = || format!("the file cannot be read: {source}");
    match source.kind() {
        io::ErrorKind::NotFound => {
            ("no such file".into(), "check the name, and that the disk or share is mounted")
        }
        io::ErrorKind::PermissionDenied => (
            "permission denied".into(),
            "run as a user with read access, or change the file mode; the next run tries again",
        ),
        io::ErrorKind::IsADirectory => {
            ("this is a folder, not a file".into(), "name the file, or the files in it: `FOLDER/*.parquet`")
        }
        _ if transient::is_file_limit(source) => {
            (other(), "allow more open files (`ulimit -n 4096`); the next run tries again")
        }
        _ => (other(), "check the disk or share; the next run tries again"),
    }
}

/// How the type of a column of structs begins.
pub(crate) const STRUCT: &str = "a struct of ";

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

/// The places where an identity field was searched.
fn join_places(places: &[String]) -> String {
    if places.is_empty() { "nowhere: `[identity]` has no source for it".into() } else { places.join(", ") }
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
