//! Plan of a run: the logs found, those already processed, and the reason to process each of the others.

use std::collections::{BTreeMap, HashMap, HashSet};

use ingest::LogFiles;
use jiff::Timestamp;
use job::Config;
use job::flight_log::{config_digest, digest_without_identity, identify};
use rayon::prelude::*;
use records::{Diagnostic, Flight, FlightId, Installations, Position, SerialNumber, TailNumber};
use serde::{Deserialize, Serialize};
use store::{LogOutcome, LogRecord, RecordKey};

use crate::error::{is_passing, is_unlisted};
use crate::logs::discover::DiscoveredLogs;
use crate::logs::file_stat::{FileStat, SeenObjects};

/// Options of a run.
#[derive(Debug, Clone, Default)]
#[expect(missing_docs, reason = "each field is named for what it holds")]
pub struct Request {
    /// Departures at or after this time.
    pub since_utc: Option<Timestamp>,
    /// Departures before this time.
    pub until_utc: Option<Timestamp>,
    pub tail_number: Option<TailNumber>,
    pub serial_number: Option<SerialNumber>,
    pub limit: Option<usize>,
    /// Number of workers; one per core when not given.
    pub jobs: Option<usize>,
    pub retry: bool,
    pub redo: bool,
    /// Compare the content of known logs, even if their files have not changed.
    pub verify_content: bool,
}

impl Request {
    /// Whether the options select less than all flights.
    fn is_narrow(&self) -> bool {
        self.since_utc.is_some()
            || self.until_utc.is_some()
            || self.tail_number.is_some()
            || self.serial_number.is_some()
    }

    pub(crate) fn wants(&self, flight: &Flight, installations: &Installations) -> bool {
        let at = flight.departure_utc;
        let flew = |serial: &SerialNumber| {
            installations
                .units_on_tail(&flight.tail_number, at)
                .any(|installation| installation.unit().1 == serial)
        };
        self.since_utc.is_none_or(|since| since <= at)
            && self.until_utc.is_none_or(|until| at < until)
            && self.tail_number.as_ref().is_none_or(|tail| *tail == flight.tail_number)
            && self.serial_number.as_ref().is_none_or(flew)
    }
}

/// Reason to process a log; its text is that of `run --dry-run`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, strum::Display, Serialize, Deserialize)]
#[expect(missing_docs, reason = "each variant has its text")]
pub enum WorkReason {
    #[strum(serialize = "new")]
    New,
    #[strum(serialize = "content changed")]
    ContentChanged,
    /// Also of a log whose installation has changed.
    #[strum(serialize = "setting changed")]
    SettingChanged,
    #[strum(serialize = "its flight has no other log now")]
    OwnerGone,
    #[strum(serialize = "in error, asked again")]
    Retry,
    /// A failed read, a time limit, or a wrong clock.
    #[strum(serialize = "failed before for a passing cause")]
    Unfetched,
    #[strum(serialize = "cannot be listed")]
    Unlisted,
    #[strum(serialize = "asked again")]
    Asked,
    #[strum(serialize = "content to be compared")]
    Verify,
}

/// One log to be processed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "each field is named for what it holds")]
pub struct WorkItem {
    pub files: LogFiles,
    /// Error that is known already, e.g. an unreadable folder.
    pub fault: Option<Diagnostic>,
    /// Its path in records and messages: relative to the configuration's folder where it is inside it.
    pub log_path: String,
    /// File status; none when the file vanished since it was found.
    pub stat: Option<FileStat>,
    pub why: WorkReason,
    /// Status of an earlier log of this path.
    pub before: Option<LogRecord>,
}

impl WorkItem {
    /// Whether an earlier run ended with an error of this log.
    pub(crate) fn failed_before(&self) -> bool {
        self.before.as_ref().is_some_and(|before| before.outcome == LogOutcome::Error)
    }
}

/// Plan of a run.
#[derive(Debug, Clone, Default)]
#[expect(missing_docs, reason = "each field is named for what it holds")]
pub struct Plan {
    pub found: usize,
    pub known: usize,
    /// Logs to be processed, largest first; those that failed before come last.
    pub work: Vec<WorkItem>,
    /// Log records, by path, of the logs that still exist.
    pub accounts: BTreeMap<String, LogRecord>,
    /// Deleted logs by the digest of their content: a log may have been renamed.
    pub gone: HashMap<String, Vec<LogRecord>>,
    /// Number of logs with stored records that were deleted, or that no pattern matches any more, and that lie nowhere else.
    pub absent: usize,
    pub not_asked: usize,
    /// Logs left for later by `--limit`.
    pub left: usize,
    /// Failed logs of earlier runs that are not processed again, by path.
    pub standing_errors: Vec<StandingError>,
    /// Digest of the settings of a log without an identity.
    pub unidentified: String,
}

