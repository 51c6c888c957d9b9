//! Log of runs: what each run did with each log, also for a run that was killed.
//!
//! When a run begins it records every planned log as *not reached*. The final status of a log follows in the commit of
//! its records, so the tables hold the status of every log at any instant. Between the two
//! commits of a batch a log has records and no status yet: it is read as *unaccounted*.

use std::collections::BTreeMap;
use std::slice;

use jiff::{SignedDuration, Timestamp};
use records::{GapRecord, LogOutcome, LogRecord, RunRecord, Status};

use crate::error::Error;
use crate::handle::Store;
use crate::read::query::Query;
use crate::read::scan::Condition;
use crate::write::lock::Lock;
use crate::write::writer::{self, Writer};

/// A run in a bucket that gave no sign of life for so long was killed: it stores each log as it is finished.
const SILENT: SignedDuration = SignedDuration::from_hours(1);

impl Store {
    /// What became of each log of a run, by name.
    ///
    /// # Errors
    /// As [`Store::records`].
    pub fn run_logs(&self, run_id: &str) -> Result<Vec<LogRecord>, Error> {
        let of_run = Condition::texts("run_id", run_id, run_id);
        let logs = self.newest(&self.logs, &[of_run], |account: &LogRecord| account.log_path.clone())?;
        let mut logs: BTreeMap<String, LogRecord> =
            logs.into_iter().map(|account| (account.log_path.clone(), account)).collect();
        let records = self.records(&Query { run_id: Some(run_id.to_owned()), ..Query::default() })?;
        for record in &records {
            let provenance = &record.provenance;
            // Of a log without an account, only records are stored.
            let log = logs.entry(provenance.log_path.clone()).or_insert_with(|| LogRecord {
                log_path: provenance.log_path.clone(),
                outcome: LogOutcome::NotReached,
                run_id: provenance.run_id.clone(),
                processed_utc: provenance.processed_utc,
                ..LogRecord::default()
            });
            if matches!(log.outcome, LogOutcome::NotReached | LogOutcome::Unaccounted) {
                count(log, record);
            }
        }
        Ok(logs.into_values().collect())
    }

    /// The newest account of every run, by the time it began.
    ///
    /// The figures of a run that has not ended are those of its logs.
    ///
    /// # Errors
    /// As [`Store::records`].
    pub fn runs(&self) -> Result<Vec<RunRecord>, Error> {
        let mut runs = self.newest(&self.runs, &[], |run: &RunRecord| run.run_id.clone())?;
        for run in runs.iter_mut().filter(|run| !run.has_ended()) {
            let logs = self.run_logs(&run.run_id)?;
            let with = |wanted: &[LogOutcome]| {
                logs.iter().filter(|log| wanted.contains(&log.outcome)).count() as i64
            };
            run.done = with(&[LogOutcome::Done, LogOutcome::Error, LogOutcome::Unaccounted]);
            run.errors = with(&[LogOutcome::Error]);
            run.not_reached = with(&[LogOutcome::NotReached]);
            let stored = || logs.iter().filter(|log| log.outcome != LogOutcome::Known);
            run.estimated = stored().map(|log| log.estimated).sum();
            run.refused = stored().map(|log| log.refused).sum();
        }
        runs.sort_by_key(|run| run.started_utc);
        Ok(runs)
    }

    /// Digest of the tables that the latest run wrote into all records; `None` if this run has not ended. The latest run is
    /// that whose row was committed last: a clock may go back.
    ///
    /// # Errors
    /// As [`Store::records`].
    pub fn tables_digest(&self) -> Result<Option<String>, Error> {
        // Under one name, the newest row of all.
        let latest = self.newest(&self.runs, &[], |_: &RunRecord| String::new())?.pop();
        Ok(latest.and_then(|run| run.tables_digest))
    }

    /// Whether a run holds the store now; in a bucket, whether a run without an end sent a heartbeat recently.
    ///
    /// # Errors
    /// [`Error::Io`] when the lock cannot be read.
    pub fn is_held(&self) -> Result<bool, Error> {
        match self.lock_file() {
            Some(file) => Lock::is_held(&file),
            None => Ok(self.runs()?.iter().any(|run| self.may_live(run))),
        }
    }

    /// Whether a run without an end may still be active, where no lock exists.
    fn may_live(&self, run: &RunRecord) -> bool {
        let signs =
            || self.run_logs(&run.run_id).unwrap_or_default().into_iter().map(|log| log.processed_utc);
        let is_late = |at: Timestamp| Timestamp::now().duration_since(at) < SILENT;
        self.location.is_bucket()
            && !run.has_ended()
            && (is_late(run.started_utc) || signs().max().is_some_and(is_late))
    }
}

impl Writer {
    /// Writes down that a run begins, and the logs it means to do, each *not reached* as yet.
    ///
    /// # Errors
    /// As [`Writer::commit`].
    pub fn begin_run(&mut self, run: &RunRecord, logs: &[LogRecord]) -> Result<(), Error> {
        writer::account(&self.store().logs, logs)?;
        writer::account(&self.store().runs, slice::from_ref(run))
    }

    /// Writes down how a run ended.
    ///
    /// # Errors
    /// As [`Writer::commit`].
    pub fn end_run(&mut self, run: &RunRecord) -> Result<(), Error> {
        writer::account(&self.store().runs, slice::from_ref(run))
    }

    /// Finishes the accounts of runs that were killed: who writes holds the lock, so none of them lives. In a
    /// bucket, where there is none, runs that gave a sign of life within the hour are left to themselves.
    ///
    /// # Errors
    /// As [`Writer::commit`].
    pub fn close_killed_runs(&mut self) -> Result<Vec<RunRecord>, Error> {
        let runs = self.store().runs()?;
        let is_killed = |run: &RunRecord| !run.has_ended() && !self.store().may_live(run);
        let mut killed: Vec<RunRecord> = runs.into_iter().filter(is_killed).collect();
        for run in &mut killed {
            let logs = self.store().run_logs(&run.run_id)?;
            let reached = logs.iter().filter(|log| log.outcome != LogOutcome::NotReached);
            run.finished_utc = reached.map(|log| log.processed_utc).max().or(Some(run.started_utc));
            let cut: Vec<LogRecord> =
                logs.into_iter().filter(|log| log.outcome == LogOutcome::Unaccounted).collect();
            writer::account(&self.store().logs, &cut)?;
            writer::account(&self.store().runs, slice::from_ref(run))?;
        }
        Ok(killed)
    }
}

/// Counts a record into the account of a log that has none of its own.
fn count(log: &mut LogRecord, record: &GapRecord) {
    if log.outcome == LogOutcome::NotReached {
        log.outcome = LogOutcome::Unaccounted;
        log.log_digest = Some(record.provenance.log_digest.clone());
        log.tail_number = Some(record.flight.tail_number.to_string());
        log.flight_id = Some(record.flight.flight_id.to_string());
        log.departure_utc = Some(record.flight.departure_utc);
        log.processed_utc = record.provenance.processed_utc;
    }
    let position = record.position.to_string();
    if log.positions.contains(&position) {
        return;
    }
    log.positions.push(position);
    match record.estimate.status {
        Status::Estimated => log.estimated += 1,
        Status::Refused => log.refused += 1,
        Status::Withdrawn => {}
    }
}
