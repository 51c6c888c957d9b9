//! Run summary: counts and findings of a run; every log is in exactly one count.

use std::collections::{BTreeMap, BTreeSet};

use jiff::Timestamp;
use job::Config;
use records::time::days_between;
use records::{Diagnostic, Installations, QuantityChange, TrendRow};
use store::{LogOutcome, LogRecord, RunRecord};
use trend::State;

use crate::assess::changes::UnitChange;
use crate::error::is_passing;
use crate::findings::monitoring::REPORTED_DAYS;
use crate::findings::monitoring::coverage::{self, UnknownTail, UnmappedPositions};
use crate::findings::monitoring::mapping_faults::MappingFault;
use crate::findings::monitoring::recorder_change::{RecorderChange, recorder_changes};
use crate::findings::monitoring::repeated_samples::RepeatedSamples;
use crate::findings::summary::FollowUpSummary;
use crate::fleet::bookkeeping::dates_ahead::DateAhead;
use crate::fleet::bookkeeping::join::MovedFlights;
use crate::fleet::bookkeeping::maintenance_log::UnknownUnit;
use crate::fleet::histories::UnitKey;
use crate::logs::plan::{Plan, StandingError, WorkItem};

/// Error of a log.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct LogError {
    /// The log.
    pub log: String,
    /// The error.
    #[serde(rename = "complaint")]
    pub diagnostic: Diagnostic,
}

/// Records without a gap for one reason.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
#[expect(missing_docs, reason = "each field is named for what it holds")]
pub struct Refusals {
    pub reason: String,
    pub count: usize,
    pub remedy: Option<&'static str>,
}

/// A log with the same samples as another one, which owns the flight.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct DuplicateLog {
    /// The log.
    pub log: String,
    /// The log whose records are stored.
    pub owner: String,
}

/// An aircraft without data while others have some.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
#[expect(missing_docs, reason = "each field is named for what it holds")]
pub struct SilentTail {
    pub tail_number: String,
    /// Its newest departure in the store, or when its first unit was installed.
    pub since_utc: Timestamp,
}

/// Aircraft without data for longer than `days` before a date: the fleet's newest departure, or now. An aircraft that never
/// had a log has no data since its first unit was installed; one without a unit needs no data.
fn quiet<'a>(
    accounts: impl Iterator<Item = &'a LogRecord>,
    installations: &'a Installations,
    days: f64,
    last: Option<Timestamp>,
) -> Vec<SilentTail> {
    let Some(last) = last else { return Vec::new() };
    let mut newest: BTreeMap<&str, Timestamp> = BTreeMap::new();
    for (tail, at) in accounts.filter_map(|a| Some((a.tail_number.as_deref()?, a.departure_utc?))) {
        newest.entry(tail).and_modify(|known| *known = (*known).max(at)).or_insert(at);
    }
    let mut silent: BTreeMap<&str, Timestamp> = BTreeMap::new();
    for installation in installations.iter().filter(|installation| installation.covers(last)) {
        let tail = installation.tail_number.as_str();
        let since_utc = newest.get(tail).copied().unwrap_or(installation.installed_utc);
        silent.entry(tail).and_modify(|known| *known = (*known).min(since_utc)).or_insert(since_utc);
    }
    let late = silent.into_iter().filter(|(_, at)| days_between(*at, last) > days);
    late.map(|(tail, since_utc)| SilentTail { tail_number: tail.to_owned(), since_utc }).collect()
}