/// An error of an earlier run whose log has not changed since: it is reported until the log or a setting is fixed.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[expect(missing_docs, reason = "each field is named for what it holds")]
pub struct StandingError {
    pub log: String,
    /// Code of its first error.
    pub code: String,
    pub detail: String,
    pub run_id: String,
    /// Whether `logs.acknowledged_errors` names the log, so that it no longer makes the exit code 1.
    pub is_acknowledged: bool,
}

impl StandingError {
    fn of(account: &LogRecord, acknowledged: &[glob::Pattern]) -> Self {
        Self {
            is_acknowledged: acknowledged.iter().any(|pattern| pattern.matches(&account.log_path)),
            log: account.log_path.clone(),
            code: account.error_code.clone().unwrap_or_default(),
            detail: account.error_detail.clone().unwrap_or_default(),
            run_id: account.run_id.clone(),
        }
    }
}

/// Plans a run from the logs found and the status of earlier ones.
pub fn plan(
    config: &Config,
    installations: &Installations,
    found: DiscoveredLogs,
    accounts: Vec<LogRecord>,
    request: &Request,
) -> Plan {
    let DiscoveredLogs { logs: found, seen, .. } = found;
    let (here, gone): (Vec<_>, Vec<_>) = accounts.into_iter().partition(|a| found.contains_key(&a.log_path));
    let contents: HashSet<&String> = here.iter().filter_map(|a| a.log_digest.as_ref()).collect();
    let lies_elsewhere =
        |a: &&LogRecord| a.log_digest.as_ref().is_some_and(|digest| contents.contains(digest));
    let absent = gone.iter().filter(|a| a.estimated + a.refused > 0 && !lies_elsewhere(a));
    // A log that was moved before it was deleted is one.
    let absent: HashSet<&str> = absent.map(|a| a.log_digest.as_deref().unwrap_or(&a.log_path)).collect();
    let absent = absent.len();
    let accounts: BTreeMap<String, LogRecord> = here.into_iter().map(|a| (a.log_path.clone(), a)).collect();
    // Names and digests of a hundred thousand logs are made only where they decide something.
    let owned: HashSet<RecordKey> = if accounts.values().any(is_silent) {
        let with_records = accounts.values().filter(|account| account.estimated + account.refused > 0);
        with_records.flat_map(LogRecord::keys).collect()
    } else {
        HashSet::new()
    };
    let unidentified = digest_without_identity(config, installations);
    let planner =
        Planner { config, installations, request, owned: &owned, unidentified: &unidentified, seen: &seen };
    let verdicts: Vec<Result<WorkItem, Skipped>> = found
        .par_iter()
        .map(|(log_path, log)| planner.plan_log(log_path, log, accounts.get(log_path)))
        .collect();
    let not_asked = verdicts.iter().filter(|v| **v == Err(Skipped::NotAsked)).count();
    let mut work: Vec<WorkItem> = verdicts.into_iter().filter_map(Result::ok).collect();
    let size = |w: &WorkItem| w.stat.as_ref().map_or(0, |s| s.size_bytes);
    work.sort_by(|a, b| {
        let by_size = || size(b).cmp(&size(a)).then_with(|| a.log_path.cmp(&b.log_path));
        a.failed_before().cmp(&b.failed_before()).then_with(by_size)
    });
    let wanted = work.len();
    work.truncate(request.limit.unwrap_or(usize::MAX));
    let left = wanted - work.len();
    let known = found.len() - wanted - not_asked;
    let to_do: HashSet<&str> = work.iter().map(|work| work.log_path.as_str()).collect();
    let patterns = config.document.logs.acknowledged_errors.iter();
    let acknowledged: Vec<_> = patterns.filter_map(|text| glob::Pattern::new(text).ok()).collect();
    let standing_errors = accounts
        .values()
        .filter(|account| account.outcome == LogOutcome::Error && !to_do.contains(account.log_path.as_str()))
        .map(|account| StandingError::of(account, &acknowledged))
        .collect();
    drop(to_do);
    let mut plan = Plan {
        unidentified,
        found: found.len(),
        known,
        work,
        accounts,
        absent,
        not_asked,
        left,
        standing_errors,
        ..Plan::default()
    };
    if !plan.work.is_empty() {
        for account in gone.into_iter().filter(|account| digests(account).is_some()) {
            plan.gone.entry(account.log_digest.clone().unwrap_or_default()).or_default().push(account);
        }
    }
    plan
}

/// Digests of the content of a log that was processed without an error, and of the settings that affect it.
pub(crate) fn digests(account: &LogRecord) -> Option<(String, String)> {
    let digests = account.log_digest.clone().zip(account.config_digest.clone());
    digests.filter(|_| account.outcome.is_success())
}

