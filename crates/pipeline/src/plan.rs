//! Which logs are there, which are already accounted for, and why each of the others is done.

use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::path::{Path, PathBuf};

use fleet::{Complaint, Flight, FlightId, Installations, Position, SerialNumber, TailNumber};
use jiff::Timestamp;
use job::Config;
use store::{LogAccount, Outcome, RecordKey};

use crate::error::Error;

/// What is asked of a run.
#[derive(Debug, Clone, Default)]
pub struct Request {
    /// Departures from then on.
    pub since_utc: Option<Timestamp>,
    /// Departures before then.
    pub until_utc: Option<Timestamp>,
    /// One aircraft only.
    pub tail_number: Option<TailNumber>,
    /// Logs of flights on which this unit flew only.
    pub serial_number: Option<SerialNumber>,
    /// So many logs at most.
    pub limit: Option<usize>,
    /// Workers; as many as cores when not given.
    pub jobs: Option<usize>,
    /// Logs in error again.
    pub retry: bool,
    /// Every log again.
    pub redo: bool,
}

impl Request {
    /// Whether a flight is asked for.
    pub fn wants(&self, flight: &Flight, installations: &Installations) -> bool {
        let at = flight.departure_utc;
        let flew = |serial: &SerialNumber| {
            installations.on_tail(&flight.tail_number, at).any(|stay| stay.serial_number == *serial)
        };
        self.since_utc.is_none_or(|since| since <= at)
            && self.until_utc.is_none_or(|until| at < until)
            && self.tail_number.as_ref().is_none_or(|tail| *tail == flight.tail_number)
            && self.serial_number.as_ref().is_none_or(flew)
    }
}

/// Why a log is done.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Why {
    /// It was never seen.
    New,
    /// Its file is not the one that was accounted for.
    ContentChanged,
    /// A setting that touches it, or an installation, changed.
    SettingChanged,
    /// It was in error, and `--retry` asks for it.
    Retry,
    /// `--redo` asks for it.
    Asked,
}

impl Why {
    /// In words.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::New => "new",
            Self::ContentChanged => "content changed",
            Self::SettingChanged => "setting changed",
            Self::Retry => "in error, asked again",
            Self::Asked => "asked again",
        }
    }
}

/// What tells a file apart without opening it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FileStat {
    /// Bytes.
    pub size_bytes: i64,
    /// Nanoseconds since 1970 UTC.
    pub modified_utc_ns: i64,
    /// Device and inode where the system has them.
    pub file_id: String,
}

impl FileStat {
    fn of(path: &Path) -> Option<Self> {
        let data = std::fs::metadata(path).ok()?;
        let modified = data.modified().ok().and_then(|m| m.duration_since(std::time::UNIX_EPOCH).ok());
        Some(Self {
            size_bytes: data.len() as i64,
            modified_utc_ns: modified.map_or(0, |m| m.as_nanos() as i64),
            file_id: file_id(&data),
        })
    }

    fn is_of(&self, account: &LogAccount) -> bool {
        self.size_bytes == account.size_bytes
            && self.modified_utc_ns == account.modified_utc_ns
            && self.file_id == account.file_id
    }
}

#[cfg(unix)]
fn file_id(data: &std::fs::Metadata) -> String {
    use std::os::unix::fs::MetadataExt;
    format!("{}:{}", data.dev(), data.ino())
}

#[cfg(not(unix))]
fn file_id(_: &std::fs::Metadata) -> String {
    String::new()
}

/// One log to be done.
#[derive(Debug, Clone, PartialEq)]
pub struct Work {
    /// Where it is.
    pub path: PathBuf,
    /// Its name in records and messages: relative to the configuration where it lies below it.
    pub shown: String,
    /// What tells its file apart; none when it vanished since it was found.
    pub stat: Option<FileStat>,
    /// Why it is done.
    pub why: Why,
    /// What was accounted for before under this name.
    pub before: Option<LogAccount>,
}

/// The night's plan.
#[derive(Debug, Clone)]
pub struct Plan {
    /// Logs that fit the patterns.
    pub found: usize,
    /// Those already accounted for, or not asked for.
    pub known: usize,
    /// Those to be done, longest first.
    pub work: Vec<Work>,
    /// What is accounted for, by name, of the logs that are still there.
    pub accounts: BTreeMap<String, LogAccount>,
    /// What was read, and under which settings, also of logs that are gone: they may be here renamed.
    pub digests: HashSet<(String, String)>,
}