/// Summary of a run.
#[derive(Debug, Clone, Default, PartialEq, serde::Serialize)]
#[expect(missing_docs, reason = "each field is named for what it holds")]
pub struct RunSummary {
    pub run_id: String,
    pub started_utc: Timestamp,
    /// Earlier runs without an end: they were killed, or their disk failed.
    pub cut_short: Vec<RunRecord>,
    pub found: usize,
    pub known: usize,
    /// Logs excluded by the selection.
    pub not_asked: usize,
    /// Logs left for later by `--limit`.
    pub left: usize,
    /// Logs processed, failed ones included.
    pub done: usize,
    pub flights: usize,
    pub estimated: usize,
    /// Records of rejected flights, by reason.
    pub refused: BTreeMap<String, usize>,
    /// The same with the remedy of each reason.
    pub refusals: Vec<Refusals>,
    /// Logs of this run that are copies of other logs.
    pub duplicates: Vec<DuplicateLog>,
    /// Parts, tails and actuators most of whose latest flights are rejected for a wrong mapping.
    pub mapping_faults: Vec<MappingFault>,
    /// Stored records that stay as they are because their log failed in this run.
    pub kept: usize,
    /// Flights that a corrected table gave to another unit.
    pub moved: Vec<MovedFlights>,
    /// Units of the maintenance and the inspections table that the installations table does not know.
    pub unknown_units: Vec<UnknownUnit>,
    /// Dates of the installations table that are still to come.
    pub dates_ahead: Vec<DateAhead>,
    /// Installed positions that no log has, of the aircraft with logs.
    pub unmapped_positions: Vec<UnmappedPositions>,
    /// Tails of the flights table and of overrides that neither installations nor logs have.
    pub unknown_tails: Vec<UnknownTail>,
    /// Limits and hours that the assessments of the fleet lack, in words.
    pub notes: Vec<String>,
    /// Logs of earlier runs that no pattern matches any more; their records stay.
    pub absent: usize,
    pub errors: Vec<LogError>,
    pub not_reached: usize,
    pub not_reached_logs: Vec<String>,
    /// Aircraft whose newest departure is older than the fleet's by more than `stale_after_days`.
    pub quiet: Vec<SilentTail>,
    /// Number of tails without data for longer than `trend.stale_after_days` before now.
    #[serde(skip)]
    pub quiet_now: usize,
    /// Number of installed units whose newest gap is older than `trend.stale_after_days` before now.
    #[serde(skip)]
    pub stale_now: usize,
    #[serde(skip)]
    pub newest_departure_utc: Option<Timestamp>,
    /// Skews, and stiffnesses of complete aircraft, that moved within the last month, on the aircraft of this run.
    pub recorder_moved: Vec<RecorderChange>,
    /// Followed quantities that changed within the last month, on units, tails and parts of the whole fleet.
    pub quantity_changes: Vec<QuantityChange>,
    /// Pairs of flights of the last months with the samples of one.
    pub samples_repeated: Vec<RepeatedSamples>,
    /// The slowest log and its seconds.
    pub slowest: Option<(String, f64)>,
    pub took_s: f64,
    pub workers: usize,
    /// Assessments of the units whose records changed.
    pub trends: Vec<TrendRow>,
    /// Units whose state or events differ from those after the run before, each with its cause.
    pub changed: Vec<UnitChange>,
    /// Failed logs of earlier runs, reported until they are fixed.
    pub standing_errors: Vec<StandingError>,
    /// Units of the whole fleet in state `watch`, `plan` or `act`, also when the run had nothing new.
    pub work_list: Vec<TrendRow>,
    #[serde(flatten)]
    pub follow_up: FollowUpSummary,
    #[serde(skip)]
    pub states: BTreeMap<&'static str, usize>,
    /// Logs in error whose other actuators are stored.
    #[serde(skip)]
    pub logs_in_part: usize,
}

/// How a run ended, with the exit code of its record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RunEnd {
    /// Every log was processed.
    Complete = 0,
    /// Every log was processed, and some failed or are mapped wrongly.
    LogsInError = 1,
    /// An interrupt left logs for the next run.
    Interrupted = 130,
}

impl RunSummary {
    pub(crate) fn begin(run_id: String, started_utc: Timestamp, plan: &Plan, workers: usize) -> Self {
        Self {
            run_id,
            started_utc,
            found: plan.found,
            known: plan.known,
            not_asked: plan.not_asked,
            left: plan.left,
            absent: plan.absent,
            not_reached: plan.work.len(),
            workers,
            standing_errors: plan.standing_errors.clone(),
            ..Self::default()
        }
    }

    /// Adds the assessments of all units, and of those that the run touched as its own.
    pub(crate) fn add_assessments(
        &mut self,
        mut now: Vec<TrendRow>,
        touched: &BTreeSet<UnitKey>,
        stale_after_days: f64,
    ) {
        let states = now.iter().filter_map(|row| row.state);
        states.for_each(|state| *self.states.entry(state).or_default() += 1);
        let is_stale = |row: &&TrendRow| {
            let newest = row.latest_utc.filter(|_| row.state.is_some());
            newest.is_some_and(|at| days_between(at, Timestamp::now()) > stale_after_days)
        };
        self.stale_now = now.iter().filter(is_stale).count();
        let needs_attention =
            |row: &&TrendRow| row.state.is_some_and(|state| state != State::Normal.as_str());
        self.work_list = now.iter().filter(needs_attention).cloned().collect();
        now.retain(|row| touched.contains(&row.unit()));
        self.trends = now;
    }

    /// Adds the changes of quantities within the last month before the newest flight; of recorders, those on the aircraft
    /// of the run's units.
    pub(crate) fn add_quantity_changes(&mut self, changes: Vec<QuantityChange>, newest: Timestamp) {
        let tails: BTreeSet<&str> = self.trends.iter().filter_map(|row| row.tail_number.as_deref()).collect();
        self.recorder_moved = recorder_changes(&changes, newest);
        self.recorder_moved.retain(|moved| tails.contains(moved.tail_number.as_str()));
        self.quantity_changes = changes;
        self.quantity_changes.retain(|change| days_between(change.since_utc, newest) <= REPORTED_DAYS);
    }

