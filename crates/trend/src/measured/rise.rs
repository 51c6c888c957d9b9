//! Local line: the rise of the last records, and when it meets the limit.

use crate::math::distributions::NORMAL_95;
use crate::measured::level::Line;
use crate::measured::record::Record;
use crate::settings::Settings;

/// Numbers of last records through which a line is laid.
const WINDOWS: [usize; 8] = [3, 4, 5, 6, 8, 12, 16, 20];

/// Standard errors of the slope, and share of the limit and errors of the rise, from which a line is significant.
const SLOPE_ERRORS: f64 = 4.0;
const RISE_SHARE: f64 = 0.05;
const RISE_ERRORS: f64 = 6.0;

/// Standard errors by which every record is above the one before where they rise along no line.
const EACH_ERRORS: f64 = 4.0;

/// The share of the time by the line after which the limit may be met where the rate still grows.
const ACCELERATION: f64 = 0.75;

/// A significant rise of the last records.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Rise {
    /// Records of the longest significant line, its slope, and the standard error of that.
    pub(crate) records: usize,
    pub(crate) m_per_hour: f64,
    pub(crate) m_per_hour_se: f64,
    /// Flight hours from the last record to the limit: earliest by any line, by the longest line, and latest.
    pub(crate) p05_hours: f64,
    pub(crate) p50_hours: f64,
    pub(crate) p95_hours: f64,
}

/// The rise of the last records of a period, where a line through some of them is significant.
pub(crate) fn rise(sound: &[Record], settings: &Settings) -> Option<Rise> {
    let last = sound.last()?;
    let most = sound.iter().rev().take_while(|r| r.period == last.period).count();
    let lines = WINDOWS.into_iter().filter(|count| *count <= most).filter_map(|count| {
        let records = &sound[sound.len() - count..];
        significant(records, settings.limit_m).map(|line| (count, line))
    });
    let mut found: Option<Rise> = None;
    for (records, line) in lines {
        let left_m = (settings.limit_m - line.end_m).max(0.0);
        let se = (line.slope_variance * line.inflation()).sqrt();
        let p05_hours = ACCELERATION * left_m / (line.slope + NORMAL_95 * se);
        let slow = (line.slope - NORMAL_95 * se).max(0.0);
        found = Some(Rise {
            records,
            m_per_hour: line.slope,
            m_per_hour_se: se,
            p05_hours: found.map_or(p05_hours, |rise| rise.p05_hours.min(p05_hours)),
            p50_hours: left_m / line.slope,
            p95_hours: left_m / slow / ACCELERATION,
        });
    }
    found
}

/// The line of some records, where it explains them and rises, or where they rise from each to the next.
fn significant(records: &[Record], limit_m: f64) -> Option<Line> {
    let line = Line::fit(records, false)?;
    let is_each =
        records.array_windows().all(|[a, b]| b.gap_m - a.gap_m > EACH_ERRORS * a.error_m.hypot(b.error_m));
    let span_hours = records.last()?.hours - records.first()?.hours;
    let error_m = (records.iter().map(|r| r.error_m.powi(2)).sum::<f64>() / records.len() as f64).sqrt();
    let rise_m = line.slope * span_hours;
    let is_steep = line.slope > SLOPE_ERRORS * (line.slope_variance * line.inflation()).sqrt();
    let is_large = rise_m > (RISE_SHARE * limit_m).max(RISE_ERRORS * error_m);
    (is_large && (is_each || (is_steep && line.explains()))).then_some(line)
}
