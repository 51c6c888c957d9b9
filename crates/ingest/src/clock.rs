//! One clock for a log: which rows count, in which order, at which step, and where time breaks.
//!
//! The rule for damaged time (`docs/equations.md`, "Time"): rows without a stamp are left out; rows
//! out of order are put in order by a stable sort; of repeated stamps the first row is kept; where a
//! step exceeds one and a half times the median, time broke, and the filter starts again. Rows that
//! are in order pass untouched.

use std::ops::Range;

use jiff::Timestamp;

use crate::error::Fault;

/// A step longer than this many median steps is a break: the filter cannot predict across it.
const BREAK_STEPS: f64 = 1.5;

/// A declared rate and the stamps may differ by this share: more is another rate, not a better one.
const RATE_TOLERANCE: f64 = 0.25;

/// The rows of a log on one clock.
#[derive(Debug, Clone, PartialEq)]
pub struct Timeline {
    /// The declared rate's step, else the median step, s.
    pub step_s: f64,
    /// Rows in the file.
    pub rows: usize,
    /// The rows that count, in order of time; none when every row counts as it stands.
    pub kept: Option<Vec<usize>>,
    /// Unbroken stretches, in kept rows.
    pub segments: Vec<Range<usize>>,
    /// The instant of the first kept row, where the clock is absolute.
    pub start_utc: Option<Timestamp>,
    /// What had to be mended.
    pub repairs: Repairs,
}

/// What had to be mended to put a log on one clock.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Repairs {
    /// Rows without a stamp, left out.
    pub unstamped: usize,
    /// Stamps below the one before.
    pub out_of_order: usize,
    /// Rows that repeat a stamp, left out.
    pub repeated: usize,
}

impl Repairs {
    /// Whether nothing had to be mended.
    pub fn none(&self) -> bool {
        *self == Self::default()
    }
}

/// The stamps of a log: seconds since the first one; NaN where a row has none.
#[derive(Debug, Clone, PartialEq)]
pub struct Stamps {
    /// The column they come from, for complaints.
    pub column: String,
    /// Seconds since the first stamp.
    pub seconds: Vec<f64>,
    /// The first stamp, where it is absolute.
    pub start_utc: Option<Timestamp>,
    /// Whether that stamp is a local time whose zone the log does not name.
    pub is_local: bool,
}

/// Evenly spaced rows at a declared rate, when a log has no stamps.
pub fn even(rows: usize, rate_hz: f64) -> Timeline {
    Timeline {
        step_s: rate_hz.recip(),
        rows,
        kept: None,
        segments: std::iter::once(0..rows).collect(),
        start_utc: None,
        repairs: Repairs::default(),
    }
}

/// Puts stamped rows on one clock.
///
/// # Errors
/// [`Fault::TimeGoesBack`] when stamps fall by more than `max_back_s`; [`Fault::TimeStandsStill`] when
/// fewer than two differ; [`Fault::RateContradicts`] when they tell of another rate than was declared.
pub fn align(stamps: &Stamps, rate_hz: Option<f64>, max_back_s: f64) -> Result<Timeline, Fault> {
    let t = &stamps.seconds;
    let falls = check_falls(stamps, max_back_s)?;
    let kept = if falls == 0 && strictly_rising(t) { None } else { Some(ordered(t)) };
    let at = |i: usize| kept.as_ref().map_or(t[i], |rows| t[rows[i]]);
    let count = kept.as_ref().map_or(t.len(), Vec::len);
    let step = |i: usize| at(i) - at(i - 1);
    if count < 2 {
        return Err(Fault::TimeStandsStill { column: stamps.column.clone(), rows: t.len() as u64 });
    }
    let seen_s = median((1..count).map(step).collect());
    let step_s = rate_hz.map_or(seen_s, f64::recip);
    if (seen_s / step_s - 1.0).abs() > RATE_TOLERANCE {
        let (column, declared_hz) = (stamps.column.clone(), step_s.recip());
        return Err(Fault::RateContradicts { column, declared_hz, seen_hz: seen_s.recip() });
    }
    let breaks: Vec<usize> = (1..count).filter(|&i| step(i) > BREAK_STEPS * step_s).collect();
    let unstamped = t.iter().filter(|s| s.is_nan()).count();
    let repairs = Repairs { unstamped, out_of_order: falls, repeated: t.len() - unstamped - count };
    let start_utc = stamps.start_utc.and_then(|start| start.checked_add(seconds(at(0))).ok());
    Ok(Timeline { step_s, rows: t.len(), segments: cut(count, &breaks), kept, start_utc, repairs })
}

fn seconds(s: f64) -> jiff::SignedDuration {
    jiff::SignedDuration::try_from_secs_f64(s).unwrap_or_default()
}

