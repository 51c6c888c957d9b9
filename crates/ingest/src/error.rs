//! Why a log or a table cannot be used: a stable code, the place, what was found and what to do.

use std::io;
use std::path::{Path, PathBuf};

use records::Diagnostic;

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
    /// The file.
    pub file: PathBuf,
    /// What is wrong with it.
    #[source]
    pub kind: Box<ErrorKind>,
}

impl Error {
    /// A failed read in place of what a parser made of it.
    pub(crate) fn new(file: &Path, kind: ErrorKind) -> Self {
        let kind = transient::take_failed_read().map_or(kind, |source| ErrorKind::Unreadable { source });
        Self { file: file.to_owned(), kind: Box::new(kind) }
    }

    /// The form in which people and scripts see it.
    pub fn diagnostic(&self) -> Diagnostic {
        self.kind.diagnostic().in_file(self.file.display())
    }
}

/// What can be wrong: one variant for each thing its owner would do differently.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "each field is named for what it holds; rows count from 0")]
pub enum ErrorKind {
    /// The file cannot be opened or read at all.
    #[error("{}", unreadable(source))]
    Unreadable {
        #[source]
        source: io::Error,
    },
    /// The object store does not return it.
    #[error(transparent)]
    Object(#[from] object_io::Error),
    /// It has no bytes, or no rows.
    #[error("the log has no rows")]
    Empty,
    /// It is not Parquet, or its footer is truncated.
    #[error("cannot read as Parquet: {detail}")]
    NotParquet { detail: String },
    /// It is a file of another format.
    #[error("this is {format}, not a Parquet file")]
    ForeignFormat { format: &'static str },
    /// It claims more than is read, or than it can hold.
    #[error("{_0}")]
    BeyondLimit(Excess),
    /// It, or a column of it, is encrypted.
    #[error("{}", match column { Some(column) => format!("column `{column}` is encrypted"), None => "the file is encrypted".into() })]
    Encrypted { column: Option<String> },
    /// Its numbers are written in an encoding that this release does not read.
    #[error("the file uses the encoding {encoding}, which is not supported")]
    EncodingUnsupported { encoding: String },
    /// Several columns have the name that is mapped.
    #[error("the log has {count} columns called `{column}`")]
    DuplicateColumn { column: String, count: usize },
    /// The footer is sound, a page is not.
    #[error("a column cannot be decoded: {detail}")]
    Decode { column: String, row_group: Option<u64>, detail: String },
    /// A column holds another number of rows than the footer declares.
    #[error("the column holds {found} rows where the footer declares {declared}")]
    RowCount { column: String, found: u64, declared: u64 },
    /// A mapped column is not in the file.
    #[error("the log has no column `{column}`")]
    ColumnMissing { column: String, nearest: Option<String> },
    /// A channel is mapped to a group of files, and no file of that group belongs to this flight.
    #[error("no file of group `{group}` belongs to this flight")]
    GroupMissing { group: String },
    /// Two lists that should hold the samples of one row side by side do not.
    #[error("the lists in `{column}` and `{other}` differ in length")]
    ListLengths { column: String, other: String },
    /// Two clocks of one log share no zero.
    #[error("the clocks `{column}` and `{other}` cannot be brought together")]
    ClocksDiffer { column: String, other: String },
    /// A log that Freeplay normalized does not fit the settings any more.
    #[error("normalized log was written with other settings: {detail}")]
    Normalized { detail: String },
    /// The Arrow metadata of a column notes another scale, offset or unit than the mapping.
    #[error("the file notes {key} {noted} for column `{column}`, and the mapping has {known}")]
    MetadataContradicts { column: String, key: &'static str, noted: String, known: String },
    /// A column is there, but its type holds no numbers.
    #[error("column `{column}` holds {found}, not {wanted}")]
    ColumnType { column: String, found: String, wanted: &'static str },
    /// No column fits the `{position}` patterns.
    #[error("no column matches `{pattern}`")]
    NoPosition { pattern: String, columns: Vec<String> },
    /// The time column needs a unit, or has one that contradicts it.
    #[error("the unit of the time column `{column}` is not known")]
    TimeUnit { column: String, found: String },
    /// Neither a time column nor a rate.
    #[error("the log has no clock: neither `clock.column` nor `clock.rate_hz` is given")]
    NoClock,
    /// Stamps fall further than allowed.
    #[error("time runs backwards")]
    TimeGoesBack { column: String, row: u64, before_s: f64, after_s: f64, max_back_s: f64, times: u64 },
    /// The clock pauses for longer than within one flight.
    #[error("the log seems to hold two flights")]
    SeveralFlights { column: String, row: u64, before_s: f64, after_s: f64, end_s: f64, max_gap_s: f64 },
    /// The timestamps give another rate than the declared one.
    #[error("timestamps give {seen_hz} Hz but `clock.rate_hz` = {declared_hz}")]
    RateContradicts { column: String, declared_hz: f64, seen_hz: f64 },
    /// The clock gives a first stamp or a step that no recorder has.
    #[error("the clock is not plausible: {what} is {value_s:e} s")]
    TimeImplausible { column: String, what: &'static str, value_s: f64, least_s: f64, most_s: f64 },
    /// No two stamps differ.
    #[error("time does not advance")]
    TimeStandsStill { column: String, rows: u64 },
    /// A channel has no value at all.
    #[error("column `{column}` holds no value in {rows} rows")]
    AllMissing { column: String, rows: u64 },
    /// A length was mapped for a part that turns, or an angle for a part whose lead is not given.
    #[error("column `{column}` is logged in {unit}, which cannot be converted to screw travel for this part")]
    UnitForPart { column: String, unit: &'static str, wanted: &'static str },
    /// No source states a fact that is needed.
    #[error("cannot determine {fact} for this log")]
    IdentityMissing { fact: &'static str, looked: Vec<String> },
    /// A fact that cannot be read.
    #[error("`{found}` is no {fact}: {detail}")]
    IdentityInvalid { fact: &'static str, found: String, detail: String },
    /// A column that should be constant is not.
    #[error("column `{column}` should hold one {fact}, but changes")]
    IdentityChanges { fact: &'static str, column: String, row: u64, found: String, before: String },
    /// A column of a table is not there.
    #[error("the table has no column `{column}`")]
    TableColumn { column: String, nearest: Option<String>, has_semicolons: bool },
    /// A table cannot be used.
    #[error("the table cannot be used: {detail}")]
    Table { row: Option<u64>, column: Option<String>, detail: String },
}

impl From<io::Error> for ErrorKind {
    fn from(source: io::Error) -> Self {
        Self::Unreadable { source }
    }
}

impl From<Excess> for ErrorKind {
    fn from(excess: Excess) -> Self {
        Self::BeyondLimit(excess)
    }
}

impl ErrorKind {
    /// The stable code; `docs/errors.md` has a paragraph for each.
    pub fn code(&self) -> &'static str {
        match self {
            Self::Unreadable { source } if transient::is_transient(source) => READ_FAILED,
            Self::Unreadable { .. } => UNREADABLE,
            Self::Object(source) => source.code(),
            Self::Empty => "empty_log",
            Self::NotParquet { .. } | Self::ForeignFormat { .. } => "not_parquet",
            Self::BeyondLimit(_) => "beyond_limit",
            Self::Encrypted { .. } => "encrypted",
            Self::EncodingUnsupported { .. } => "encoding_unsupported",
            Self::DuplicateColumn { .. } => "duplicate_column",
            Self::Decode { .. } => "decode_failed",
            Self::RowCount { .. } => "row_count_differs",
            Self::ColumnMissing { .. } => "column_missing",
            Self::MetadataContradicts { .. } => "metadata_contradicts",
            Self::ColumnType { .. } => "column_type",
            Self::GroupMissing { .. } => "group_missing",
            Self::ListLengths { .. } => "list_lengths",
            Self::ClocksDiffer { .. } => "clocks_differ",
            Self::Normalized { .. } => "normalized_otherwise",
            Self::NoPosition { .. } => "no_position",
            Self::TimeUnit { .. } => "time_unit_unknown",
            Self::NoClock => "no_clock",
            Self::TimeGoesBack { .. } => "time_goes_back",
            Self::SeveralFlights { .. } => "several_flights",
            Self::RateContradicts { .. } => "rate_contradicts",
            Self::TimeImplausible { .. } => "time_implausible",
            Self::TimeStandsStill { .. } => "time_stands_still",
            Self::AllMissing { .. } => "channel_empty",
            Self::UnitForPart { .. } => "unit_for_part",
            Self::IdentityMissing { .. } => "identity_missing",
            Self::IdentityInvalid { .. } => "identity_invalid",
            Self::IdentityChanges { .. } => "identity_changes",
            Self::TableColumn { .. } | Self::Table { .. } => "bad_table",
        }
    }

    fn diagnostic(&self) -> Diagnostic {
        let mut c = Diagnostic::new(self.code(), self);
        self.place(&mut c);
        c.found = self.found();
        c.expected = self.expected();
        c.hint = Some(self.remedy());
        c
    }

    fn place(&self, c: &mut Diagnostic) {
        match self {
            Self::Decode { column, row_group, .. } => {
                c.column = Some(column.clone());
                c.row_group = *row_group;
            }
            Self::RowCount { column, .. }
            | Self::DuplicateColumn { column, .. }
            | Self::ColumnMissing { column, .. }
            | Self::TableColumn { column, .. }
            | Self::ColumnType { column, .. }
            | Self::MetadataContradicts { column, .. }
            | Self::TimeUnit { column, .. }
            | Self::RateContradicts { column, .. }
            | Self::TimeImplausible { column, .. }
            | Self::TimeStandsStill { column, .. }
            | Self::AllMissing { column, .. }
            | Self::ListLengths { column, .. }
            | Self::ClocksDiffer { column, .. }
            | Self::UnitForPart { column, .. } => c.column = Some(column.clone()),
            Self::TimeGoesBack { column, row, .. }
            | Self::SeveralFlights { column, row, .. }
            | Self::IdentityChanges { column, row, .. } => {
                c.column = Some(column.clone());
                c.row = Some(*row);
            }
            Self::Table { row, column, .. } => {
                c.row = *row;
                c.column.clone_from(column);
            }
            _ => {}
        }
    }

    fn found(&self) -> Option<String> {
        match self {
            Self::NoPosition { columns, .. } => Some(format!("columns {}", shortened(columns))),
            Self::TimeUnit { found, .. } => Some(found.clone()),
            Self::TimeGoesBack { before_s, after_s, times, .. } => {
                Some(format!("{after_s} s after {before_s} s; {times} rows lie so far back"))
            }
            Self::SeveralFlights { before_s, after_s, end_s, .. } => Some(format!(
                "samples from 0 to {before_s:.0} s and from {after_s:.0} to {end_s:.0} s after the first one"
            )),
            Self::TimeStandsStill { rows, .. } => Some(format!("{rows} rows with one stamp")),
            Self::RateContradicts { seen_hz, .. } => Some(format!("{seen_hz:.6} Hz by the median step")),
            Self::MetadataContradicts { key, noted, .. } => {
                Some(format!("`{key}` = {noted} in the Arrow metadata"))
            }
            Self::IdentityMissing { looked, .. } => Some(format!("looked in {}", join_places(looked))),
            Self::IdentityChanges { found, before, .. } => Some(format!("`{found}` after `{before}`")),
            _ => None,
        }
    }

    fn expected(&self) -> Option<String> {
        match self {
            Self::TimeGoesBack { max_back_s, .. } => {
                Some(format!("stamps that fall by no more than {max_back_s} s (`clock.max_back_s`)"))
            }
            Self::SeveralFlights { max_gap_s, .. } => {
                Some(format!("pauses of no more than {max_gap_s} s (`clock.max_gap_s`)"))
            }
            Self::TimeImplausible { least_s, most_s, .. } => Some(format!("{least_s:e} to {most_s:e} s")),
            Self::RateContradicts { declared_hz, .. } => Some(format!("{declared_hz} Hz (`clock.rate_hz`)")),
            Self::TimeUnit { .. } => {
                Some("`clock.unit` = \"s\", \"ms\", \"us\", \"ns\", or \"count\" with `clock.rate_hz`".into())
            }
            Self::MetadataContradicts { key, known, .. } => Some(format!("`{key}` = {known}")),
            Self::UnitForPart { wanted, .. } => Some((*wanted).into()),
            _ => None,
        }
    }

    fn remedy(&self) -> String {
        self.named_remedy().unwrap_or_else(|| self.usual_remedy().into())
    }

    /// A remedy that names a key, a column or a value of this log.
    fn named_remedy(&self) -> Option<String> {
        Some(match self {
            Self::Unreadable { source } => missing_remedy(source),
            Self::Object(source) => source.remedy().into(),
            Self::BeyondLimit(Excess { key: Some(key), .. }) => {
                format!("if the file is sound, raise `{key}`; docs/limits.md lists all limits")
            }
            Self::ColumnMissing { column, nearest: Some(near) } => match hidden_difference(column, near) {
                Some(characters) => format!("`{near}`? {characters}"),
                None => format!("`{near}`? Names are mapped under `[channel]`, `[clock]` and `[identity]`"),
            },
            Self::TableColumn { nearest: Some(near), .. } => {
                format!("`{near}`? A table may call its columns otherwise: see `[columns]`")
            }
            Self::ColumnType { found, column, .. } if found.starts_with(STRUCT) => {
                format!("name a field of it, as in `{column}.FIELD` (`freeplay check` lists them)")
            }
            Self::MetadataContradicts { key, noted, .. } => format!(
                "set `{key}` of the channel to {noted}; if the file is wrong, set its `ignore_metadata = true`"
            ),
            Self::NoPosition { pattern, .. } if pattern.contains('{') && !pattern.contains(PLACEHOLDER) => {
                format!("the placeholder of the position is {PLACEHOLDER}")
            }
            Self::NoPosition { pattern, columns } => {
                let near = closest_to_pattern(pattern, columns)?;
                let hidden = hidden_difference(&pattern.replace(PLACEHOLDER, ""), near);
                let hidden = hidden.map(|hidden| format!(" {hidden}.")).unwrap_or_default();
                format!(
                    "closest column: `{near}`.{hidden} Fix `column` under `[channel]`: {PLACEHOLDER} stands for the position"
                )
            }
            _ => return None,
        })
    }

    fn usual_remedy(&self) -> &'static str {
        match self {
            // Each of these names its own remedy.
            Self::Unreadable { .. } | Self::Object(_) | Self::MetadataContradicts { .. } => "",
            Self::Empty => "file is empty; delete it or ignore it. It is skipped until it changes",
            Self::NotParquet { .. } => {
                "copy the file again, or exclude it in `logs.files`; then `freeplay run --retry`"
            }
            Self::ForeignFormat { .. } => {
                "convert it to Parquet (docs/convert-logs.md), or exclude it in `logs.files`"
            }
            Self::BeyondLimit(_) => {
                "the file is damaged or made to exhaust memory: fetch it again, or exclude it in `logs.files` (docs/limits.md)"
            }
            Self::Encrypted { .. } => {
                "have it decrypted before it arrives here: keys of encrypted Parquet files are not supported"
            }
            Self::EncodingUnsupported { .. } => {
                "have the recorder write PLAIN, BYTE_STREAM_SPLIT or dictionary encoding, or rewrite the file with the tool that wrote it"
            }
            Self::DuplicateColumn { .. } => {
                "give each column a name of its own where the file is written, or map another column"
            }
            Self::Decode { .. } | Self::RowCount { .. } => {
                "the file is corrupt: fetch it again from the recorder, then `freeplay run --retry`"
            }
            Self::TableColumn { has_semicolons: true, .. } => {
                "the fields are separated by `;`: save the table with commas, and numbers with a point"
            }
            Self::TableColumn { .. } => "map the column names under `[columns]` (docs/configuration.md)",
            Self::ColumnMissing { .. } | Self::NoPosition { .. } => {
                "names are mapped under `[channel]`, `[clock]` and `[identity]`"
            }
            Self::ColumnType { .. } => "map another column, or have the recorder write numbers",
            Self::GroupMissing { .. } => {
                "check that the file has arrived and has the same tail and flight (see `freeplay check`)"
            }
            Self::ListLengths { .. } => {
                "if the channel has timestamps of its own, name them in its `time_column`; else all lists of a row must hold as many samples"
            }
            Self::ClocksDiffer { .. } => {
                "both must be instants, or both numbers from the same zero: see `clock.epoch` and `identity.time_zone`"
            }
            Self::Normalized { .. } => "write it again from the recorded log: `freeplay normalize`",
            Self::TimeUnit { .. } => "set `clock.unit` to s, ms, us or ns",
            Self::NoClock => "name the time column, or give the rate when rows are evenly spaced",
            Self::TimeGoesBack { .. } => {
                "if the file joins several recordings, set `clock.split_at_jumps = true`; if a counter starts again, set `clock.wraps_at` to the value at which it does"
            }
            Self::SeveralFlights { .. } => {
                "write each flight to a file of its own, or name the column with the flight or the departure in `identity.columns`; if it is one flight, raise `clock.max_gap_s`"
            }
            Self::RateContradicts { .. } => {
                "check `clock.unit`; omit `clock.rate_hz` to use the rate of the timestamps"
            }
            Self::TimeImplausible { .. } => {
                "check `clock.column` and `clock.unit`, and that the file is intact"
            }
            Self::TimeStandsStill { .. } => "map the column with the time, or give only `clock.rate_hz`",
            Self::AllMissing { .. } => "check the sensor, or map the redundant channel",
            Self::UnitForPart { .. } => {
                "give the part `lead_m_per_rev`, or `kind = \"rotary\"` with `reference_radius_m`"
            }
            Self::IdentityMissing { .. } => {
                "set its source under `[identity]`: `metadata`, `columns` or `path`"
            }
            Self::IdentityInvalid { .. } => "see `identity.departure_format` and `identity.time_zone`",
            Self::IdentityChanges { .. } => {
                "where a file holds many flights, set `identity.by_row = true`; else a log must hold one flight"
            }
            Self::Table { detail, .. } if detail.contains("is not a UTC date") => {
                "write dates as 2026-11-19, times as 2026-11-19T04:13:00Z"
            }
            Self::Table { detail, .. } if detail.contains(',') && detail.ends_with("is not a number") => {
                "write decimals with a point, such as 1168.5"
            }
            Self::Table { .. } => "columns and formats are in docs/configuration.md",
        }
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
    let score = |column: &str| (shared(column), strsim::jaro_winkler(pattern, column));
    let by_score = |a: &&String, b: &&String| {
        let (a, b) = (score(a), score(b));
        a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
    };
    columns.iter().max_by(by_score)
}

/// Message of the operating system, reworded for the two most common cases.
fn unreadable(source: &io::Error) -> String {
    match source.kind() {
        io::ErrorKind::NotFound => "no such file".into(),
        io::ErrorKind::PermissionDenied => "permission denied".into(),
        io::ErrorKind::IsADirectory => "this is a folder, not a file".into(),
        _ => format!("the file cannot be read: {source}"),
    }
}

fn missing_remedy(source: &io::Error) -> String {
    match source.kind() {
        io::ErrorKind::NotFound => "check the name, and that the disk or share is mounted",
        io::ErrorKind::PermissionDenied => {
            "run as a user with read access, or change the file mode; the next run tries again"
        }
        io::ErrorKind::IsADirectory => "name the file, or the files in it: `FOLDER/*.parquet`",
        _ if transient::is_file_limit(source) => {
            "allow more open files (`ulimit -n 4096`); the next run tries again"
        }
        _ => "check the disk or share; the next run tries again",
    }
    .into()
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
