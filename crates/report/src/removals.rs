//! Removals to expect each month: the sum of the units' chances, and the spread of that sum.

use crate::crossing::chance_within;
use crate::model::Report;
use crate::words::{days_between, month, month_name};

/// One month.
#[derive(Debug, Clone)]
pub(crate) struct Month {
    pub name: String,
    pub expected: f64,
    pub low: f64,
    pub high: f64,
}

/// Twelve months from that of the report; units whose use is not known cannot be dated.
pub(crate) fn removals(report: &Report) -> Vec<Month> {
    let Some(now) = report.as_of_utc else { return Vec::new() };
    let mut months = Vec::new();
    for k in 0..12 {
        let (Some(from), Some(to)) = (month(now, k), month(now, k + 1)) else { break };
        let (mut expected, mut variance) = (0.0, 0.0);
        for statement in report.units.iter().map(|u| &u.statement) {
            let Some(pace) = statement.hours_per_day else { continue };
            let until = |t| chance_within(statement, days_between(now, t) * pace).unwrap_or(0.0);
            let chance = if k == 0 { until(to) } else { until(to) - until(from) };
            expected += chance;
            variance += chance * (1.0 - chance);
        }
        let half = 1.645 * f64::sqrt(variance);
        let name = month_name(from);
        months.push(Month { name, expected, low: (expected - half).max(0.0), high: expected + half });
    }
    months
}