    /// Adds what the status of all logs shows about the aircraft.
    pub(crate) fn add_coverage<'a>(
        &mut self,
        accounts: impl Iterator<Item = &'a LogRecord> + Clone,
        gone: impl Iterator<Item = &'a LogRecord> + Clone,
        config: &Config,
        installations: &'a Installations,
    ) {
        let days = config.document.trend.stale_after_days;
        let newest = accounts.clone().filter_map(|account| account.departure_utc).max();
        self.newest_departure_utc = newest;
        // Also a log that was deleted or that no pattern matches any more was data.
        let all = accounts.clone().chain(gone.filter(move |account| account.departure_utc <= newest));
        self.quiet = quiet(all.clone(), installations, days, self.newest_departure_utc);
        self.quiet_now = quiet(all, installations, days, Some(Timestamp::now())).len();
        self.notes.extend(coverage::departures_in_another_zone(config, accounts.clone()));
        self.notes.extend(coverage::logs_without_row(config, accounts.clone()));
        self.unmapped_positions = coverage::unmapped_positions(accounts.clone(), installations);
        self.unknown_tails = coverage::unknown_tails(config, installations, accounts);
    }

    /// Records without a gap.
    pub fn refusals(&self) -> usize {
        self.refused.values().sum()
    }

    /// Whether logs were left out: by the request, its limit, or because the run stopped.
    pub fn is_partial(&self) -> bool {
        self.not_reached + self.left + self.not_asked > 0
    }

    /// Whether a wrong mapping shows in flights of this run.
    pub(crate) fn has_mapping_fault(&self) -> bool {
        let units: BTreeSet<UnitKey> = self.trends.iter().map(TrendRow::unit).collect();
        self.mapping_faults.iter().any(|fault| !fault.units.is_disjoint(&units))
    }

    /// Logs in error; one log may have several diagnostics.
    pub fn logs_in_error(&self) -> usize {
        let mut logs: Vec<&str> = self.errors.iter().map(|e| e.log.as_str()).collect();
        logs.dedup();
        logs.len()
    }

    /// Failed logs of earlier runs that no pattern of `logs.acknowledged_errors` fits.
    pub fn unacknowledged(&self) -> usize {
        self.standing_errors.iter().filter(|error| !error.is_acknowledged).count()
    }

    /// How the run ended; `stopped` when it received an interrupt.
    pub fn end(&self, stopped: bool) -> RunEnd {
        let is_sound = self.errors.is_empty() && self.unacknowledged() == 0 && !self.has_mapping_fault();
        match (stopped && self.not_reached > 0, is_sound) {
            (true, _) => RunEnd::Interrupted,
            (false, false) => RunEnd::LogsInError,
            (false, true) => RunEnd::Complete,
        }
    }

    /// The row kept in the store; of a run that ended, with its exit code and the digest of its tables.
    pub(crate) fn row(
        &self,
        program_version: &str,
        config_path: &str,
        ended: Option<(i64, &str)>,
    ) -> RunRecord {
        RunRecord {
            run_id: self.run_id.clone(),
            started_utc: self.started_utc,
            finished_utc: ended.map(|_| Timestamp::now()),
            program_version: program_version.to_owned(),
            config_path: config_path.to_owned(),
            found: self.found as i64,
            known: self.known as i64,
            done: self.done as i64,
            estimated: self.estimated as i64,
            refused: self.refusals() as i64,
            errors: self.logs_in_error() as i64,
            not_reached: self.not_reached as i64,
            exit_code: ended.map(|(code, _)| code),
            tables_digest: ended.map(|(_, digest)| digest.to_owned()),
        }
    }
}

/// Status of one log, before its flight is identified.
pub(crate) fn of_log(work: &WorkItem, run_id: &str) -> LogRecord {
    let stat = work.stat.as_ref();
    LogRecord {
        log_path: work.log_path.clone(),
        size_bytes: stat.map_or(0, |s| s.size_bytes),
        modified_utc_ns: stat.map_or(0, |s| s.modified_utc_ns),
        file_id: stat.map(|s| s.file_id.clone()).unwrap_or_default(),
        run_id: run_id.to_owned(),
        processed_utc: Timestamp::now(),
        ..LogRecord::default()
    }
}

pub(crate) fn not_reached(work: &WorkItem, run_id: &str) -> LogRecord {
    LogRecord { outcome: LogOutcome::NotReached, ..of_log(work, run_id) }
}

/// Writes diagnostics into a log's status: the code of the first, and all of their text. A cause that may pass goes before
/// the others, since the next run tries the log again for it.
pub(crate) fn set_error(account: &mut LogRecord, diagnostics: &[Diagnostic]) {
    let passing = diagnostics.iter().find(|diagnostic| is_passing(&diagnostic.code));
    let Some(first) = passing.or(diagnostics.first()) else { return };
    account.outcome = LogOutcome::Error;
    account.error_code = Some(first.code.clone());
    let all: Vec<String> = diagnostics.iter().map(ToString::to_string).collect();
    account.error_detail = Some(all.join("\n"));
}