/// Whether two logs are of one flight: one departure of one aircraft.
pub(crate) fn is_same_flight(one: &LogRecord, other: &LogRecord) -> bool {
    (&one.tail_number, one.departure_utc) == (&other.tail_number, other.departure_utc)
}

/// Flight of a log record, where its log was identified.
pub(crate) fn flight_of(account: &LogRecord) -> Option<Flight> {
    Some(Flight {
        tail_number: TailNumber::new(account.tail_number.as_ref()?).ok()?,
        flight_id: FlightId::new(account.flight_id.as_ref()?).ok()?,
        departure_utc: account.departure_utc?,
        flight_hours: None,
        tail_hours_end: None,
    })
}

#[derive(Debug, PartialEq)]
enum Skipped {
    Known,
    NotAsked,
}

struct Planner<'a> {
    config: &'a Config,
    installations: &'a Installations,
    request: &'a Request,
    owned: &'a HashSet<RecordKey>,
    unidentified: &'a str,
    seen: &'a SeenObjects,
}

impl Planner<'_> {
    fn plan_log(
        &self,
        log_path: &str,
        (files, fault): &(LogFiles, Option<Diagnostic>),
        before: Option<&LogRecord>,
    ) -> Result<WorkItem, Skipped> {
        let stat = FileStat::of_log(files, self.seen, &self.config.document.identity);
        let is_unlisted = fault.as_ref().is_some_and(|fault| is_unlisted(&fault.code));
        let why = self.reason(before, stat.as_ref()).or(is_unlisted.then_some(WorkReason::Unlisted));
        let why = why.ok_or(Skipped::Known)?;
        // A log that cannot be identified is always processed, or its error would never be reported.
        let flight = || {
            before.and_then(flight_of).or_else(|| Some(identify(files, None, log_path, self.config).ok()?.0))
        };
        let asked =
            !self.request.is_narrow() || flight().is_none_or(|f| self.request.wants(&f, self.installations));
        if !asked {
            return Err(Skipped::NotAsked);
        }
        let (files, fault, log_path) = (files.clone(), fault.clone(), log_path.to_owned());
        Ok(WorkItem { files, fault, log_path, stat, why, before: before.cloned() })
    }

    /// Why this log is processed in this run, or nothing when it is up to date.
    fn reason(&self, account: Option<&LogRecord>, stat: Option<&FileStat>) -> Option<WorkReason> {
        let Some(account) = account else { return Some(WorkReason::New) };
        let positions = || account.positions.iter().filter_map(|position| Position::new(position).ok());
        let digest = |flight| {
            config_digest(self.config, self.installations, &flight, &positions().collect::<Vec<_>>())
        };
        let settings = flight_of(account).map_or_else(|| self.unidentified.to_owned(), digest);
        if self.request.redo {
            Some(WorkReason::Asked)
        } else if !stat.is_some_and(|stat| stat.is_of(account)) {
            Some(WorkReason::ContentChanged)
        } else if account.config_digest.as_deref() != Some(&settings) || self.is_forbidden(account) {
            Some(WorkReason::SettingChanged)
        } else if self.is_orphan(account) {
            Some(WorkReason::OwnerGone)
        } else if account.error_code.as_deref().is_some_and(is_passing) {
            Some(WorkReason::Unfetched)
        } else if self.config.document.logs.pieces.is_some()
            && account.error_code.as_deref() == Some("pieces_undeclared")
        {
            Some(WorkReason::SettingChanged)
        } else if self.request.retry && account.outcome == LogOutcome::Error {
            Some(WorkReason::Retry)
        } else if self.request.verify_content {
            Some(WorkReason::Verify)
        } else {
            None
        }
    }

    /// Whether `logs.tails` forbids the tail of a log that was processed.
    fn is_forbidden(&self, account: &LogRecord) -> bool {
        let tail = account.tail_number.as_ref().and_then(|tail| TailNumber::new(tail).ok());
        tail.is_some_and(|tail| self.config.document.logs.forbidden_by(&account.log_path, &tail).is_some())
    }

    /// A log that yielded its flight to another log, which no longer owns it.
    fn is_orphan(&self, account: &LogRecord) -> bool {
        let keys = if is_silent(account) { account.keys() } else { Vec::new() };
        !keys.is_empty() && keys.iter().all(|key| !self.owned.contains(key))
    }
}

/// Whether a sound log has no record of its own.
fn is_silent(account: &LogRecord) -> bool {
    let sound = account.outcome.is_success() || account.error_code.as_deref() == Some("duplicate_flight");
    sound && account.estimated + account.refused == 0
}
