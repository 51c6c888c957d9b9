//! Expected removals per month: sum of the units' crossing probabilities, with its 90 % interval.

use records::time::days_between;
use records::uncertainty::NORMAL_95;

use crate::format::{month, month_name};
use crate::model::Report;
use crate::stats::crossing_probability::probability_within;

/// Expected removals in one month.
#[derive(Debug, Clone)]
pub struct Month {
    /// `YYYY-MM`.
    pub name: String,
    /// Expected number.
    pub expected: f64,
    /// 5 % bound.
    pub low: f64,
    /// 95 % bound.
    pub high: f64,
}

/// Twelve months from that of the report; units without known utilisation are left out.
pub fn removal_forecast(report: &Report) -> Vec<Month> {
    let Some(now) = report.as_of_utc else { return Vec::new() };
    let mut months = Vec::new();
    for k in 0..12 {
        let (Some(from), Some(to)) = (month(now, k), month(now, k + 1)) else { break };
        let (mut expected, mut variance) = (0.0, 0.0);
        for assessment in report.units.iter().map(|u| &u.assessment) {
            let Some(hours_per_day) = assessment.hours_per_day else { continue };
            let until =
                |t| probability_within(assessment, days_between(now, t) * hours_per_day).unwrap_or(0.0);
            let chance = if k == 0 { until(to) } else { until(to) - until(from) };
            expected += chance;
            variance += chance * (1.0 - chance);
        }
        let half = NORMAL_95 * f64::sqrt(variance);
        let name = month_name(from);
        months.push(Month { name, expected, low: (expected - half).max(0.0), high: expected + half });
    }
    months
}
