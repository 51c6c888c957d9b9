//! Level at the last record: a line through as many of the last records as it explains.

use crate::measured::record::Record;

/// Most records of a level's line.
const WINDOW: usize = 12;

/// With fewer records than this, a constant is tried before a line.
const LEAST_LINE: usize = 5;

/// Standard errors beyond which a single record between others is an outlier.
pub(crate) const WILD: f64 = 5.0;

/// Standard errors, and share of the limit, by which a lone last record must lie below the level to be ignored.
const FALL_ERRORS: f64 = 4.0;
const FALL_SHARE: f64 = 0.05;

/// The measured level of the gap at the last record.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Level {
    /// The gap, metres.
    pub gap_m: f64,
    /// Standard error of the level, from errors and scatter of its records and from an error that all may share, metres.
    pub se_m: f64,
    /// The standard error without that shared error, which two levels of a unit have in common too, metres.
    pub(crate) own_se_m: f64,
    /// Number of records of the line, without outliers.
    pub records: usize,
    /// Number of records from the first of the line to the last one, outliers included.
    pub(crate) window: usize,
    pub(crate) period: u32,
    slope_m_per_hour: f64,
    hours: f64,
}

impl Level {
    /// Value of the level's line at other hours, m.
    pub(crate) fn at(&self, hours: f64) -> f64 {
        self.gap_m + self.slope_m_per_hour * (hours - self.hours)
    }
}

/// Weighted least-squares line through some records.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Line {
    /// Value at the last record, m, and its variance, m².
    pub(crate) end_m: f64,
    pub(crate) end_m2: f64,
    pub(crate) slope: f64,
    pub(crate) slope_variance: f64,
    /// Sum of squared residuals in standard errors, and degrees of freedom.
    pub(crate) chi2: f64,
    freedom: f64,
    /// Mean residual of the last two records, in its standard errors.
    last_two: f64,
}

impl Line {
    /// The line of some records, or the constant.
    pub(crate) fn fit(records: &[Record], is_constant: bool) -> Option<Self> {
        let last = records.last()?;
        let weight = |r: &Record| r.error_m.powi(-2);
        let total: f64 = records.iter().map(weight).sum();
        let mean =
            |of: &dyn Fn(&Record) -> f64| records.iter().map(|r| weight(r) * of(r)).sum::<f64>() / total;
        let (x, y) = (mean(&|r| r.hours - last.hours), mean(&|r| r.gap_m));
        let xx = total * mean(&|r| (r.hours - last.hours - x).powi(2));
        let xy = total * mean(&|r| (r.hours - last.hours - x) * (r.gap_m - y));
        let (slope, slope_variance) = match is_constant {
            true => (0.0, 0.0),
            false if xx > 0.0 => (xy / xx, xx.recip()),
            false => return None,
        };
        let off = |r: &Record| (r.gap_m - y - slope * (r.hours - last.hours - x)) / r.error_m;
        let chi2 = records.iter().map(|r| off(r).powi(2)).sum();
        let near = &records[records.len().saturating_sub(2)..];
        let last_two = near.iter().map(off).sum::<f64>() / (near.len() as f64).sqrt();
        Some(Self {
            end_m: y - slope * x,
            end_m2: total.recip() + x * x * slope_variance,
            slope,
            slope_variance,
            chi2,
            freedom: records.len() as f64 - if is_constant { 1.0 } else { 2.0 },
            last_two,
        })
    }

    /// Residual of a record, m; `last` is the last record of the line.
    pub(crate) fn off_m(&self, record: &Record, last: &Record) -> f64 {
        record.gap_m - self.end_m - self.slope * (record.hours - last.hours)
    }

    /// Sum of squared residuals, divided by that of the fitted constant.
    pub(crate) fn unexplained_share(&self, records: &[Record]) -> f64 {
        Self::fit(records, true).map_or(1.0, |constant| self.chi2 / constant.chi2.max(f64::MIN_POSITIVE))
    }

    /// Whether the records' errors explain the residuals: 99.8 % of sound windows pass.
    pub(crate) fn explains(&self) -> bool {
        self.chi2 <= self.freedom + 4.0 * (2.0 * self.freedom).sqrt() + 3.0 && self.last_two.abs() <= 3.0
    }

    /// Factor by which the scatter about the line increases the variances, at least one.
    pub(crate) fn inflation(&self) -> f64 {
        if self.freedom > 0.0 { (self.chi2 / self.freedom).max(1.0) } else { 1.0 }
    }
}

/// The level at the last record, by a line through the longest window of its period, up to twelve records, that it explains.
///
/// A lone record far below a level of several records does not lower the level, even as the first of a new installation;
/// two such records do.
pub(crate) fn measured_level(sound: &[Record], limit_m: f64) -> Option<Level> {
    let level = level_at_end(sound)?;
    let (last, before) = sound.split_last()?;
    let Some(rest) = level_at_end(before).filter(|rest| level.records == 1 && rest.records > 1) else {
        return Some(level);
    };
    let fall_m = rest.gap_m - last.gap_m;
    let is_lone_fall = before.last().is_some_and(|record| record.renewals == last.renewals)
        && fall_m > (FALL_ERRORS * rest.own_se_m.hypot(last.error_m)).max(FALL_SHARE * limit_m);
    Some(if is_lone_fall { Level { window: rest.window + 1, ..rest } } else { level })
}

fn level_at_end(sound: &[Record]) -> Option<Level> {
    let last = sound.last()?;
    let most = sound.iter().rev().take(WINDOW).take_while(|r| r.period == last.period).count();
    (1..=most).rev().find_map(|count| explained(&sound[sound.len() - count..]))
}

/// The level by the line through these records, or, for six or more, through all but one; `None` if no line explains them.
fn explained(records: &[Record]) -> Option<Level> {
    let level = |line: Line, count: usize| {
        let last = records[records.len() - 1];
        let own_se_m = (line.end_m2 * line.inflation()).sqrt();
        Level {
            gap_m: line.end_m,
            // Averaging does not lower an error that all records share.
            se_m: own_se_m.hypot(last.shared_m),
            own_se_m,
            records: count,
            window: records.len(),
            period: last.period,
            slope_m_per_hour: line.slope,
            hours: last.hours,
        }
    };
    let fitted = |records: &[Record]| {
        let constant = Line::fit(records, true).filter(|line| records.len() < LEAST_LINE && line.explains());
        let line = || Line::fit(records, false).filter(|line| records.len() > 2 && line.explains());
        constant.or_else(line)
    };
    if let Some(line) = fitted(records) {
        return Some(level(line, records.len()));
    }
    let (wild, others) = without_wild(records)?;
    let line = fitted(&others)?;
    let last = others.last()?;
    (line.off_m(&wild, last).abs() > WILD * wild.error_m).then(|| level(line, others.len()))
}

/// The record between others that lies farthest from the line through its neighbours, and the others.
fn without_wild(records: &[Record]) -> Option<(Record, Vec<Record>)> {
    if records.len() <= LEAST_LINE {
        return None;
    }
    let off = |[a, b, c]: &[Record; 3]| (b.gap_m - 0.5 * (a.gap_m + c.gap_m)).abs() / b.error_m;
    let inner = records.array_windows().map(off).enumerate().max_by(|a, b| a.1.total_cmp(&b.1))?.0 + 1;
    // If the first record of the window is the outlier, the window shorter by one excludes it.
    let others = records.iter().enumerate().filter(|(k, _)| *k != inner).map(|(_, r)| *r).collect();
    Some((records[inner], others))
}
