//! Days between times, and times of samples on a uniform clock with breaks.

use jiff::{SignedDuration, Timestamp};

/// Seconds of a day.
pub const DAY_S: f64 = 86_400.0;

/// Days from one time to another.
pub fn days_between(from: Timestamp, to: Timestamp) -> f64 {
    to.duration_since(from).as_secs_f64() / DAY_S
}

/// Time a number of days later, to the second; `None` beyond the calendar.
pub fn days_after(from: Timestamp, days: f64) -> Option<Timestamp> {
    from.checked_add(SignedDuration::try_from_secs_f64((days * DAY_S).round()).ok()?).ok()
}

/// A date for readers: `28 Dec`, with its year where it is more than half a year from the date of its text.
pub fn day_text(at: Timestamp, today: Timestamp) -> String {
    let is_near = days_between(today, at).abs() <= 183.0;
    at.strftime(if is_near { "%-d %b" } else { "%-d %b %Y" }).to_string()
}

/// Time of a sample index, which may be fractional, s after the first sample: a constant step, restarted at each of the
/// `breaks` (index of the first sample after the break, its time in s).
///
/// ```
/// # use records::sample_time_s;
/// let breaks = [(4, 9.0)];
/// assert_eq!([3.0, 4.0, 5.5].map(|k| sample_time_s(k, 0.5, &breaks)), [1.5, 9.0, 9.75]);
/// ```
pub fn sample_time_s(sample: f64, step_s: f64, breaks: &[(usize, f64)]) -> f64 {
    let passed = breaks.partition_point(|(first, _)| *first as f64 <= sample);
    let (first, begin_s) = passed.checked_sub(1).map_or((0, 0.0), |last| breaks[last]);
    begin_s + (sample - first as f64) * step_s
}
