//! `diff`: compares the estimates of two stores.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::Path;

use records::{GapEstimate, GapRecord};
use store::{Query, Store};

use crate::args::DiffArgs;
use crate::exit::{Code, Failure};
use crate::output::Output;
use crate::row_output;
use crate::table::{self, count, number, text};

records::row! {
    /// An actuator-flight whose results differ between the stores.
    #[derive(Debug)]
    struct Row {
        tail_number: String,
        flight_id: String,
        position: String,
        departure_utc: String,
        part_number: String,
        serial_number: String,
        status_before: Option<String>,
        status_after: Option<String>,
        gap_m_before: Option<f64>,
        gap_m_after: Option<f64>,
        gap_change_m: Option<f64>,
        se_m: Option<f64>,
    }
}

/// Compares two stores.
///
/// # Errors
/// If one of them cannot be read.
pub(crate) fn diff(args: &DiffArgs, output: &Output) -> Result<Code, Failure> {
    let (before, after) = (records(&args.before)?, records(&args.after)?);
    let keys: BTreeSet<_> = before.keys().chain(after.keys()).collect();
    let rows: Vec<Row> = keys.iter().filter_map(|key| row(before.get(*key), after.get(*key))).collect();
    let shown: Vec<Row> = rows.into_iter().filter(|row| differs(row, args.min_change_um * 1e-6)).collect();
    let page = || page(&shown, keys.len(), &before, &after);
    row_output::write_rows(&args.rows, output, || row_output::batch(&shown), page)?;
    Ok(Code::Success)
}

type Key = (String, String, String);

fn records(folder: &Path) -> Result<BTreeMap<Key, GapRecord>, Failure> {
    let store = Store::open(folder)?;
    let key = |r: &GapRecord| {
        (r.flight.tail_number.to_string(), r.flight.flight_id.to_string(), r.position.to_string())
    };
    Ok(store.records(&Query::default())?.into_iter().map(|r| (key(&r), r)).collect())
}

fn row(before: Option<&GapRecord>, after: Option<&GapRecord>) -> Option<Row> {
    let one = after.or(before)?;
    let status = |r: &GapRecord| match r.estimate.reason.as_ref().filter(|_| r.estimate.gap_m.is_none()) {
        Some(reason) => format!("refused: {reason}"),
        None => r.estimate.status.as_str().to_owned(),
    };
    let gap = |r: Option<&GapRecord>| r.and_then(|r| r.estimate.gap_m);
    let se = |r: Option<&GapRecord>| r.and_then(|r| r.estimate.gap_se_m);
    Some(Row {
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

fn differs(row: &Row, least_m: f64) -> bool {
    row.status_before != row.status_after
        || row.gap_change_m.is_some_and(|change| change != 0.0 && change.abs() >= least_m)
}

fn page(
    rows: &[Row],
    of: usize,
    before: &BTreeMap<Key, GapRecord>,
    after: &BTreeMap<Key, GapRecord>,
) -> String {
    let record_counts = |all: &BTreeMap<Key, GapRecord>| {
        let with_gap: Vec<&GapEstimate> =
            all.values().map(|r| &r.estimate).filter(|e| e.gap_m.is_some()).collect();
        format!("{} with {}", count(all.len(), "record"), count(with_gap.len(), "gap"))
    };
    let mut changes: Vec<f64> = rows.iter().filter_map(|r| r.gap_change_m).map(f64::abs).collect();
    changes.sort_by(f64::total_cmp);
    let middle = changes.get(changes.len() / 2).copied();
    let mut head = format!(
        "{} of {of} actuator-flights differ; before {}, after {}\n",
        rows.len(),
        record_counts(before),
        record_counts(after)
    );
    if let (Some(middle), Some(largest)) = (middle, changes.last()) {
        let _ = writeln!(
            head,
            "change of the gap: median {:.3} µm, largest {:.3} µm",
            middle * 1e6,
            largest * 1e6
        );
    }
    if rows.is_empty() {
        return head;
    }
    let columns = [
        text("departure [UTC]", 3),
        text("tail", 1),
        text("flight", 2),
        text("position", 0),
        text("part / serial", 4),
        number("before [µm]", 0),
        number("after [µm]", 0),
        number("change [µm]", 0),
        text("status before", 5),
        text("status after", 5),
    ];
    let cells = |r: &Row| {
        vec![
            r.departure_utc.get(..16).unwrap_or(&r.departure_utc).replace('T', " "),
            r.tail_number.clone(),
            r.flight_id.clone(),
            r.position.clone(),
            format!("{} / {}", r.part_number, r.serial_number),
            table::micrometres(r.gap_m_before),
            table::micrometres(r.gap_m_after),
            r.gap_change_m.map_or_else(table::empty_cell, |c| format!("{:+.3}", c * 1e6)),
            r.status_before.clone().unwrap_or_else(|| "absent".into()),
            r.status_after.clone().unwrap_or_else(|| "absent".into()),
        ]
    };
    head + &table::layout(&columns, &rows.iter().map(cells).collect::<Vec<_>>())
}
