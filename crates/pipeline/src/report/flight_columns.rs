//! What the report shows of flights, read from the columns of the store that hold it.

use std::collections::BTreeMap;

use arrow::array::{Array, AsArray, ListArray, RecordBatch};
use arrow::datatypes::Float64Type;
use ingest::tables::TableBatch;
use jiff::{SignedDuration, Timestamp};
use records::report_rows::ReportFlight;
use records::row_schema::NoColumn;
use store::{Query, Store};

use crate::assess::quantities::values::{FleetValues, FlightValues, ValueColumns};
use crate::error::Error;
use crate::fleet::builder;
use crate::fleet::histories::{Histories, UnitKey};
use crate::fleet::unit_rows::{RowsByUnit, at, of_store};

/// Columns of numbers that a page shows; an assessment needs load reversals alone of them.
const NUMBERS: [&str; 8] = [
    "unit_hours",
    "gap_p05_m",
    "gap_p95_m",
    "gap_midrange_m",
    "gap_largest_m",
    "load_p05_n",
    "load_p95_n",
    "load_reversals",
];

/// Columns of the gap along the stroke.
const PROFILE: [&str; 3] = ["gap_profile_at_m", "gap_profile_m", "gap_profile_se_m"];

pub(super) struct StoreContents {
    pub(super) histories: Histories,
    /// Further columns of each unit's flights, by departure: each flight's `row` is its place among them.
    pub(super) extras: BTreeMap<UnitKey, Vec<FlightExtras>>,
    /// Values of their followed quantities.
    pub(super) values: FleetValues,
    pub(super) store_version: u64,
}

/// What a page shows of a flight in addition to the columns of its history.
#[derive(Debug, Clone)]
pub(super) struct FlightExtras {
    /// The flight, without departure, names, gap and remarks.
    pub(super) shown: ReportFlight,
    /// Rejection code, or the most severe flag.
    pub(super) reason: Option<Box<str>>,
    pub(super) flags: Box<[Box<str>]>,
}

impl StoreContents {
    /// Reads the flights that departed until a time, with it.
    pub(super) fn until(last: Option<Timestamp>, store: &Store) -> Result<Self, Error> {
        let until_utc = last.and_then(|last| last.checked_add(SignedDuration::from_micros(1)).ok());
        let mut columns = builder::stored_columns();
        columns.extend(NUMBERS.into_iter().chain(["reason"]).chain(PROFILE));
        columns.extend(ValueColumns::names());
        columns.sort_unstable();
        columns.dedup();
        let scan = store.scan_columns(&Query { until_utc, ..Query::default() }, &columns)?;
        let (histories, further) = builder::histories(of_store(&scan, add)?, true);
        let apart = |(name, rows): (UnitKey, Vec<_>)| {
            let (extras, values) = rows.into_iter().unzip();
            ((name.clone(), extras), (name, values))
        };
        let (extras, values) = further.into_iter().map(apart).unzip();
        Ok(Self { histories, extras, values, store_version: scan.version() })
    }
}

fn add(
    rows: &mut RowsByUnit<(FlightExtras, FlightValues)>,
    chunk: &TableBatch,
    batch: &RecordBatch,
) -> Result<(), ingest::Error> {
    let column = |name: &str| chunk.numbers(Some(chunk.column(&[name])?));
    let numbers = NUMBERS.into_iter().map(column).collect::<Result<Vec<_>, _>>()?;
    let values = ValueColumns::of(chunk)?;
    let reasons = chunk.texts(chunk.find(&["reason"]))?;
    let flags = batch.column_by_name("flags").and_then(|flags| flags.as_list_opt::<i32>());
    let profiles =
        PROFILE.map(|name| batch.column_by_name(name).and_then(|column| column.as_list_opt::<i32>()));
    builder::add_stored(rows, chunk, batch, |row| {
        let [
            unit_hours,
            gap_p05_m,
            gap_p95_m,
            gap_midrange_m,
            gap_largest_m,
            load_p05_n,
            load_p95_n,
            load_reversals,
        ] = std::array::from_fn(|k| at(&numbers[k], row));
        let extras = FlightExtras {
            shown: ReportFlight {
                unit_hours,
                gap_p05_m,
                gap_p95_m,
                gap_midrange_m,
                gap_largest_m: NoColumn(gap_largest_m),
                profile: NoColumn(profile_of(&profiles, row).unwrap_or_default()),
                load_reversals: load_reversals.map(|n| n as i64),
                load_p05_n,
                load_p95_n,
                ..ReportFlight::default()
            },
            reason: reasons.get(row).map(Into::into),
            flags: flags.map(|flags| flags_of(flags, row)).unwrap_or_default(),
        };
        (extras, values.row(row))
    })
}

/// The gap along the stroke of a row, where it varies.
fn profile_of(columns: &[Option<&ListArray>; 3], row: usize) -> Option<Box<[[f64; 3]]>> {
    let lists = columns.map(|column| Some(column.filter(|column| column.is_valid(row))?.value(row)));
    let [at_m, gap_m, gap_se_m] =
        lists.each_ref().map(|list| list.as_ref()?.as_primitive_opt::<Float64Type>());
    let gaps = at_m?.values().iter().zip(gap_m?.values()).zip(gap_se_m?.values());
    Some(gaps.map(|((at_m, m), se_m)| [*at_m, *m, *se_m]).collect())
}

fn flags_of(flags: &ListArray, row: usize) -> Box<[Box<str>]> {
    if flags.is_null(row) || flags.value_length(row) == 0 {
        return Box::default();
    }
    let of_row = flags.value(row);
    of_row.as_string_opt::<i32>().into_iter().flatten().flatten().map(Into::into).collect()
}
