//! What the report shows of flights, read from the columns of the store that hold it.

use arrow::array::{Array, AsArray, ListArray};
use arrow::datatypes::Float64Type;
use store::ColumnScan;

use crate::error::Error;
use crate::fleet::unit_rows::{further_columns, number};

/// Columns of numbers that a page shows; an assessment needs load reversals alone of them.
const NUMBERS: [&str; 9] = [
    "unit_hours",
    "gap_p05_m",
    "gap_p95_m",
    "gap_midrange_m",
    "gap_largest_m",
    "gap_largest_se_m",
    "load_p05_n",
    "load_p95_n",
    "load_reversals",
];

const PROFILE: [&str; 3] = ["gap_profile_at_m", "gap_profile_m", "gap_profile_se_m"];

/// What a page shows of a flight in addition to the columns of its history.
#[derive(Debug, Default)]
pub(super) struct FlightDetails {
    /// In the order of [`NUMBERS`]; NaN for none.
    pub(super) numbers: [f64; NUMBERS.len()],
    pub(super) profile: Box<[[f64; 3]]>,
    /// Rejection code, or the most severe flag.
    pub(super) reason: Option<Box<str>>,
    pub(super) flags: Box<[Box<str>]>,
}

pub(super) fn flight_details(stored: &ColumnScan) -> Result<Vec<FlightDetails>, Error> {
    // The unit's hours are joined from those of its tail.
    let others = ["reason", "flags", "tail_hours_end"];
    let names: Vec<&str> = NUMBERS.into_iter().chain(others).chain(PROFILE).collect();
    further_columns(stored, &names, |chunk, batch| {
        let column = |name: &str| chunk.numbers(Some(chunk.column(&[name])?));
        let numbers = NUMBERS.into_iter().map(column).collect::<Result<Vec<_>, _>>()?;
        let reasons = chunk.texts(chunk.find(&["reason"]))?;
        let list = |name: &str| batch.column_by_name(name)?.as_list_opt::<i32>().cloned();
        let (flags, profiles) = (list("flags"), PROFILE.map(list));
        Ok(move |row| FlightDetails {
            numbers: std::array::from_fn(|k| number(&numbers[k], row)),
            profile: profile_of(&profiles, row).unwrap_or_default(),
            reason: reasons.get(row).map(Into::into),
            flags: flags.as_ref().map(|flags| flags_of(flags, row)).unwrap_or_default(),
        })
    })
}

/// The gap along the stroke of a row, where it varies.
fn profile_of(columns: &[Option<ListArray>; 3], row: usize) -> Option<Box<[[f64; 3]]>> {
    let lists =
        columns.each_ref().map(|column| Some(column.as_ref().filter(|c| c.is_valid(row))?.value(row)));
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