/// Counts falls of the clock and refuses one that is too deep.
fn check_falls(stamps: &Stamps, max_back_s: f64) -> Result<usize, Fault> {
    let (mut falls, mut deep, mut first_deep) = (0, 0, None);
    let mut newest = f64::NEG_INFINITY;
    let mut before = f64::NEG_INFINITY;
    for (row, &s) in stamps.seconds.iter().enumerate().filter(|(_, s)| !s.is_nan()) {
        falls += usize::from(s < before);
        if newest - s > max_back_s {
            deep += 1;
            first_deep.get_or_insert((row as u64, newest, s));
        }
        newest = newest.max(s);
        before = s;
    }
    match first_deep {
        None => Ok(falls),
        Some((row, before_s, after_s)) => {
            let column = stamps.column.clone();
            Err(Fault::TimeGoesBack { column, row, before_s, after_s, max_back_s, times: deep })
        }
    }
}

/// NaN compares false, so a row without a stamp makes the answer no.
fn strictly_rising(t: &[f64]) -> bool {
    t.first().is_some_and(|s| !s.is_nan()) && t.windows(2).all(|w| w[0] < w[1])
}

/// Rows with a stamp, in order of time, the first of each repeated stamp.
#[expect(clippy::float_cmp, reason = "a repeated stamp repeats its bits")]
fn ordered(t: &[f64]) -> Vec<usize> {
    let mut rows: Vec<usize> = (0..t.len()).filter(|&i| !t[i].is_nan()).collect();
    rows.sort_by(|&a, &b| t[a].total_cmp(&t[b]));
    rows.dedup_by(|later, first| t[*later] == t[*first]);
    rows
}

/// The lower median of a non-empty list, which is an element of it: no step is invented.
fn median(mut values: Vec<f64>) -> f64 {
    let middle = (values.len() - 1) / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

fn cut(count: usize, breaks: &[usize]) -> Vec<Range<usize>> {
    let starts = std::iter::once(0).chain(breaks.iter().copied());
    let ends = breaks.iter().copied().chain(std::iter::once(count));
    starts.zip(ends).map(|(start, end)| start..end).collect()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn stamps(seconds: &[f64]) -> Stamps {
        Stamps { column: "t".into(), seconds: seconds.to_vec(), start_utc: None, is_local: false }
    }

    #[test]
    fn an_even_clock_passes_untouched() {
        let t: Vec<f64> = (0..100).map(|i| f64::from(i) * 0.01).collect();
        let line = align(&stamps(&t), None, 1.0).unwrap();
        assert_eq!(line.kept, None);
        assert_eq!(line.segments, cut(100, &[]));
        assert!((line.step_s - 0.01).abs() < 1e-15);
        assert!(line.repairs.none());
    }

    #[test]
    fn a_pause_cuts_the_log_in_two() {
        let line = align(&stamps(&[0.0, 0.1, 0.2, 5.0, 5.1, 5.2]), None, 1.0).unwrap();
        assert_eq!(line.segments, [0..3, 3..6]);
    }

    #[test]
    fn repeated_missing_and_swapped_stamps_are_mended_and_counted() {
        let line = align(&stamps(&[0.0, 0.2, 0.1, 0.1, f64::NAN, 0.3]), None, 1.0).unwrap();
        assert_eq!(line.kept, Some(vec![0, 2, 1, 5]));
        assert_eq!(line.repairs, Repairs { unstamped: 1, out_of_order: 1, repeated: 1 });
    }

    #[test]
    fn a_deep_fall_is_refused_with_its_row() {
        let fault = align(&stamps(&[0.0, 5.0, 1.0, 6.0]), None, 1.0).unwrap_err();
        assert!(matches!(fault, Fault::TimeGoesBack { row: 2, times: 1, .. }), "{fault:?}");
    }

    #[test]
    fn a_clock_that_stands_still_is_refused() {
        assert!(matches!(
            align(&stamps(&[1.0, 1.0]), None, 1.0),
            Err(Fault::TimeStandsStill { rows: 2, .. })
        ));
    }

    proptest! {
        /// Whatever the order of the rows, time rises along the kept rows and no stamp is invented or lost.
        #[test]
        fn kept_rows_rise_and_hold_every_stamp(ticks in proptest::collection::vec(0_u32..50, 2..80)) {
            let t: Vec<f64> = ticks.iter().map(|&k| f64::from(k) * 0.02).collect();
            let mut distinct = ticks.clone();
            distinct.sort_unstable();
            distinct.dedup();
            prop_assume!(distinct.len() > 1);
            let line = align(&stamps(&t), None, 2.0).unwrap();
            let kept = line.kept.clone().unwrap_or_else(|| (0..t.len()).collect());
            prop_assert!(kept.windows(2).all(|w| t[w[0]] < t[w[1]]));
            prop_assert_eq!(kept.len(), distinct.len());
            prop_assert_eq!(line.segments.iter().map(ExactSizeIterator::len).sum::<usize>(), kept.len());
        }
    }
}
