//! Verification: log files and data files against their digests, statistics against content, log records against gap
//! records.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use arrow::compute::concat_batches;
use jiff::Timestamp;
use records::{Diagnostic, GapRecord, LogRecord, RecordKey};

use crate::delta::data_file;
use crate::delta::file_stats::{self, Stats};
use crate::delta::log_digests;
use crate::delta::snapshot::DataFile;
use crate::delta::table::Table;
use crate::error::Error;
use crate::handle::Store;
use crate::read::{frame, scan};
use crate::write::writer::{Writer, key_columns, keys_of};

/// Maximum number of similar findings that are listed; the others are counted.
const NAMED: usize = 3;

impl Store {
    /// Everything that is wrong with the store; empty when it is intact.
    ///
    /// Each log file must match its digest. Each data file must exist with the committed length, digest and number of
    /// rows, and its statistics must cover its content. No record may be stored twice, and the records of each log must
    /// be stored.
    pub fn verify(&self) -> Vec<Diagnostic> {
        let tables = self.existing_tables();
        let mut findings: Vec<Diagnostic> = tables.into_iter().flat_map(wrong_in).collect();
        // A foreign file does not keep the records from being read.
        if findings.iter().all(|finding| finding.code == "store_file_foreign") {
            findings.extend(self.wrong_records().unwrap_or_else(|error| vec![error.diagnostic()]));
        }
        findings
    }

    fn wrong_records(&self) -> Result<Vec<Diagnostic>, Error> {
        let files: Vec<PathBuf> = self.gaps.snapshot()?.paths().collect();
        let schema = GapRecord::schema();
        let schema = Arc::new(schema.project(&key_columns(&schema)?)?);
        let rows = self.read_files(&files, &schema, &[])?;
        let keys = keys_of(&frame::sorted(&rows, &RecordKey::COLUMNS, None)?)?;
        let twice: Vec<&RecordKey> = keys.windows(2).filter(|k| k[0] == k[1]).map(|k| &k[0]).collect();
        let logs = self.accounts()?;
        let incomplete = incomplete_logs(&logs, &keys);
        let mut findings = first_of(twice.iter().map(|key| duplicate(key)), "records are stored twice");
        let incomplete = incomplete.iter().map(|(log, stored)| incomplete_log(log, *stored));
        findings.extend(first_of(incomplete, "logs lack records"));
        Ok(findings)
    }
}

impl Writer {
    /// Gives the commits of other programs the digests that Freeplay's own have: they were meant. Returns their number.
    ///
    /// # Errors
    /// When a log cannot be listed or read, or a digest cannot be written.
    pub fn accept_foreign(&mut self) -> Result<usize, Error> {
        let mut accepted = 0;
        for table in self.store().existing_tables() {
            for file in table.damaged_log_files()?.1 {
                log_digests::add(&table.location, &file)?;
                accepted += 1;
            }
        }
        Ok(accepted)
    }
}

/// The first of similar findings, and the number of the others.
fn first_of(mut findings: impl ExactSizeIterator<Item = Diagnostic>, problem: &str) -> Vec<Diagnostic> {
    let mut named: Vec<Diagnostic> = findings.by_ref().take(NAMED).collect();
    if let (more @ 1.., Some(last)) = (findings.len(), named.last()) {
        named.push(Diagnostic::new(last.code.clone(), format!("{more} more {problem}")));
    }
    named
}

/// Logs with more records than are stored of their flight, and the number that is stored. A flight with several logs is
/// left out: a later log may have replaced records of an earlier one.
fn incomplete_logs<'a>(logs: &'a [LogRecord], keys: &[RecordKey]) -> Vec<(&'a LogRecord, i64)> {
    let mut stored: BTreeMap<(&str, i64), i64> = BTreeMap::new();
    for key in keys {
        *stored.entry((&key.tail_number, key.departure_us)).or_default() += 1;
    }
    let mut by_flight: BTreeMap<(&str, i64), Vec<&LogRecord>> = BTreeMap::new();
    for log in logs {
        let Some((tail, at)) = log.tail_number.as_ref().zip(log.departure_utc) else { continue };
        by_flight.entry((tail, at.as_microsecond())).or_default().push(log);
    }
    let single = by_flight.into_iter().filter_map(|(flight, logs)| match logs.as_slice() {
        [log] => Some((*log, stored.get(&flight).copied().unwrap_or_default())),
        _ => None,
    });
    single.filter(|(log, stored)| log.outcome.is_success() && log.estimated + log.refused > *stored).collect()
}

