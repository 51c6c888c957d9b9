//! Comparison of two stores, actuator-flight by actuator-flight.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use records::GapRecord;
use store::{Query, RecordKey, Store};

use crate::error::Error;

records::row! {
    /// An actuator-flight whose results differ between the stores.
    #[derive(Debug)]
    pub struct DiffRow {
        pub tail_number: String,
        pub flight_id: String,
        pub position: String,
        pub departure_utc: String,
        pub part_number: String,
        pub serial_number: String,
        pub status_before: Option<String>,
        pub status_after: Option<String>,
        pub gap_m_before: Option<f64>,
        pub gap_m_after: Option<f64>,
        pub gap_change_m: Option<f64>,
        pub se_m: Option<f64>,
    }
}

/// Records of a store, and those of them with a gap.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[expect(missing_docs, reason = "each field is named for what it holds")]
pub struct RecordCounts {
    pub records: usize,
    pub with_gap: usize,
}

/// Actuator-flights that differ between two stores.
#[derive(Debug)]
#[expect(missing_docs, reason = "each field is named for what it holds")]
pub struct StoreDiff {
    /// Those that differ, by departure, tail and position.
    pub rows: Vec<DiffRow>,
    /// Number of actuator-flights in either store.
    pub compared: usize,
    pub before: RecordCounts,
    pub after: RecordCounts,
}

/// Compares the records of two stores; changes of a gap below `min_change_m` are left out.
///
/// # Errors
/// When one of them cannot be read.
pub fn compare_stores(before: &Path, after: &Path, min_change_m: f64) -> Result<StoreDiff, Error> {
    let (before, after) = (records(before)?, records(after)?);
    let keys: BTreeSet<_> = before.keys().chain(after.keys()).collect();
    let rows = keys.iter().filter_map(|key| row(before.get(*key), after.get(*key)));
    let is_change = |change: f64| change != 0.0 && change.abs() >= min_change_m;
    let differs =
        |row: &DiffRow| row.status_before != row.status_after || row.gap_change_m.is_some_and(is_change);
    let rows = rows.filter(differs).collect();
    Ok(StoreDiff { rows, compared: keys.len(), before: counts(&before), after: counts(&after) })
}

fn counts(all: &BTreeMap<RecordKey, GapRecord>) -> RecordCounts {
    let with_gap = all.values().filter(|record| record.estimate.gap_m.is_some()).count();
    RecordCounts { records: all.len(), with_gap }
}

fn records(folder: &Path) -> Result<BTreeMap<RecordKey, GapRecord>, Error> {
    let records = Store::open(folder)?.records(&Query::default())?;
    Ok(records.into_iter().map(|record| (RecordKey::of(&record), record)).collect())
}

fn row(before: Option<&GapRecord>, after: Option<&GapRecord>) -> Option<DiffRow> {
    let one = after.or(before)?;
    let status = |r: &GapRecord| match r.estimate.reason.as_ref().filter(|_| r.estimate.gap_m.is_none()) {
        Some(reason) => format!("refused: {reason}"),
        None => r.estimate.status.as_str().to_owned(),
    };
    let gap = |r: Option<&GapRecord>| r.and_then(|r| r.estimate.gap_m);
    let se = |r: Option<&GapRecord>| r.and_then(|r| r.estimate.gap_se_m);
    Some(DiffRow {
        tail_number: one.flight.tail_number.to_string(),
        flight_id: one.flight.flight_id.to_string(),
        position: one.position.to_string(),
        departure_utc: one.flight.departure_utc.to_string(),
        part_number: one.part_number.to_string(),
        serial_number: one.serial_number.to_string(),
        status_before: before.map(status),
        status_after: after.map(status),
        gap_m_before: gap(before),
        gap_m_after: gap(after),
        gap_change_m: gap(before).zip(gap(after)).map(|(b, a)| a - b),
        se_m: se(after).or_else(|| se(before)),
    })
}
