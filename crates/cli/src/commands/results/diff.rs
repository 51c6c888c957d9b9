//! `diff`: compares the estimates of two stores.

use std::fmt::Write as _;

use pipeline::inspect::store_diff::{DiffRow, RecordCounts, StoreDiff, compare_stores};

use crate::args::DiffArgs;
use crate::table::{self, count, number, text, unit_name};
use crate::{Code, Failure, Output, row_output};

/// Compares two stores.
///
/// # Errors
/// If one of them cannot be read.
pub(crate) fn diff(args: &DiffArgs, output: &Output) -> Result<Code, Failure> {
    let found = compare_stores(&args.before, &args.after, args.min_change_um * 1e-6)?;
    row_output::write_rows(&args.rows, output, || row_output::batch(&found.rows), || page(&found))?;
    Ok(Code::Success)
}

fn page(diff: &StoreDiff) -> String {
    let record_counts = |counts: RecordCounts| {
        format!("{} with {}", count(counts.records, "record"), count(counts.with_gap, "gap"))
    };
    let rows = &diff.rows;
    let changes: Vec<f64> = rows.iter().filter_map(|r| r.gap_change_m).map(f64::abs).collect();
    let largest = changes.iter().copied().max_by(f64::total_cmp);
    let mut head = format!(
        "{} of {} actuator-flights differ; before {}, after {}\n",
        rows.len(),
        diff.compared,
        record_counts(diff.before),
        record_counts(diff.after)
    );
    if let Some((middle, largest)) = trend::quantity::median(changes).zip(largest) {
        let _ = writeln!(
            head,
            "change of the gap: median {:.3} µm, largest {:.3} µm",
            middle * 1e6,
            largest * 1e6
        );
    }
    let columns: &table::Columns<'_, DiffRow> = &[
        (text("departure [UTC]", 3), &|r| {
            r.departure_utc.get(..16).unwrap_or(&r.departure_utc).replace('T', " ")
        }),
        (text("tail", 1), &|r| r.tail_number.clone()),
        (text("flight", 2), &|r| r.flight_id.clone()),
        (text("position", 0), &|r| r.position.clone()),
        (text("part / serial", 4), &|r| unit_name(Some(&r.part_number), &r.serial_number)),
        (number("before [µm]", 0), &|r| table::micrometres(r.gap_m_before)),
        (number("after [µm]", 0), &|r| table::micrometres(r.gap_m_after)),
        (number("change [µm]", 0), &|r| {
            r.gap_change_m.map_or_else(table::empty_cell, |change| format!("{:+.3}", change * 1e6))
        }),
        (text("status before", 5), &|r| r.status_before.clone().unwrap_or_else(|| "absent".into())),
        (text("status after", 5), &|r| r.status_after.clone().unwrap_or_else(|| "absent".into())),
    ];
    head + &table::of(rows, columns)
}
