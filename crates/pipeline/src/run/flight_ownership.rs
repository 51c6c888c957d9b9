//! Flight ownership: two logs may hold the same flight, and the owner must not depend on the order of arrival.
//!
//! The log that has the flight in the store keeps it: a later log takes nothing away. Of two logs that
//! are new, the one whose name sorts first owns the flight. A copy with the same content is skipped without an error; a
//! log of the same flight with other content is in error, and the error names the owner. Logs with one flight id and
//! departures a few hours apart may be pieces of one flight: unless the configuration declares what they are, all of them
//! that are not stored are in error.

use std::collections::{BTreeSet, HashMap};
use std::hash::{DefaultHasher, Hash, Hasher};

use job::Config;
use job::flight_log::{duplicate_flight, may_be_pieces, pieces_undeclared, sample_digest};
use records::{Diagnostic, GapRecord, Installations};
use store::{LogOutcome, LogRecord, LogResult, RecordKey};

use crate::fleet_trends::assess::Unit;
use crate::run::event::Event;
use crate::run::plan::{Plan, WorkItem};
use crate::run::summary::{self, DuplicateLog, RunSummary};

/// Outcome of one log.
pub(crate) enum LogOutcomeData {
    /// The content is known; only name or date is new.
    Same(Box<LogRecord>),
    /// The log was read.
    Read {
        /// Its status.
        account: Box<LogRecord>,
        /// Its records.
        records: Vec<GapRecord>,
        /// Its errors.
        diagnostics: Vec<Diagnostic>,
    },
}

impl LogOutcomeData {
    pub(crate) fn event(&self, work: &WorkItem) -> Event {
        let (log, bytes) = (work.log_path.clone(), work.stat.as_ref().map_or(0, |s| s.size_bytes as u64));
        let (estimated, refused, diagnostics) = match self {
            Self::Read { account, diagnostics, .. } => {
                (account.estimated as usize, account.refused as usize, diagnostics.clone())
            }
            Self::Same(_) => (0, 0, Vec::new()),
        };
        Event::Finished { log, bytes, estimated, refused, diagnostics }
    }
}

/// Ledger of the writer: which log owns which flight, in the store and after this run.
pub(crate) struct OwnershipLedger<'a> {
    config: &'a Config,
    installations: &'a Installations,
    plan: &'a Plan,
    accounts: HashMap<String, LogRecord>,
    owners: HashMap<RecordKey, String>,
    /// Logs by the hash of their tail and flight id, unless the configuration declares whether they are pieces.
    same_id: HashMap<u64, Vec<String>>,
    /// Units whose records changed.
    pub(crate) touched: BTreeSet<Unit>,
    /// Records that were removed and not stored again.
    withdrawn: BTreeSet<RecordKey>,
}

impl<'a> OwnershipLedger<'a> {
    pub(crate) fn of(plan: &'a Plan, config: &'a Config, installations: &'a Installations) -> Self {
        let mut ledger = Self {
            config,
            installations,
            plan,
            accounts: HashMap::new(),
            owners: HashMap::new(),
            same_id: HashMap::new(),
            touched: BTreeSet::new(),
            withdrawn: BTreeSet::new(),
        };
        if !plan.work.is_empty() {
            plan.accounts.values().for_each(|account| ledger.insert(account.clone()));
        }
        ledger
    }

    /// Status of all logs, after this run.
    pub(crate) fn accounts(&self) -> impl Iterator<Item = &LogRecord> + Clone {
        let unchanged = self.plan.work.is_empty().then(|| self.plan.accounts.values());
        self.accounts.values().chain(unchanged.into_iter().flatten())
    }

    fn insert(&mut self, account: LogRecord) {
        let names = account.record_keys();
        self.owners.extend(names.into_iter().map(|name| (name, account.log_path.clone())));
        if self.config.document.logs.pieces.is_none()
            && let Some(id) = hash_of_id(&account)
        {
            let logs = self.same_id.entry(id).or_default();
            if !logs.contains(&account.log_path) {
                logs.push(account.log_path.clone());
            }
        }
        self.accounts.insert(account.log_path.clone(), account);
    }