/// Makes the plan from the logs there are and the accounts kept.
///
/// # Errors
/// [`Error::Refused`] when a pattern fits no file.
pub fn plan(
    config: &Config,
    installations: &Installations,
    accounts: Vec<LogAccount>,
    request: &Request,
) -> Result<Plan, Error> {
    let found = find(config)?;
    let digests = accounts.iter().filter_map(digests).collect();
    let here = accounts.into_iter().filter(|account| found.contains_key(&account.log_path));
    let accounts: BTreeMap<String, LogAccount> =
        here.map(|account| (account.log_path.clone(), account)).collect();
    let unidentified = job::flight::unidentified_digest(config, installations);
    let mut work = Vec::new();
    for (shown, path) in &found {
        let (before, stat) = (accounts.get(shown), FileStat::of(path));
        let why = reason(before, stat.as_ref(), config, installations, &unidentified, request);
        let task =
            |why| Work { path: path.clone(), shown: shown.clone(), stat, why, before: before.cloned() };
        work.extend(why.map(task));
    }
    let size = |w: &Work| w.stat.as_ref().map_or(0, |s| s.size_bytes);
    work.sort_by(|a, b| size(b).cmp(&size(a)).then_with(|| a.shown.cmp(&b.shown)));
    work.truncate(request.limit.unwrap_or(usize::MAX));
    let known = found.len() - work.len();
    Ok(Plan { found: found.len(), known, work, accounts, digests })
}

/// What was read, and which settings touched it, of a log that went well.
pub fn digests(account: &LogAccount) -> Option<(String, String)> {
    let well = account.outcome == Outcome::Done;
    well.then(|| Some((account.log_digest.clone()?, account.config_digest.clone()?))).flatten()
}

/// The actuators' flights that a log in the store speaks for.
pub fn owned(account: &LogAccount) -> Vec<RecordKey> {
    match flight_of(account) {
        Some(flight) if account.estimated + account.refused > 0 => {
            account.positions.iter().map(|position| record_key(&flight, position)).collect()
        }
        _ => Vec::new(),
    }
}

/// By what the record of an actuator's flight is known.
pub fn record_key(flight: &Flight, position: &str) -> RecordKey {
    RecordKey {
        departure_us: flight.departure_utc.as_microsecond(),
        tail_number: flight.tail_number.to_string(),
        flight_id: flight.flight_id.to_string(),
        position: position.to_owned(),
    }
}

/// The flight an account speaks of, where its log was identified.
pub fn flight_of(account: &LogAccount) -> Option<Flight> {
    Some(Flight {
        tail_number: TailNumber::new(account.tail_number.as_ref()?).ok()?,
        flight_id: FlightId::new(account.flight_id.as_ref()?).ok()?,
        departure_utc: account.departure_utc?,
        flight_hours: None,
        tail_hours_end: None,
    })
}

/// Why this log is done tonight, or nothing when it is accounted for or not asked for.
fn reason(
    account: Option<&LogAccount>,
    stat: Option<&FileStat>,
    config: &Config,
    installations: &Installations,
    unidentified: &str,
    request: &Request,
) -> Option<Why> {
    let Some(account) = account else { return Some(Why::New) };
    let flight = flight_of(account);
    if flight.as_ref().is_some_and(|flight| !request.wants(flight, installations)) {
        return None;
    }
    let settings = flight.map_or_else(
        || unidentified.to_owned(),
        |flight| job::flight::config_digest(config, installations, &flight, &positions_of(account)),
    );
    if request.redo {
        Some(Why::Asked)
    } else if !stat.is_some_and(|stat| stat.is_of(account)) {
        Some(Why::ContentChanged)
    } else if account.config_digest.as_deref() != Some(&settings) {
        Some(Why::SettingChanged)
    } else if request.retry && account.outcome == Outcome::Error {
        Some(Why::Retry)
    } else {
        None
    }
}

fn positions_of(account: &LogAccount) -> Vec<Position> {
    account.positions.iter().filter_map(|p| Position::new(p).ok()).collect()
}

/// Every file that fits a pattern, by its shown name.
fn find(config: &Config) -> Result<BTreeMap<String, PathBuf>, Error> {
    let mut found = BTreeMap::new();
    let mut silent = BTreeSet::new();
    for pattern in &config.document.logs.files {
        let full = config.path(pattern);
        let paths = glob::glob(&full.to_string_lossy()).map_err(|e| {
            let what = format!("`{pattern}` is no pattern of files: {e}");
            Error::refused(Complaint::new("bad_pattern", what).in_file(config.file.display()))
        })?;
        let files: Vec<PathBuf> = paths.flatten().filter(|path| path.is_file()).collect();
        if files.is_empty() {
            silent.insert(pattern.as_str());
        }
        found.extend(files.into_iter().map(|path| (shown(config, &path), path)));
    }
    // Silence is a fault: a pattern that fits nothing is more often a moved folder than a day without flights.
    if silent.is_empty() { Ok(found) } else { Err(Error::refused(no_log(config, &silent))) }
}

fn no_log(config: &Config, silent: &BTreeSet<&str>) -> Complaint {
    let patterns = silent.iter().map(|p| format!("`{p}`")).collect::<Vec<_>>().join(", ");
    let folder = if config.folder.as_os_str().is_empty() { Path::new(".") } else { &config.folder };
    Complaint::new("no_log_matched", format!("no log fits {patterns}"))
        .in_file(config.file.display())
        .hint(format!("patterns start from {}; are the logs there tonight?", folder.display()))
}

fn shown(config: &Config, path: &Path) -> String {
    path.strip_prefix(&config.folder).unwrap_or(path).to_string_lossy().replace('\\', "/")
}
