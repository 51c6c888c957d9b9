//! Flight ownership: two logs may hold the same flight, and the owner must not depend on the order of arrival.
//!
//! A record is only replaced by a record of the same tail, flight and position. For each position the better record
//! counts: one with a gap before a refused one, then the stored one, then that of the log whose name sorts first. A copy
//! with the same content is skipped without an error; a log of the same flight with other content is in error, and the
//! error names the owner. Logs with one flight id and departures a few hours apart may be pieces of one flight: unless the
//! configuration declares what they are, all of them that are not stored are in error.
//!
//! A log that fails, or lost a position, takes nothing away: its last good records stay.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::hash::{DefaultHasher, Hash, Hasher};

use job::Config;
use job::flight_log::{duplicate_flight, may_be_pieces, pieces_undeclared};
use records::{Diagnostic, GapRecord, Status};
use serde::{Deserialize, Serialize};
use store::{HeldRecord, LogOutcome, LogRecord, LogResult, RecordKey, Writer};

use crate::fleet::histories::UnitKey;
use crate::logs::plan::{self, Plan, WorkItem};
use crate::run::summary::{self, DuplicateLog, LogError, Refusals, RunSummary};
use crate::{Error, Event};

/// By how much a corrected departure may differ from the one before, µs: a month is easily mistaken.
const MOST_CORRECTED_US: i64 = 40 * 24 * 3_600 * 1_000_000;

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct ProcessedLog {
    /// Its status: `known` where its content and settings are those of stored records, so that only its name or its date is
    /// new.
    pub(crate) account: LogRecord,
    pub(crate) records: Vec<GapRecord>,
    pub(crate) diagnostics: Vec<Diagnostic>,
}

impl ProcessedLog {
    pub(crate) fn without_records(account: LogRecord, diagnostics: Vec<Diagnostic>) -> Self {
        Self { account, records: Vec::new(), diagnostics }
    }

    pub(crate) fn in_error(mut account: LogRecord, diagnostic: Diagnostic) -> Self {
        summary::set_error(&mut account, std::slice::from_ref(&diagnostic));
        Self::without_records(account, vec![diagnostic])
    }

    /// Whether the content is known, so that no record was made.
    pub(crate) fn is_known(&self) -> bool {
        self.account.outcome == LogOutcome::Known
    }

    pub(crate) fn event(&self, work: &WorkItem) -> Event {
        let (log, bytes) = (work.log_path.clone(), work.stat.as_ref().map_or(0, |s| s.size_bytes as u64));
        let refused = self.records.iter().filter(|record| record.estimate.status == Status::Refused).count();
        let estimated = self.records.len() - refused;
        Event::Finished { log, bytes, estimated, refused, diagnostics: self.diagnostics.clone() }
    }
}

/// Ledger of the writer: which log owns which flight, in the store and after this run.
pub(crate) struct OwnershipLedger<'a> {
    config: &'a Config,
    plan: &'a Plan,
    accounts: HashMap<String, LogRecord>,
    own: HashMap<RecordKey, OwnRecord>,
    errors: BTreeMap<String, Vec<Diagnostic>>,
    /// Logs that contradict the record of one which this run has not processed yet: it may be of another flight now.
    waiting: BTreeMap<String, ProcessedLog>,
    /// Logs by the hash of their tail and flight id, unless the configuration declares whether they are pieces.
    same_id: HashMap<u64, Vec<String>>,
    pub(crate) touched: BTreeSet<UnitKey>,
    /// New paths of logs that were renamed, by their old ones.
    pub(crate) renamed: BTreeMap<String, String>,
}

struct OwnRecord {
    held: HeldRecord,
    /// Why it has no gap.
    refused: Option<String>,
}

/// Keys of stored records whose samples are stored under another one now, each with the digest of its log.
type MovedKeys = Vec<(RecordKey, String)>;

