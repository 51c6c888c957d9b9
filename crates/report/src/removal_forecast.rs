//! Expected removals per month: sum of the units' crossing probabilities, with its 90 % interval.

use jiff::Timestamp;
use records::TrendRow;
use records::report_rows::ReportRemovalsRow;
use records::time::days_between;
use records::uncertainty::NORMAL_95;

use crate::format::month;
use crate::model::Report;

/// Twelve months from that of the report; units without known utilisation are left out.
pub fn removal_forecast(report: &Report) -> Vec<ReportRemovalsRow> {
    let Some(now) = report.as_of_utc else { return Vec::new() };
    let mut months = Vec::new();
    for k in 0..12 {
        let (Some(from), Some(to)) = (month(now, k), month(now, k + 1)) else { break };
        let (mut expected, mut variance) = (0.0, 0.0);
        for row in report.units.iter().map(|unit| &unit.row) {
            let before = if k == 0 { Some(0.0) } else { reached(row, from) };
            let Some(chance) = reached(row, to).zip(before).map(|(to, from)| to - from) else { continue };
            expected += chance;
            variance += chance * (1.0 - chance);
        }
        let half = NORMAL_95 * f64::sqrt(variance);
        let month = from.strftime("%Y-%m").to_string();
        months.push(ReportRemovalsRow {
            month,
            expected,
            low: (expected - half).max(0.0),
            high: expected + half,
        });
    }
    months
}

/// Probability that a unit reaches its limit until a time, at its own utilisation from its last flight on.
fn reached(row: &TrendRow, until: Timestamp) -> Option<f64> {
    let hours = row.elapsed_hours.0 + days_between(row.as_of_utc, until) * row.hours_per_day?;
    Some(row.crossing_probability(hours).unwrap_or(0.0))
}