fn incomplete_log(log: &LogRecord, stored: i64) -> Diagnostic {
    let mut found =
        Diagnostic::new("store_records_missing", "records of a log are not stored").in_file(&log.log_path);
    (found.found, found.expected) =
        (Some(format!("{stored} records")), Some(format!("{} records", log.estimated + log.refused)));
    found.hint("restore the store from a backup, or estimate the log again with `freeplay run --redo`")
}

fn duplicate(key: &RecordKey) -> Diagnostic {
    let RecordKey { tail_number, departure_us, position } = key;
    let departure_utc = Timestamp::from_microsecond(*departure_us).unwrap_or_default();
    let what = format!("{tail_number} {position}, departure {departure_utc}, is stored twice");
    Diagnostic::new("store_duplicate", what)
        .hint("did another program compact the table while a run was writing? `freeplay run --redo` fixes it")
}

fn wrong_in(table: &Table) -> Vec<Diagnostic> {
    let mut findings = match table.damaged_log_files() {
        Ok((damaged, foreign)) => {
            let foreign = foreign.iter().map(|file| {
                let what = "a commit was written by another program and carries no digest";
                let hint = "compare the records with the logs; if the commit was meant, `freeplay store verify \
                            --accept-foreign` accepts it";
                Diagnostic::new("store_file_foreign", what)
                    .in_file(table.location.display_path(file).display())
                    .hint(hint)
            });
            damaged.iter().map(Error::diagnostic).chain(foreign).collect()
        }
        Err(error) => vec![error.diagnostic()],
    };
    match table.snapshot() {
        Ok(snapshot) => {
            findings.extend(snapshot.files.iter().filter_map(|file| check_file(table, file).err()));
        }
        // A damaged log file is named already.
        Err(Error::LogDamaged { .. }) if !findings.is_empty() => {}
        Err(error) => findings.push(error.diagnostic()),
    }
    findings
}

fn check_file(table: &Table, file: &DataFile) -> Result<(), Diagnostic> {
    const RESTORE: &str = "restore it from a backup of the store";
    let wrong = |code: &str, what: &str, hint: &str| {
        Diagnostic::new(code, what).in_file(table.location.display_path(&file.path).display()).hint(hint)
    };
    let Some(length) = table.location.length(&file.path).map_err(|e| e.diagnostic())? else {
        return Err(wrong("store_file_missing", "a committed data file is missing", RESTORE));
    };
    table
        .location
        .fetch(&file.path)
        .and_then(|()| data_file::check(&file.path))
        .map_err(|e| e.diagnostic())?;
    if length != file.size_bytes {
        let found = Some(format!("{length} bytes"));
        let expected = Some(format!("{} bytes", file.size_bytes));
        let what = "a data file has another length than was committed";
        return Err(Diagnostic { found, expected, ..wrong("store_damaged", what, RESTORE) });
    }
    if !file.has_digest() {
        return Err(wrong(
            "store_file_foreign",
            "a data file was written by another program and carries no digest",
            "`freeplay store compact` rewrites its rows with digests; compare them with the logs first",
        ));
    }
    let content = scan::read_file(&file.path, &table.schema, &[])
        .and_then(|batches| Ok(concat_batches(&table.schema, &batches)?))
        .map_err(|e| e.diagnostic().in_file(table.location.display_path(&file.path).display()))?;
    // By this column, a reader would skip a file that holds matching rows.
    let Some(column) = file.stats.missed_by(&Stats::parse(Some(&file_stats::of(&content)))) else {
        return Ok(());
    };
    let what = format!("the statistics of a data file do not cover its content: {column}");
    Err(wrong("store_damaged", &what, "restore the log of the table from a backup of the store"))
}