/// What becomes of a record that another log holds too.
enum Claim {
    /// The new record counts.
    Takes,
    /// The other log's record stays; it has the same samples.
    IsCopy,
    /// The other log's record stays, since it has a gap and the new one has none.
    IsWorse,
    /// The other log's record stays, and the two contradict each other.
    Contradicts,
}

impl<'a> OwnershipLedger<'a> {
    pub(crate) fn of(plan: &'a Plan, config: &'a Config) -> Self {
        let mut ledger = Self {
            config,
            plan,
            accounts: HashMap::new(),
            own: HashMap::new(),
            errors: BTreeMap::new(),
            waiting: BTreeMap::new(),
            same_id: HashMap::new(),
            touched: BTreeSet::new(),
            renamed: BTreeMap::new(),
        };
        if !plan.work.is_empty() {
            plan.accounts.values().for_each(|account| ledger.insert(account.clone()));
        }
        ledger
    }

    pub(crate) fn accounts(&self) -> impl Iterator<Item = &LogRecord> + Clone {
        let unchanged = self.plan.work.is_empty().then(|| self.plan.accounts.values());
        self.accounts.values().chain(unchanged.into_iter().flatten())
    }

    /// Planned logs that a run has no outcome of, by name.
    pub(crate) fn not_reached(&self, run_id: &str) -> Vec<String> {
        let is_reached =
            |log: &String| self.accounts.get(log).is_some_and(|account| account.run_id == run_id);
        self.plan.work.iter().map(|work| &work.log_path).filter(|log| !is_reached(log)).cloned().collect()
    }

    /// Adds up the logs that this run has processed, and their records.
    pub(crate) fn add_up(&self, report: &mut RunSummary) {
        report.done = self.errors.len();
        report.duplicates.sort_by(|a, b| a.log.cmp(&b.log));
        for record in self.own.values() {
            match &record.refused {
                Some(reason) => *report.refused.entry(reason.clone()).or_default() += 1,
                None => report.estimated += 1,
            }
        }
        let refusals = |(reason, count): (&String, &usize)| Refusals {
            reason: reason.clone(),
            count: *count,
            remedy: job::rejection::remedy(reason),
        };
        report.refusals = report.refused.iter().map(refusals).collect();
        let with_records: BTreeSet<&str> = self.own.values().map(|own| own.held.log_path.as_str()).collect();
        let accounts = with_records.iter().filter_map(|log| self.accounts.get(*log));
        let flights =
            accounts.map(|account| (&account.tail_number, &account.flight_id, account.departure_utc));
        report.flights = flights.collect::<BTreeSet<_>>().len();
        for (log, errors) in &self.errors {
            let is_stored = with_records.contains(log.as_str());
            report.logs_in_part += usize::from(is_stored && !errors.is_empty());
            let error =
                |diagnostic: &Diagnostic| LogError { log: log.clone(), diagnostic: diagnostic.clone() };
            report.errors.extend(errors.iter().map(error));
            let seconds = self.accounts.get(log).map_or(0.0, |account| account.duration_s);
            if report.slowest.as_ref().is_none_or(|(_, most)| *most < seconds) {
                report.slowest = Some((log.clone(), seconds));
            }
        }
    }

