//! Promotion: the results of a trial store replace the results of the same logs in the store.

use std::collections::BTreeMap;

use crate::error::Error;
use crate::handle::Store;
use crate::read::query::Query;
use crate::write::writer::{self, LogResult, Writer};
use records::LogRecord;
use records::RecordKey;

/// What was taken over.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct PromotionSummary {
    /// Logs the trial accounts for.
    pub logs: usize,
    /// Records stored.
    pub records: usize,
}

impl Writer {
    /// Takes over the records, log status and runs of another store; records that it does not have are kept.
    ///
    /// `watch` receives each finished tail, and the number of tails.
    ///
    /// Tail by tail, each in one commit, so memory holds one tail's records. A process that dies in between
    /// leaves whole tails of either method; adopted again, the result is the same. A log counts as done
    /// afterwards wherever its settings are those of the trial.
    ///
    /// # Errors
    /// [`Error::Itself`] when both are one store, else as [`Writer::commit`] and [`Store::records`].
    pub fn promote(
        &mut self,
        trial: &Store,
        mut watch: impl FnMut(&str, usize),
    ) -> Result<PromotionSummary, Error> {
        if trial.dir() == self.store().dir() {
            return Err(Error::Itself { dir: trial.dir().to_owned() });
        }
        let mut tails: BTreeMap<Option<String>, Vec<LogRecord>> = BTreeMap::new();
        for account in trial.accounts()? {
            tails.entry(account.tail_number.clone()).or_default().push(account);
        }
        let mut adopted = PromotionSummary::default();
        let total = tails.len();
        for (tail, accounts) in tails {
            let results = results(trial, tail.as_deref(), accounts)?;
            self.commit(&results)?;
            adopted.count(&results);
            watch(tail.as_deref().unwrap_or("logs without identity"), total);
        }
        let runs = trial.runs()?;
        if !runs.is_empty() {
            writer::account(&self.store().runs, &runs)?;
        }
        Ok(adopted)
    }
}

impl PromotionSummary {
    fn count(&mut self, results: &[LogResult]) {
        self.logs += results.len();
        self.records += results.iter().map(|result| result.records.len()).sum::<usize>();
    }
}

/// The trial's results of one tail, or of the logs without a tail.
fn results(trial: &Store, tail: Option<&str>, accounts: Vec<LogRecord>) -> Result<Vec<LogResult>, Error> {
    let records = match tail {
        Some(tail) => trial.records(&Query { tail_number: Some(tail.to_owned()), ..Query::default() })?,
        None => Vec::new(),
    };
    let mut owner = BTreeMap::new();
    for (at, account) in accounts.iter().enumerate() {
        owner.extend(account.record_keys().into_iter().map(|key| (key, at)));
    }
    let mut results: Vec<LogResult> = accounts
        .into_iter()
        .map(|account| LogResult { account, records: Vec::new(), moved_from: Vec::new() })
        .collect();
    for record in records {
        // A record without an account was cut off by a kill: the trial's next run makes it again.
        if let Some(&at) = owner.get(&RecordKey::of(&record)) {
            results[at].records.push(record);
        }
    }
    Ok(results)
}