    /// Converts the outcome of a log to rows, and counts it.
    pub(crate) fn resolve(&mut self, done: LogOutcomeData, report: &mut RunSummary) -> Vec<LogResult> {
        match done {
            LogOutcomeData::Same(account) => {
                report.known += 1;
                let keys = account.record_keys();
                let owner = keys
                    .iter()
                    .find_map(|key| self.owners.get(key))
                    .filter(|owner| **owner != account.log_path);
                if let Some(owner) = owner.filter(|_| account.estimated + account.refused == 0) {
                    report
                        .duplicates
                        .push(DuplicateLog { log: account.log_path.clone(), owner: owner.clone() });
                }
                self.insert((*account).clone());
                vec![LogResult { account: *account, records: Vec::new(), retires: Vec::new() }]
            }
            LogOutcomeData::Read { account, records, diagnostics } => {
                self.read(*account, records, &diagnostics, report)
            }
        }
    }

    fn read(
        &mut self,
        account: LogRecord,
        records: Vec<GapRecord>,
        diagnostics: &[Diagnostic],
        report: &mut RunSummary,
    ) -> Vec<LogResult> {
        let pieces = self.undeclared_pieces(&account);
        if !pieces.is_empty() {
            return self.refuse_pieces(account, diagnostics, pieces, report);
        }
        let Some(competing_log) = self.competing_log(&account, &records) else {
            return vec![self.store(account, records, diagnostics, report)];
        };
        let same =
            account.log_digest == competing_log.log_digest || self.holds_the_same(&account, &competing_log);
        let is_behind = self.precedes(&competing_log, &account);
        if same {
            let (log, owner) =
                if is_behind { (&account, &competing_log) } else { (&competing_log, &account) };
            let (log, owner) = (log.log_path.clone(), owner.log_path.clone());
            report.duplicates.push(DuplicateLog { log, owner });
        }
        if is_behind {
            let (account, diagnostics) = superseded(account, &competing_log, same);
            return vec![self.store(account, Vec::new(), &diagnostics, report)];
        }
        let first = self.store(account, records, diagnostics, report);
        let (loser, diagnostics) = superseded(competing_log, &first.account, same);
        vec![first, self.store(loser, Vec::new(), &diagnostics, report)]
    }

    /// Whether a log comes before another in the ownership of a flight that both hold: the stored one, else by name.
    fn precedes(&self, one: &LogRecord, other: &LogRecord) -> bool {
        match (self.is_stored(one), self.is_stored(other)) {
            (true, false) => true,
            (false, true) => false,
            _ => one.log_path < other.log_path,
        }
    }

    /// Whether the store had records of a log's flight before this run.
    fn is_stored(&self, log: &LogRecord) -> bool {
        self.plan.accounts.get(&log.log_path).is_some_and(|before| {
            before.estimated + before.refused > 0
                && (&before.tail_number, before.departure_utc) == (&log.tail_number, log.departure_utc)
        })
    }

    /// Logs with the tail, flight id and a position of this one, and another departure close by. What became of them does
    /// not matter: the answer must not depend on the order of the logs.
    fn undeclared_pieces(&self, account: &LogRecord) -> Vec<LogRecord> {
        let Some(logs) = hash_of_id(account).and_then(|id| self.same_id.get(&id)) else { return Vec::new() };
        let is_piece = |other: &&LogRecord| {
            let departures = account.departure_utc.zip(other.departure_utc);
            other.log_path != account.log_path
                && other.tail_number == account.tail_number
                && other.flight_id == account.flight_id
                && other.positions.iter().any(|position| account.positions.contains(position))
                && departures.is_some_and(|(own, others)| may_be_pieces(own, others))
        };
        let mut found: Vec<LogRecord> =
            logs.iter().filter_map(|log| self.accounts.get(log)).filter(is_piece).cloned().collect();
        found.sort_by(|a, b| a.log_path.cmp(&b.log_path));
        found
    }