    fn insert(&mut self, account: LogRecord) {
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
    pub(crate) fn resolve(
        &mut self,
        done: ProcessedLog,
        writer: &Writer,
        report: &mut RunSummary,
    ) -> Result<Vec<LogResult>, Error> {
        if done.is_known() {
            return Ok(vec![self.take_over(done.account, report)]);
        }
        let ProcessedLog { mut account, records, mut diagnostics } = done;
        let pieces = self.undeclared_pieces(&account);
        if !pieces.is_empty() {
            return Ok(self.refuse_pieces(account, diagnostics, pieces, report));
        }
        let held = self.held(&account, &records, writer)?;
        let claim = |record: &GapRecord| {
            let key = RecordKey::of(record);
            held.get(&key).map(|other| (self.claim(&account, &HeldRecord::of(record), &key, other), other))
        };
        let claims: Vec<_> = records.iter().map(claim).collect();
        let is_open = |(claim, other): &(Claim, &HeldRecord)| {
            matches!(claim, Claim::Contradicts) && self.is_awaited(&other.log_path, &account.run_id)
        };
        if claims.iter().flatten().any(is_open) {
            self.waiting.insert(account.log_path.clone(), ProcessedLog { account, records, diagnostics });
            return Ok(Vec::new());
        }
        let (moved_from, left) = self.moved_from(&account, &records, writer)?;
        let (mut kept, mut displaced) = (Vec::new(), BTreeMap::<String, bool>::new());
        let (mut copy_of, mut contradicts, mut worse_than) = (None, None, None);
        for (record, claim) in records.into_iter().zip(claims) {
            let Some((claim, other)) = claim else {
                kept.push(record);
                continue;
            };
            let owner = other.log_path.clone();
            match claim {
                Claim::Takes => {
                    if self.own.contains_key(&RecordKey::of(&record)) {
                        displaced.entry(owner).or_insert_with(|| other.is_same_as(&HeldRecord::of(&record)));
                    }
                    kept.push(record);
                }
                Claim::IsCopy => copy_of = Some(owner),
                Claim::IsWorse => worse_than = Some(owner),
                Claim::Contradicts => contradicts = Some(owner),
            }
        }
        if let Some(owner) = contradicts {
            diagnostics.push(duplicate_flight(&account.log_path, &owner));
            summary::set_error(&mut account, &diagnostics);
        } else if let Some(owner) = copy_of.filter(|_| kept.is_empty()) {
            account.error_detail = Some(format!("copy of {owner}"));
            report.duplicates.push(DuplicateLog { log: account.log_path.clone(), owner });
        } else if let Some(owner) = worse_than {
            account.error_detail = Some(format!("the records with a gap of {owner} stay"));
        }
        let done = ProcessedLog { account, records: kept, diagnostics };
        let mut results = vec![self.store(done, moved_from, report)];
        results.extend(left);
        for (log, is_same) in displaced {
            let Some(mut loser) = self.accounts.get(&log).cloned() else { continue };
            let left = self.left_to(&loser);
            if !left.is_empty() {
                let estimated = left.iter().filter(|record| record.is_estimated()).count();
                (loser.estimated, loser.refused) = (estimated as i64, (left.len() - estimated) as i64);
                self.insert(loser.clone());
                results.push(LogResult { account: loser, records: Vec::new(), moved_from: Vec::new() });
                continue;
            }
            let loser = superseded(loser, &results[0].account, is_same);
            if is_same {
                let (log, owner) = (log, results[0].account.log_path.clone());
                report.duplicates.push(DuplicateLog { log, owner });
            }
            results.push(self.store(loser, Vec::new(), report));
        }
        Ok(results)
    }

    /// Counts a log of known content, and notes the former path of one that was renamed.
    fn take_over(&mut self, account: LogRecord, report: &mut RunSummary) -> LogResult {
        report.known += 1;
        if let Some(digests) = plan::digests(&account) {
            let is_new_path = !self.plan.accounts.contains_key(&account.log_path);
            let gone = self.plan.gone.get(&digests.0).filter(|_| is_new_path).into_iter().flatten();
            let same = gone.filter(|gone| plan::is_same_flight(gone, &account));
            self.renamed.extend(same.map(|gone| (gone.log_path.clone(), account.log_path.clone())));
        }
        self.insert(account.clone());
        LogResult { account, records: Vec::new(), moved_from: Vec::new() }
    }

    /// The records of this run that a log still has, after another one took some of them.
    fn left_to(&self, log: &LogRecord) -> Vec<&HeldRecord> {
        let keys = log.keys();
        let own = keys.iter().filter_map(|key| self.own.get(key)).map(|own| &own.held);
        own.filter(|held| held.log_path == log.log_path).collect()
    }

    /// The records that other logs hold of the same flights: those of this run, and stored ones.
    fn held(
        &self,
        account: &LogRecord,
        records: &[GapRecord],
        writer: &Writer,
    ) -> Result<BTreeMap<RecordKey, HeldRecord>, Error> {
        let keys: BTreeSet<RecordKey> = records.iter().map(RecordKey::of).collect();
        let (own, others): (BTreeSet<_>, BTreeSet<_>) =
            keys.into_iter().partition(|key| self.own.contains_key(key));
        let mut held = if others.is_empty() { BTreeMap::new() } else { writer.held(&others)? };
        held.extend(own.into_iter().filter_map(|key| Some((key.clone(), self.own.get(&key)?.held.clone()))));
        held.retain(|_, record| record.log_path != account.log_path);
        Ok(held)
    }

    /// What to do with a record of a log if the record of the same flight by another log is held.
    fn claim(&self, account: &LogRecord, new: &HeldRecord, key: &RecordKey, held: &HeldRecord) -> Claim {
        let is_same = held.is_same_as(new);
        let waiting = self.waiting.get(&held.log_path).map(|done| &done.account);
        let holder = waiting.or_else(|| self.accounts.get(&held.log_path));
        // A log that names another flight now has left this one.
        let has_left = holder.is_none_or(|holder| {
            let flight = holder.tail_number.as_ref().zip(holder.departure_utc);
            flight.is_some_and(|(tail, departure)| {
                *tail != key.tail_number || departure.as_microsecond() != key.departure_us
            })
        });
        // A log that broke speaks for no record any more; a copy of what it was takes its place.
        let is_broken = holder.is_some_and(|holder| holder.estimated + holder.refused == 0);
        match (new.is_estimated(), held.is_estimated()) {
            (true, false) => Claim::Takes,
            (false, true) => Claim::IsWorse,
            _ if has_left || (is_broken && is_same) => Claim::Takes,
            _ if self.own.contains_key(key) && self.precedes(account, held) => Claim::Takes,
            _ if is_same => Claim::IsCopy,
            _ => Claim::Contradicts,
        }
    }

    fn is_awaited(&self, log: &str, run_id: &str) -> bool {
        self.accounts.get(log).is_none_or(|account| account.run_id != run_id)
            && self.plan.work.iter().any(|work| work.log_path == log)
    }

    /// Converts the outcomes that waited, after all others. One that waits for a log which the run did not reach is not
    /// reached either.
    pub(crate) fn resolve_waiting(
        &mut self,
        writer: &Writer,
        report: &mut RunSummary,
    ) -> Result<Vec<LogResult>, Error> {
        let mut results = Vec::new();
        for log in self.waiting.keys().cloned().collect::<Vec<_>>() {
            if let Some(done) = self.waiting.remove(&log) {
                results.extend(self.resolve(done, writer, report)?);
            }
        }
        Ok(results)
    }

    /// Whether a log comes before the holder of its flight: the one that was stored before this run, else by name.
    fn precedes(&self, account: &LogRecord, held: &HeldRecord) -> bool {
        let holder = self.accounts.get(&held.log_path);
        match (self.is_stored(account), holder.is_some_and(|holder| self.is_stored(holder))) {
            (true, false) => true,
            (false, true) => false,
            _ => account.log_path < held.log_path,
        }
    }

    /// Whether the store had records of a log's flight before this run.
    fn is_stored(&self, log: &LogRecord) -> bool {
        self.plan
            .accounts
            .get(&log.log_path)
            .is_some_and(|before| before.estimated + before.refused > 0 && plan::is_same_flight(before, log))
    }

    /// Keys and log digests under which the same samples are stored, where this log had another identity, and what is left of
    /// logs of the same content that are gone.
    fn moved_from(
        &self,
        account: &LogRecord,
        records: &[GapRecord],
        writer: &Writer,
    ) -> Result<(MovedKeys, Vec<LogResult>), Error> {
        let own = self.plan.accounts.get(&account.log_path);
        let gone = account.log_digest.as_ref().and_then(|digest| self.plan.gone.get(digest));
        let gone = gone.into_iter().flatten();
        let before = own.into_iter().chain(gone.clone());
        let before = before.filter(|before| !plan::is_same_flight(before, account));
        let keys: BTreeSet<RecordKey> = before.flat_map(LogRecord::keys).collect();
        if keys.is_empty() || records.is_empty() {
            return Ok(Default::default());
        }
        let new: Vec<HeldRecord> = records.iter().map(HeldRecord::of).collect();
        let gone: HashMap<&String, &LogRecord> = gone.map(|log| (&log.log_path, log)).collect();
        let mut held = writer.held(&keys)?;
        // The records of another log that is still there are its own: this one was a copy of it.
        held.retain(|_, stored| {
            (stored.log_path == account.log_path || gone.contains_key(&stored.log_path))
                && new.iter().any(|new| stored.is_same_as(new))
        });
        let (of_gone, own): (Vec<_>, Vec<_>) =
            held.into_iter().partition(|(_, stored)| gone.contains_key(&stored.log_path));
        let of_gone = of_gone.into_iter().map(|(key, stored)| (key, stored, account.log_path.as_str()));
        Ok((own.into_iter().map(|(key, stored)| (key, stored.log_digest)).collect(), left_of(&gone, of_gone)))
    }

    /// Takes back the stored gaps of logs that are gone whose samples this run has stored under another departure or tail: their
    /// log was delivered again with another identity. Its digest differs with its metadata; its estimates are equal to the bit.
    pub(crate) fn moved_samples(&self, writer: &Writer) -> Result<Vec<LogResult>, Error> {
        let gone = self.plan.gone.values().flatten().map(|log| (&log.log_path, log));
        let gone: HashMap<&String, &LogRecord> = gone.collect();
        let departures = || self.own.keys().map(|key| key.departure_us);
        let (Some(first_us), Some(last_us), false) =
            (departures().min(), departures().max(), gone.is_empty())
        else {
            return Ok(Vec::new());
        };
        let before = writer.held_between(first_us - MOST_CORRECTED_US, last_us + MOST_CORRECTED_US)?;
        let own = self.own.values().map(|own| &own.held).filter(|held| held.is_estimated());
        let own: HashMap<_, &HeldRecord> = own.map(|held| (held.samples_key(), held)).collect();
        let before = before.into_iter().filter(|(key, _)| !self.own.contains_key(key));
        let moved = before.filter_map(|(key, stored)| {
            let owner = own.get(&stored.samples_key())?.log_path.as_str();
            Some((key, stored, owner))
        });
        Ok(left_of(&gone, moved))
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

    /// Refuses a log and those that may be other pieces of its flight: they get no new records; stored ones stay.
    fn refuse_pieces(
        &mut self,
        account: LogRecord,
        diagnostics: Vec<Diagnostic>,
        pieces: Vec<LogRecord>,
        report: &mut RunSummary,
    ) -> Vec<LogResult> {
        let refused = |mut account: LogRecord, other: &LogRecord| {
            let departures = account.departure_utc.zip(other.departure_utc);
            let (own, others) = departures.unwrap_or_default();
            let diagnostic = pieces_undeclared(&account.log_path, own, &other.log_path, others);
            (account.estimated, account.refused) = (0, 0);
            ProcessedLog::in_error(account, diagnostic)
        };
        // A log with an error of its own keeps it.
        let done = if diagnostics.is_empty() {
            refused(account, &pieces[0])
        } else {
            ProcessedLog::without_records(account, diagnostics)
        };
        let own = done.account.clone();
        let mut results = vec![self.store(done, Vec::new(), report)];
        let pieces = pieces.into_iter().filter(|piece| piece.estimated + piece.refused > 0);
        for piece in pieces.filter(|piece| !self.is_stored(piece)).collect::<Vec<_>>() {
            // Records of this run that are taken back: they were stored before their other pieces were known.
            let digest = piece.log_digest.clone().unwrap_or_default();
            let taken = |key: RecordKey| {
                self.own.remove(&key);
                (key, digest.clone())
            };
            let taken = piece.keys().into_iter().map(taken).collect();
            results.push(self.store(refused(piece, &own), taken, report));
        }
        results
    }

    fn store(&mut self, done: ProcessedLog, moved_from: MovedKeys, report: &mut RunSummary) -> LogResult {
        let ProcessedLog { mut account, records, diagnostics } = done;
        self.errors.insert(account.log_path.clone(), diagnostics);
        let is_refused = |record: &&GapRecord| record.estimate.status == Status::Refused;
        let refused = records.iter().filter(is_refused).count();
        (account.estimated, account.refused) = ((records.len() - refused) as i64, refused as i64);
        self.keep_counts(&mut account, report);
        for record in &records {
            self.touched.insert((Some(record.part_number.to_string()), record.serial_number.to_string()));
            let refused = is_refused(&record).then(|| record.estimate.reason.clone().unwrap_or_default());
            self.own.insert(RecordKey::of(record), OwnRecord { held: HeldRecord::of(record), refused });
        }
        self.insert(account.clone());
        LogResult { account, records, moved_from }
    }

    /// A log that failed keeps the records that it had, and its account says so.
    fn keep_counts(&self, account: &mut LogRecord, report: &mut RunSummary) {
        let is_failed =
            account.outcome == LogOutcome::Error && account.error_code.as_deref() != Some("duplicate_flight");
        let Some(before) = self.plan.accounts.get(&account.log_path).filter(|_| is_failed) else { return };
        let left = before.estimated + before.refused - account.estimated - account.refused;
        if left > 0 {
            report.kept += left as usize;
            if plan::is_same_flight(before, account) {
                (account.estimated, account.refused) = (before.estimated, before.refused);
            }
        }
    }
}

/// What is left of logs that are gone whose stored records belong to another log now, which is named with each. A log that comes
/// back as it was has none, so that it is processed again.
fn left_of<'l>(
    gone: &HashMap<&String, &LogRecord>,
    moved: impl Iterator<Item = (RecordKey, HeldRecord, &'l str)>,
) -> Vec<LogResult> {
    let mut left = BTreeMap::<&String, LogResult>::new();
    for (key, stored, owner) in moved {
        let Some((log, account)) = gone.get_key_value(&stored.log_path) else { continue };
        let LogResult { account, moved_from, .. } = left.entry(log).or_insert_with(|| LogResult {
            account: (*account).clone(),
            records: Vec::new(),
            moved_from: Vec::new(),
        });
        *(if stored.is_estimated() { &mut account.estimated } else { &mut account.refused }) -= 1;
        account.error_detail = Some(format!("its samples are those of {owner}"));
        moved_from.push((key, stored.log_digest));
    }
    left.into_values().collect()
}

fn hash_of_id(account: &LogRecord) -> Option<u64> {
    let id = account.tail_number.as_ref().zip(account.flight_id.as_ref())?;
    let mut hash = DefaultHasher::new();
    id.hash(&mut hash);
    Some(hash.finish())
}

fn superseded(mut account: LogRecord, owner: &LogRecord, is_same: bool) -> ProcessedLog {
    account.outcome = LogOutcome::Done;
    if is_same {
        account.error_detail = Some(format!("copy of {}", owner.log_path));
        return ProcessedLog::without_records(account, Vec::new());
    }
    let diagnostic = duplicate_flight(&account.log_path, &owner.log_path);
    ProcessedLog::in_error(account, diagnostic)
}
