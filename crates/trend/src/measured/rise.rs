//! Local line: the rise of the last records, and when it meets the limit.

use std::borrow::Cow;

use crate::math::NORMAL_95;
use crate::measured::level::{Line, WILD};
use crate::measured::record::Record;
use crate::settings::Settings;

/// Numbers of last records through which a line is laid. Those beyond [`MOST_EVEN`] are for wear that is slow from flight to
/// flight.
const WINDOWS: [usize; 16] = [3, 4, 5, 6, 7, 8, 10, 12, 16, 20, 32, 50, 80, 125, 200, 320];

/// Standard deviation by which an installation moves all its records, a share of the limit.
const INSTALLATION_SHARE: f64 = 0.03;

/// Standard errors of the slope, and share of the limit and errors of the rise, from which a line is significant.
const SLOPE_ERRORS: f64 = 4.0;
const RISE_SHARE: f64 = 0.05;
const RISE_ERRORS: f64 = 5.0;

/// Standard errors by which a record is above the one before: every one where they rise along no line, the last one where
/// its rate counts.
const EACH_ERRORS: f64 = 4.0;

/// Records of a window for each one that may be left out as wild.
const PER_WILD: usize = 5;

/// Share of the records' variance about their mean that a line through an even rise leaves at most, whatever their errors.
const UNEVEN: f64 = 0.12;
/// Fewest and most records that rise evenly: wear of several rates looks even over many.
const LEAST_EVEN: usize = 6;
const MOST_EVEN: usize = 20;

/// The share of the time by the line after which the limit may be met where the rate still grows.
const ACCELERATION: f64 = 0.75;

/// Least factor of the earliest time where short lines are steeper than the longest.
const SPED_UP: f64 = 0.6;

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

/// The rise of the last records since a renewal, where a line through some of them is significant.
pub(crate) fn rise(sound: &[Record], settings: &Settings) -> Option<Rise> {
    let last = sound.last()?;
    let most = sound.iter().rev().take_while(|r| r.renewals == last.renewals).count();
    let lines = WINDOWS.into_iter().filter(|count| *count <= most).filter_map(|count| {
        let records = comparable(&sound[sound.len() - count..], settings.limit_m);
        significant(&records, settings.limit_m)
            .or_else(|| significant(&without_outliers(&records)?, settings.limit_m))
            .map(|line| (count, line))
    });
    let mut found: Option<Rise> = None;
    let mut steepest = 0.0_f64;
    for (records, line) in lines {
        let left_m = (settings.limit_m - line.end_m).max(0.0);
        let se = (line.slope_variance * line.inflation()).sqrt();
        let p05_hours = ACCELERATION * left_m / (line.slope + NORMAL_95 * se);
        let slow = (line.slope - NORMAL_95 * se).max(0.0);
        steepest = steepest.max(slow);
        found = Some(Rise {
            records,
            m_per_hour: line.slope,
            m_per_hour_se: se,
            p05_hours: found.map_or(p05_hours, |rise| rise.p05_hours.min(p05_hours)),
            p50_hours: left_m / line.slope,
            p95_hours: left_m / slow / ACCELERATION,
        });
    }
    // Where they rise, the last two show whether they rise faster now.
    if let (Some(rise), [.., before, last]) = (&mut found, sound) {
        let (step_m, hours) = (last.gap_m - before.gap_m, last.hours - before.hours);
        if before.period == last.period && step_m > EACH_ERRORS * before.error_m.hypot(last.error_m) {
            let p05_hours = ACCELERATION * (settings.limit_m - last.gap_m).max(0.0) * hours / step_m;
            rise.p05_hours = rise.p05_hours.min(p05_hours);
        }
    }
    // Wear that has accelerated may accelerate more.
    found.map(|rise| Rise {
        p05_hours: rise.p05_hours * (rise.m_per_hour / steepest).clamp(SPED_UP, 1.0),
        ..rise
    })
}

/// Records of one installation as they are; those of several with the error that each installation adds.
fn comparable(records: &[Record], limit_m: f64) -> Cow<'_, [Record]> {
    if records.array_windows().all(|[a, b]| a.period == b.period) {
        return Cow::Borrowed(records);
    }
    let widened = |r: &Record| Record { error_m: r.error_m.hypot(INSTALLATION_SHARE * limit_m), ..*r };
    records.iter().map(widened).collect()
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
    let is_even =
        || (LEAST_EVEN..=MOST_EVEN).contains(&records.len()) && line.unexplained_share(records) < UNEVEN;
    (is_large && (is_each || (is_steep && (line.explains() || is_even())))).then_some(line)
}

/// The records without outliers, which lie far from the line of the others, at most one in five; `None` without outliers, and
/// where both of the last two would be outliers: two records have a new level.
fn without_outliers(records: &[Record]) -> Option<Vec<Record>> {
    // One that lies far from the line of the others lies half as far from the line of all.
    let (line, last) = (Line::fit(records, false)?, records.last()?);
    if !records.iter().any(|record| line.off_m(record, last).abs() > 0.5 * WILD * record.error_m) {
        return None;
    }
    let mut kept = records.to_vec();
    for _ in 0..records.len() / PER_WILD {
        let without = |k: usize| -> Vec<Record> { [&kept[..k], &kept[k + 1..]].concat() };
        let chi2 = |others: &[Record]| Line::fit(others, false).map_or(f64::INFINITY, |line| line.chi2);
        let worst = (0..kept.len()).min_by(|a, b| chi2(&without(*a)).total_cmp(&chi2(&without(*b))))?;
        let others = without(worst);
        let is_wild =
            Line::fit(&others, false)?.off_m(&kept[worst], others.last()?).abs() > WILD * kept[worst].error_m;
        if !is_wild {
            break;
        }
        kept = others;
    }
    let [.., next_to_last, _] = records else { return None };
    let reaches_end = kept.last().is_some_and(|record| record.hours >= next_to_last.hours);
    (kept.len() < records.len() && reaches_end).then_some(kept)
}