    /// Neither a log nor those that may be other pieces of its flight have records, but for those that are stored.
    fn refuse_pieces(
        &mut self,
        account: LogRecord,
        diagnostics: &[Diagnostic],
        pieces: Vec<LogRecord>,
        report: &mut RunSummary,
    ) -> Vec<LogResult> {
        let refused = |mut account: LogRecord, other: &LogRecord| {
            let departures = account.departure_utc.zip(other.departure_utc);
            let (own, others) = departures.unwrap_or_default();
            let diagnostic = pieces_undeclared(&account.log_path, own, &other.log_path, others);
            (account.estimated, account.refused) = (0, 0);
            summary::set_error(&mut account, std::slice::from_ref(&diagnostic));
            (account, vec![diagnostic])
        };
        // A log with an error of its own keeps it.
        let (own, diagnostics) = if diagnostics.is_empty() {
            refused(account, &pieces[0])
        } else {
            (account, diagnostics.to_vec())
        };
        let mut results = vec![self.store(own.clone(), Vec::new(), &diagnostics, report)];
        let pieces = pieces.into_iter().filter(|piece| piece.estimated + piece.refused > 0);
        for piece in pieces.filter(|piece| !self.is_stored(piece)).collect::<Vec<_>>() {
            let (piece, diagnostics) = refused(piece, &own);
            results.push(self.store(piece, Vec::new(), &diagnostics, report));
        }
        results
    }

    /// Whether two logs hold the same samples in different encodings. Rare, so both are read.
    fn holds_the_same(&self, one: &LogRecord, other: &LogRecord) -> bool {
        let digest = |account: &LogRecord| {
            let files = self.plan.files.get(&account.log_path)?;
            sample_digest(files, &account.log_path, self.config, self.installations).ok()
        };
        digest(one).is_some_and(|one| digest(other) == Some(one))
    }

    /// Another log that owns one of these flights.
    fn competing_log(&self, account: &LogRecord, records: &[GapRecord]) -> Option<LogRecord> {
        let owner = |r: &GapRecord| self.owners.get(&RecordKey::of(r));
        let other = records.iter().filter_map(owner).find(|path| **path != account.log_path)?;
        self.accounts.get(other).cloned()
    }

    fn store(
        &mut self,
        account: LogRecord,
        records: Vec<GapRecord>,
        diagnostics: &[Diagnostic],
        report: &mut RunSummary,
    ) -> LogResult {
        report.count(&account, &records, diagnostics);
        let unit = |r: &GapRecord| (r.part_number.clone(), r.serial_number.clone());
        self.touched.extend(records.iter().map(unit));
        let retires = self.stale_records(&account, &records);
        self.withdrawn.extend(retires.iter().cloned());
        for record in &records {
            self.withdrawn.remove(&RecordKey::of(record));
        }
        report.withdrawn = self.withdrawn.len();
        self.insert(account.clone());
        let is_owner = |r: &GapRecord| self.owners.get(&RecordKey::of(r)) == Some(&account.log_path);
        debug_assert!(records.iter().all(is_owner), "{} owns its flights", account.log_path);
        LogResult { account, records, retires }
    }

    /// Records of this log under another identity, or for positions it no longer has.
    fn stale_records(&mut self, account: &LogRecord, records: &[GapRecord]) -> Vec<RecordKey> {
        let Some(before) = self.accounts.get(&account.log_path) else { return Vec::new() };
        let now: BTreeSet<RecordKey> = records.iter().map(RecordKey::of).collect();
        let mine = |name: &RecordKey| self.owners.get(name) == Some(&account.log_path);
        let gone: Vec<RecordKey> =
            before.record_keys().into_iter().filter(|n| mine(n) && !now.contains(n)).collect();
        for name in &gone {
            self.owners.remove(name);
        }
        gone
    }
}

/// Hash of the tail and the flight id of a log that was identified.
fn hash_of_id(account: &LogRecord) -> Option<u64> {
    let id = account.tail_number.as_ref().zip(account.flight_id.as_ref())?;
    let mut hash = DefaultHasher::new();
    id.hash(&mut hash);
    Some(hash.finish())
}

/// Status of a log whose flight belongs to another log.
fn superseded(mut account: LogRecord, owner: &LogRecord, is_same: bool) -> (LogRecord, Vec<Diagnostic>) {
    (account.estimated, account.refused) = (0, 0);
    account.outcome = LogOutcome::Done;
    if is_same {
        account.error_detail = Some(format!("copy of {}", owner.log_path));
        return (account, Vec::new());
    }
    let diagnostic = duplicate_flight(&account.log_path, &owner.log_path);
    summary::set_error(&mut account, std::slice::from_ref(&diagnostic));
    (account, vec![diagnostic])
}
