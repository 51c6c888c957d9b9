//! One clock for a log: which rows count, in which order, at which step, and where time breaks. The rules for damaged time
//! are in `docs/equations.md`, "Time".

use std::ops::Range;

use jiff::Timestamp;

use crate::error::{Fault, time_unit_unknown};
use crate::mapping::ClockMapping;

pub(crate) const DAY_S: f64 = 86_400.0;

/// A step longer than this many usual steps is a break: the filter cannot predict across it.
pub(crate) const BREAK_STEPS: f64 = 1.5;

/// Most rows lost in a row that count as missing samples, and the share of the rows with a break before them from which they do.
const MOST_LOST: f64 = 5.0;
const OFTEN_LOST: f64 = 0.01;
/// Stamps jitter if over `JITTERED` of the steps are off a multiple of the usual step by over `JITTER_STEPS` of it.
const JITTERED: f64 = 0.25;
const JITTER_STEPS: f64 = 0.2;
/// Fewer rows do not show jitter.
const JITTERED_ROWS: usize = 100;
/// Stands for a lost row among the rows that count.
pub(super) const LOST: u32 = u32::MAX;

/// A declared rate and the stamps may differ by this share: more is another rate, not a better one.
const RATE_TOLERANCE: f64 = 0.25;

/// Shortest and longest usual step that a recorder of positions can have, s.
const PLAUSIBLE_STEP_S: (f64, f64) = (1e-6, 1e5);

/// The largest first stamp of a clock of numbers, s: more than three thousand years.
const MAX_FIRST_STAMP_S: f64 = 1e11;

/// How far stamps may fall back by default, s.
const MAX_BACK_S: f64 = 1.0;
/// No clock restarts so often that a larger share of the stamps falls.
const UNORDERED_SHARE: f64 = 1.0 / 3.0;

/// The longest pause within one flight by default, s: recorders pause for minutes, and a turnaround lasts longer.
const MAX_GAP_S: f64 = 3600.0;

/// A pause divides two flights only if each side is at least this long, s: wrong stamps before a clock is set are shorter.
const SHORTEST_FLIGHT_S: f64 = 30.0;

/// A coarse clock's ticks are followed with this time constant, s: its rate is never quite the declared one.
const TICK_FOLLOW_S: f64 = 10.0;

/// The rows of a log on one clock.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct TimeBase {
    /// The declared rate's step, else the usual step, s.
    pub(crate) step_s: f64,
    pub(crate) rows: usize,
    /// The rows that count, in order of time, [`LOST`] among them; none when every row counts as it stands.
    pub(crate) kept: Option<Vec<u32>>,
    /// Unbroken stretches, in kept rows.
    pub(crate) segments: Vec<Range<usize>>,
    /// The first row after each break, and its time since the first row by the stamps, s.
    pub(crate) breaks: Vec<(usize, f64)>,
    pub(crate) repairs: TimestampRepairs,
}

/// Repairs that were needed to put a log on one clock.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct TimestampRepairs {
    /// Rows without a stamp, left out.
    pub unstamped: usize,
    /// Rows without a stamp that got one, since the rate is declared.
    pub filled: usize,
    /// Stamps below the one before.
    pub out_of_order: usize,
    /// Rows that repeat a stamp, left out.
    pub repeated: usize,
    /// Rows spread evenly, since their stamps jitter.
    pub jittered: usize,
}

impl TimeBase {
    /// The values of the rows that count, in order of time; NaN for a lost row.
    pub(crate) fn keep(&self, values: Vec<f64>) -> Vec<f64> {
        match &self.kept {
            None => values,
            Some(kept) => {
                kept.iter().map(|&row| values.get(row as usize).copied().unwrap_or(f64::NAN)).collect()
            }
        }
    }

    /// The stamps of the rows that count; a lost row has that of even rows.
    pub(crate) fn keep_stamps(&self, stamps: Timestamps) -> Timestamps {
        let mut seconds = self.keep(stamps.seconds);
        for row in 1..seconds.len() {
            if seconds[row].is_nan() {
                seconds[row] = seconds[row - 1] + self.step_s;
            }
        }
        Timestamps { seconds, ..stamps }
    }

    /// Whether the rows are those of one flight by their clock.
    pub(crate) fn check_one_flight(&self, clock: &ClockMapping) -> Result<(), Fault> {
        let max_gap_s = clock.max_gap_s.unwrap_or(MAX_GAP_S);
        let rows = self.segments.last().map_or(0, |last| last.end);
        let length_s = |rows: usize| rows as f64 * self.step_s;
        let mut start = (0, 0.0);
        for &(row, after_s) in &self.breaks {
            let before_s = start.1 + length_s(row - start.0 - 1);
            let shortest_s = length_s(row.min(rows - row));
            if after_s - before_s > max_gap_s && shortest_s >= SHORTEST_FLIGHT_S {
                let end_s = self.breaks.last().map_or(0.0, |last| last.1 + length_s(rows - last.0));
                let hint = "write each flight to a file of its own, or name the column with the flight or the departure in `identity.columns`; if it is one flight, raise `clock.max_gap_s`";
                let fault = Fault::new("several_flights", "the log seems to hold two flights", hint);
                return Err(fault
                    .row(row as u64)
                    .found(format!("samples from 0 to {before_s:.0} s and from {after_s:.0} to {end_s:.0} s after the first one"))
                    .expected(format!("pauses of no more than {max_gap_s} s (`clock.max_gap_s`)")));
            }
            start = (row, after_s);
        }
        Ok(())
    }
}

/// Origin of a clock: the meaning of its first timestamp, or of the number 0 in its column.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum TimeOrigin {
    /// Where the log begins: rows without stamps.
    Start,
    /// Seconds from an unknown zero that all clocks of a log share.
    Counted(f64),
    /// Seconds since midnight.
    OfDay(f64),
    /// An instant.
    Utc(Timestamp),
    /// A local time, read as if it were UTC, whose zone the log does not name.
    Local(Timestamp),
}

impl TimeOrigin {
    /// Seconds from another clock's origin to this one, where both mean the same kind of time.
    pub(crate) fn since(self, other: Self) -> Option<f64> {
        match (self, other) {
            (Self::Start, _) | (_, Self::Start) => Some(0.0),
            (Self::Counted(a), Self::Counted(b)) => Some(a - b),
            // A channel may begin before midnight, and another one after it.
            (Self::OfDay(a), Self::OfDay(b)) => Some((a - b + 0.5 * DAY_S).rem_euclid(DAY_S) - 0.5 * DAY_S),
            (Self::Utc(a), Self::Utc(b)) | (Self::Local(a), Self::Local(b)) => {
                Some(a.duration_since(b).as_secs_f64())
            }
            _ => None,
        }
    }
}

/// The stamps of some rows: seconds since the first one; NaN where a row has none.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Timestamps {
    /// The column they come from, for diagnostics.
    pub(crate) column: String,
    pub(crate) seconds: Vec<f64>,
    /// What the first stamp means.
    pub(crate) origin: TimeOrigin,
}

impl Timestamps {
    /// Evenly spaced stamps, for rows that have none.
    pub(crate) fn uniform(rows: usize, rate_hz: f64) -> Self {
        let seconds = (0..rows).map(|k| k as f64 / rate_hz).collect();
        Self { column: "clock.rate_hz".into(), seconds, origin: TimeOrigin::Start }
    }
}

/// Evenly spaced rows at a declared rate, when a log has no stamps.
pub(crate) fn uniform(rows: usize, rate_hz: f64) -> TimeBase {
    TimeBase {
        step_s: rate_hz.recip(),
        rows,
        kept: None,
        segments: std::iter::once(0..rows).collect(),
        breaks: Vec::new(),
        repairs: TimestampRepairs::default(),
    }
}

/// Puts timestamped rows on one clock, and repairs the timestamps where the mapping defines how.
/// The caller adds the column of the timestamps to an error.
pub(crate) fn build_time_base(stamps: &mut Timestamps, clock: &ClockMapping) -> Result<TimeBase, Fault> {
    if let TimeOrigin::Counted(first_s) = stamps.origin {
        plausible(first_s, "the first stamp", (-MAX_FIRST_STAMP_S, MAX_FIRST_STAMP_S))?;
    }
    if clock.tick_s.is_none() && stamps.seconds.len() > 1 && strictly_rising(&stamps.seconds) {
        let steps: Vec<f64> = stamps.seconds.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let longest_s = steps.iter().copied().fold(0.0, f64::max);
        let step_s = checked_step(usual_step(steps), clock)?;
        if longest_s <= BREAK_STEPS * step_s {
            return Ok(TimeBase { step_s, ..uniform(stamps.seconds.len(), 1.0) });
        }
    }
    let is_in_no_order = is_in_no_order(&stamps.seconds);
    let usual_s = if is_in_no_order { f64::INFINITY } else { MAX_BACK_S };
    let max_back_s = clock.max_back_s.unwrap_or(usual_s);
    let filled = clock.rate_hz.map_or(0, |rate_hz| fill_missing(&mut stamps.seconds, rate_hz));
    let pieces = split_at_resets(&stamps.seconds, max_back_s, clock.split_at_jumps)?;
    let jittered_s =
        if clock.tick_s.is_some() || is_in_no_order { None } else { jittered_step(&stamps.seconds) };
    if let Some(tick_s) = clock.tick_s.or(jittered_s) {
        let seen_s = || jittered_s.unwrap_or_else(|| coarse_step(&stamps.seconds, tick_s));
        let step_s = clock.rate_hz.map_or_else(seen_s, f64::recip);
        pieces.iter().for_each(|piece| spread_ticks(&mut stamps.seconds[piece.clone()], step_s, tick_s));
    }
    let t = &stamps.seconds;
    let falls = t.windows(2).filter(|w| w[1] < w[0]).count().saturating_sub(pieces.len() - 1);
    let kept = if pieces.len() == 1 && strictly_rising(t) { None } else { Some(sort_dedup(t, &pieces)) };
    let at = |i: usize| kept.as_ref().map_or(t[i], |rows| t[rows[i] as usize]);
    let count = kept.as_ref().map_or(t.len(), Vec::len);
    let step = |i: usize| at(i) - at(i - 1);
    if count < 2 {
        let hint = "map the column with the time, or give only `clock.rate_hz`";
        let fault = Fault::new("time_stands_still", "time does not advance", hint);
        return Err(fault.found(format!("{} rows with one stamp", t.len())));
    }
    let seen_s = usual_step((1..count).map(step).filter(|s| *s > 0.0).collect());
    let step_s = checked_step(seen_s, clock)?;
    let breaks: Vec<usize> =
        (1..count).filter(|&i| step(i) > BREAK_STEPS * step_s || step(i) <= 0.0).collect();
    let first_s = match stamps.origin {
        TimeOrigin::Counted(first_s) | TimeOrigin::OfDay(first_s) => first_s,
        _ => f64::NAN,
    };
    // After 041359.99 comes 041400.00; a recorder may pause for 40 s, but not up to each full hundred.
    let is_packed = |&i: &usize| {
        ((step(i) - step_s) % 4000.0 - 40.0).abs() < step_s
            && (first_s + at(i) + 0.5 * step_s).rem_euclid(100.0) < step_s
    };
    if breaks.len() > 1 && breaks.iter().all(is_packed) {
        let found = "a clock that reads as HHMMSS: it leaps by 40 after each minute";
        return Err(time_unit_unknown(&stamps.column, found));
    }
    let unstamped = t.iter().filter(|s| s.is_nan()).count();
    let jittered = jittered_s.map_or(0, |_| count);
    let repeated = t.len() - unstamped - count;
    let repairs = TimestampRepairs { unstamped, filled, out_of_order: falls, repeated, jittered };
    let segments = split_at(count, &breaks);
    let is_sorted = |segment: &Range<usize>| (segment.start + 1..segment.end).all(|i| step(i) > 0.0);
    debug_assert!(segments.iter().all(is_sorted), "timestamps of a segment increase");
    let broken = |&row: &usize| Break { row, steps: step(row) / step_s, after_s: at(row) - at(0) };
    let breaks: Vec<Break> = breaks.iter().map(broken).collect();
    Ok(with_lost_rows(
        TimeBase { step_s, rows: t.len(), kept, segments, breaks: Vec::new(), repairs },
        &breaks,
    ))
}

/// A step that is too long: the row after it, its length in usual steps, and the time since the first row, s.
struct Break {
    row: usize,
    steps: f64,
    after_s: f64,
}

/// The same with its breaks; where rows are often lost, the lost rows are missing samples instead.
fn with_lost_rows(base: TimeBase, breaks: &[Break]) -> TimeBase {
    let lost = |Break { steps, .. }: &Break| {
        let lost = steps.round() - 1.0;
        ((1.0..=MOST_LOST).contains(&lost) && (steps - lost - 1.0).abs() < 0.3).then_some(lost as usize)
    };
    let count = base.segments.last().map_or(0, |last| last.end);
    let is_often = breaks.len() as f64 > OFTEN_LOST * count as f64;
    let all_lost: usize = breaks.iter().filter_map(lost).sum();
    if !is_often || all_lost == 0 || all_lost > count {
        return TimeBase { breaks: breaks.iter().map(|found| (found.row, found.after_s)).collect(), ..base };
    }
    let (mut filled, mut left) = (Vec::new(), Vec::new());
    for (k, segment) in base.segments.into_iter().enumerate() {
        if let Some(before) = k.checked_sub(1).map(|k| &breaks[k]) {
            match lost(before) {
                Some(lost) => filled.extend(std::iter::repeat_n(LOST, lost)),
                None => left.push((filled.len(), before.after_s)),
            }
        }
        filled.extend(segment.map(|row| base.kept.as_ref().map_or(row as u32, |kept| kept[row])));
    }
    let rows: Vec<usize> = left.iter().map(|(row, _)| *row).collect();
    TimeBase { segments: split_at(filled.len(), &rows), breaks: left, kept: Some(filled), ..base }
}

/// Whether rows were written backwards or in no order, so that sorting them loses nothing. Two recordings whose rows
/// alternate have stamps in common, and are not sorted into each other.
fn is_in_no_order(seconds: &[f64]) -> bool {
    let fallen = seconds.windows(2).filter(|w| w[1] < w[0]).count() as f64;
    let mut sorted = Vec::new();
    if fallen > UNORDERED_SHARE * seconds.len() as f64 {
        sorted.extend(seconds.iter().copied().filter(|s| !s.is_nan()));
        sorted.sort_unstable_by(f64::total_cmp);
    }
    sorted.len() > 1 && strictly_rising(&sorted)
}

/// The declared step, where one is and the stamps do not contradict it; else the one that was seen.
fn checked_step(seen_s: f64, clock: &ClockMapping) -> Result<f64, Fault> {
    let step_s = clock.rate_hz.map_or(seen_s, f64::recip);
    if (seen_s / step_s - 1.0).abs() > RATE_TOLERANCE {
        let (declared_hz, seen_hz) = (step_s.recip(), seen_s.recip());
        let message = format!("timestamps give {seen_hz} Hz but `clock.rate_hz` = {declared_hz}");
        let hint = "check `clock.unit`; omit `clock.rate_hz` to use the rate of the timestamps";
        return Err(Fault::new("rate_contradicts", message, hint)
            .found(format!("{seen_hz:.6} Hz by the median step"))
            .expected(format!("{declared_hz} Hz (`clock.rate_hz`)")));
    }
    plausible(step_s, "the step", PLAUSIBLE_STEP_S)
}

fn plausible(value_s: f64, what: &str, (least_s, most_s): (f64, f64)) -> Result<f64, Fault> {
    if (least_s..=most_s).contains(&value_s) {
        return Ok(value_s);
    }
    let message = format!("the clock is not plausible: {what} is {value_s:e} s");
    let hint = "check `clock.column` and `clock.unit`, and that the file is intact";
    Err(Fault::new("time_implausible", message, hint).expected(format!("{least_s:e} to {most_s:e} s")))
}

/// Gives rows without a stamp theirs where, at the declared rate, they just fill the time between their
/// neighbours; returns how many got one.
fn fill_missing(seconds: &mut [f64], rate_hz: f64) -> usize {
    let (mut filled, mut before) = (0, None);
    for row in 0..seconds.len() {
        if seconds[row].is_nan() {
            continue;
        }
        let last = before.replace(row).unwrap_or(row);
        let (rows, start) = (row - last, seconds[last]);
        let between = seconds[row] - start;
        if rows > 1 && (between * rate_hz - rows as f64).abs() < 0.5 {
            (1..rows).for_each(|k| seconds[last + k] = start + between * k as f64 / rows as f64);
            filled += rows - 1;
        }
    }
    filled
}

/// Splits the rows where the clock falls back by more than `max_back_s`; an error unless `split`.
fn split_at_resets(seconds: &[f64], max_back_s: f64, split: bool) -> Result<Vec<Range<usize>>, Fault> {
    let (mut newest, mut deep, mut cuts) = (f64::NEG_INFINITY, None, Vec::new());
    for (row, &s) in seconds.iter().enumerate().filter(|(_, s)| !s.is_nan()) {
        if newest - s > max_back_s {
            deep.get_or_insert((row as u64, newest, s));
            cuts.push(row);
            newest = if split { s } else { newest };
        }
        newest = newest.max(s);
    }
    match deep {
        Some((row, before_s, after_s)) if !split => {
            let hint = "if the file joins several recordings, set `clock.split_at_jumps = true`; if a counter starts again, set `clock.wraps_at` to the value at which it does";
            let fault = Fault::new("time_goes_back", "time runs backwards", hint);
            let found = format!("{after_s} s after {before_s} s; {} rows lie so far back", cuts.len());
            let most = format!("stamps that fall by no more than {max_back_s} s (`clock.max_back_s`)");
            Err(fault.row(row).found(found).expected(most))
        }
        _ => Ok(split_at(seconds.len(), &cuts)),
    }
}

/// The step of rows whose clock ticks coarsely: the time of all intervals between neighbouring ticks by
/// the rows in them.
fn coarse_step(seconds: &[f64], tick_s: f64) -> f64 {
    let (mut time_s, mut rows, mut since) = (0.0, 0_usize, 0_usize);
    let mut last = f64::NAN;
    for &s in seconds.iter().filter(|s| !s.is_nan()) {
        if s > last {
            if s - last <= BREAK_STEPS * tick_s {
                (time_s, rows) = (time_s + s - last, rows + since);
            }
            since = 0;
        }
        since += 1;
        last = s;
    }
    if rows == 0 { tick_s } else { time_s / rows as f64 }
}

/// The mean step of rows whose stamps jitter by so much that steps look like breaks; `None` if they do not. Lost and
/// swapped rows make steps of whole multiples of the usual one.
fn jittered_step(seconds: &[f64]) -> Option<f64> {
    let steps: Vec<f64> =
        seconds.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| !step.is_nan()).collect();
    let usual_s = usual_step(steps.iter().copied().filter(|step| *step > 0.0).collect());
    let share = |is_it: fn(f64) -> bool| {
        steps.iter().filter(|step| is_it(**step / usual_s)).count() as f64 / steps.len() as f64
    };
    let is_jittered = steps.len() >= JITTERED_ROWS
        && share(|steps| steps <= 0.0 || steps > BREAK_STEPS) > OFTEN_LOST
        && share(|steps| (steps - 1.0).abs() > 2.0) < OFTEN_LOST
        && share(|steps| (steps - steps.round()).abs() > JITTER_STEPS) > JITTERED;
    let whole = || steps.iter().filter(|step| step.abs() <= MOST_LOST * usual_s);
    is_jittered.then(|| whole().sum::<f64>() / whole().count() as f64)
}

/// Spreads rows evenly over coarse ticks. A row lies within the tick that stamps it. Where a stamp differs from the even
/// time by more than one tick and one break, the even time starts again at the stamp.
fn spread_ticks(seconds: &mut [f64], step_s: f64, tick_s: f64) {
    let follow = (step_s / TICK_FOLLOW_S).min(1.0);
    let mut even = f64::NAN;
    for s in seconds.iter_mut().filter(|s| !s.is_nan()) {
        let (next, middle) = (even + step_s, *s + 0.5 * tick_s);
        even = if (next - middle).abs() <= tick_s + BREAK_STEPS * step_s {
            next + follow * (middle - next)
        } else {
            *s
        };
        *s = even;
    }
}

/// Whether the stamps rise strictly; false if a row has no stamp, as NaN compares false.
fn strictly_rising(t: &[f64]) -> bool {
    t.first().is_some_and(|s| !s.is_nan()) && t.windows(2).all(|w| w[0] < w[1])
}

/// Rows with a stamp, piece by piece in order of time, the first of each repeated stamp.
#[expect(clippy::float_cmp, reason = "a repeated stamp repeats its bits")]
fn sort_dedup(t: &[f64], pieces: &[Range<usize>]) -> Vec<u32> {
    let mut rows = Vec::with_capacity(t.len());
    for piece in pieces {
        let first = rows.len();
        rows.extend(piece.clone().filter(|&i| !t[i].is_nan()).map(|i| i as u32));
        rows[first..].sort_by(|&a, &b| t[a as usize].total_cmp(&t[b as usize]));
    }
    rows.dedup_by(|later, first| t[*later as usize] == t[*first as usize]);
    rows
}

/// Ticks are coarse if steps differ by more than this share of the median step.
const COARSE_TICK_SHARE: f64 = 0.02;

/// The usual step: the lower median, which is an element of the steps, so that none is invented.
///
/// Where stamps are rounded to ticks that are coarse compared with the step (milliseconds at 400 Hz: 2, 3, 2, 3),
/// no element is right; then it is the mean of the steps that are no breaks.
fn usual_step(mut steps: Vec<f64>) -> f64 {
    /// Rounding of the stamps themselves, s.
    const SAME_S: f64 = 1e-7;
    if steps.is_empty() {
        return f64::NAN;
    }
    let middle = (steps.len() - 1) / 2;
    let median = *steps.select_nth_unstable_by(middle, f64::total_cmp).1;
    let even = |s: &&f64| **s <= BREAK_STEPS * median + SAME_S;
    let (mut low, mut high) = (median, median);
    for &s in steps.iter().filter(even) {
        (low, high) = (low.min(s), high.max(s));
    }
    let between = |s: &f64| *s > low + SAME_S && *s < high - SAME_S;
    let is_rounded = high - low > COARSE_TICK_SHARE * median && !steps.iter().filter(even).any(between);
    if !is_rounded {
        return median;
    }
    let (sum, count) = steps.iter().filter(even).fold((0.0, 0_usize), |(sum, n), s| (sum + s, n + 1));
    sum / count as f64
}

fn split_at(count: usize, breaks: &[usize]) -> Vec<Range<usize>> {
    let starts = std::iter::once(0).chain(breaks.iter().copied());
    let ends = breaks.iter().copied().chain(std::iter::once(count));
    starts.zip(ends).map(|(start, end)| start..end).collect()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn stamps(seconds: &[f64]) -> Timestamps {
        Timestamps { column: "t".into(), seconds: seconds.to_vec(), origin: TimeOrigin::Counted(0.0) }
    }

    fn base(seconds: &[f64], clock: &ClockMapping) -> Result<TimeBase, Fault> {
        build_time_base(&mut stamps(seconds), clock)
    }

    fn usual() -> ClockMapping {
        ClockMapping::default()
    }

    #[test]
    fn repeated_missing_and_swapped_stamps_are_mended_and_counted() {
        let base = base(&[0.0, 0.2, 0.1, 0.1, f64::NAN, 0.3], &usual()).unwrap();
        assert_eq!(base.kept, Some(vec![0, 2, 1, 5]));
        assert_eq!(
            base.repairs,
            TimestampRepairs { unstamped: 1, out_of_order: 1, repeated: 1, ..Default::default() }
        );
    }

    /// Of 700 rows at 100 Hz every seventh is lost, and ten in a row: the seventh ones are missing samples, the ten a break.
    #[test]
    fn rows_that_are_often_lost_are_missing_samples() {
        let is_there = |row: &u32| row % 7 != 3 && !(300..310).contains(row);
        let rows: Vec<u32> = (0..700).filter(is_there).collect();
        let seconds: Vec<f64> = rows.iter().map(|row| 0.01 * f64::from(*row)).collect();
        let found = base(&seconds, &usual()).unwrap();
        assert_eq!(found.segments, [0..300, 300..690]);
        let values = found.keep(rows.iter().map(|row| f64::from(*row)).collect());
        let wanted = (0..700).filter(|row| !(300..310).contains(row));
        for (row, value) in wanted.zip(values) {
            assert!(
                if is_there(&row) { value.to_bits() == f64::from(row).to_bits() } else { value.is_nan() },
                "{row}: {value}"
            );
        }
        let even = found.keep_stamps(stamps(&seconds)).seconds;
        assert!((0..300).all(|row| (even[row] - 0.01 * row as f64).abs() < 1e-9), "{even:?}");
    }

    #[test]
    fn a_deep_fall_is_refused_with_its_row_or_splits_the_log() {
        let t = [0.0, 0.1, 5.0, 5.1, 1.0, 1.1, 1.2];
        let refused = base(&t, &usual()).unwrap_err().0;
        assert_eq!((refused.code.as_str(), refused.row), ("time_goes_back", Some(4)));
        assert!(refused.found.unwrap().ends_with("3 rows lie so far back"));
        let split = base(&t, &ClockMapping { split_at_jumps: true, ..usual() }).unwrap();
        assert_eq!(split.segments, [0..2, 2..4, 4..7]);
        assert_eq!(split.repairs.out_of_order, 0);
    }

    /// 263 · 327 = 172 · 500 + 1: row k of the second log is sample 263k modulo 500.
    #[test]
    fn a_log_that_was_written_backwards_or_in_no_order_is_sorted() {
        for (step, rows) in [(-1, (0..500).rev().collect()), (263, (0..500).map(|k| 327 * k % 500).collect())]
        {
            let t: Vec<f64> =
                (0..500).map(|k| f64::from((step * k + 499 * i32::from(step < 0)).rem_euclid(500))).collect();
            let base = base(&t, &usual()).unwrap();
            assert_eq!(base.kept, Some(rows));
            assert_eq!((base.segments.len(), base.repairs.repeated), (1, 0));
        }
    }

    /// A clock that stands still; steps of 1e50 s and 1e−300 s, which no recorder has and no filter survives; rows of two
    /// recorders in turn, one of whose clocks is 5 s ahead; and hours, minutes and seconds in one number, from 04:58:00 on.
    #[test]
    fn a_clock_that_cannot_be_used_is_refused() {
        let even = |step_s: f64| -> Vec<f64> { (0..1000).map(|k| f64::from(k) * step_s).collect() };
        let packed = |k: u32| {
            let s = 17_880.0 + 0.05 * f64::from(k);
            (s / 3600.0).floor() * 1e4 + (s % 3600.0 / 60.0).floor() * 100.0 + s % 60.0
        };
        for (seconds, code) in [
            (vec![1.0, 1.0], "time_stands_still"),
            (even(1e50), "time_implausible"),
            (even(1e-300), "time_implausible"),
            (even(1e6), "time_implausible"),
            ((0..2000).map(|k| f64::from(k / 2) * 0.01 + 5.0 * f64::from(k % 2)).collect(), "time_goes_back"),
            ((0..4800).map(packed).collect(), "time_unit_unknown"),
        ] {
            assert_eq!(base(&seconds, &usual()).unwrap_err().0.code, code);
        }
        let mut early = stamps(&[0.0, 0.01, 0.02]);
        early.origin = TimeOrigin::Counted(-1e50);
        let refused = build_time_base(&mut early, &usual()).unwrap_err();
        assert!(refused.0.message.contains("the first stamp is -1e50 s"), "{refused:?}");
    }

    /// A row that is seldom lost begins a new stretch, and so does one after a rest of 40 s in each minute. 400 Hz in whole
    /// milliseconds steps 2, 3, 2, 3 ms: the step is 2.5 ms, and nothing broke.
    #[test]
    fn clocks_have_their_usual_step_and_break_at_longer_ones() {
        let seldom = (0..700).filter(|row| row % 350 != 3).map(|row| 0.01 * f64::from(row)).collect();
        let resting = (0..4000).map(|k| 60.0 * f64::from(k / 400) + 0.05 * f64::from(k % 400)).collect();
        let ticks = (0..4000).map(|k| (f64::from(k) * 2.5).floor() * 1e-3).collect();
        let rests = (0..10).map(|k| 400 * k..400 * (k + 1)).collect();
        for (seconds, step_s, segments) in [
            (seldom, 0.01, vec![0..3, 3..352, 352..698]),
            (resting, 0.05, rests),
            (ticks, 0.0025, std::iter::once(0..4000).collect()),
        ] {
            let seconds: Vec<f64> = seconds;
            let found = base(&seconds, &usual()).unwrap();
            assert!((found.step_s - step_s).abs() < 1e-6, "{} s", found.step_s);
            assert_eq!(found.segments, segments);
        }
    }

    #[test]
    fn rows_without_a_timestamp_get_one_from_the_rate() {
        let nan = f64::NAN;
        let clock = ClockMapping { rate_hz: Some(10.0), ..usual() };
        let mut holed = stamps(&[0.0, nan, nan, 0.3, nan, 9.0, 9.1]);
        let base = build_time_base(&mut holed, &clock).unwrap();
        assert!((holed.seconds[2] - 0.2).abs() < 1e-12);
        assert_eq!((base.repairs.filled, base.repairs.unstamped), (2, 1));
        assert_eq!(base.segments, [0..4, 4..6]);
        assert_eq!(base.breaks, [(4, 9.0)]);
    }

    /// A computer's clock ticks every 15.6 ms while samples come every 2.5 ms; the stamps of a recorder at 200 Hz are off by
    /// up to 3 ms either way. Both rest after half of their rows.
    #[test]
    fn rows_under_a_coarse_or_a_jittering_clock_are_spread_evenly() {
        type Stamp<'a> = &'a dyn Fn(usize, f64) -> f64;
        const TICK_S: f64 = 0.015_625;
        let coarse = |_, t: f64| (t / TICK_S).floor() * TICK_S;
        let jitter = |row: usize, t| t + 0.006 * (((row as f64).sin() * 43_758.5).rem_euclid(1.0) - 0.5);
        for (stamp, rows, step_s, rest_s, tick_s, jittered, tolerance_s) in [
            (&coarse as Stamp<'_>, 8000, 0.0025, 3.0, Some(TICK_S), 0, TICK_S),
            (&jitter, 6000, 0.005, 1.0, None, 6000, 0.008),
        ] {
            let truth = |row: usize| step_s * row as f64 + if row < rows / 2 { 0.0 } else { rest_s };
            let mut found = stamps(&(0..rows).map(|row| stamp(row, truth(row))).collect::<Vec<_>>());
            let base = build_time_base(&mut found, &ClockMapping { tick_s, ..usual() }).unwrap();
            assert_eq!((base.kept, base.repairs.jittered), (None, jittered));
            assert_eq!(base.segments, [0..rows / 2, rows / 2..rows]);
            assert!((base.step_s / step_s - 1.0).abs() < 0.01, "{} s", base.step_s);
            assert!((0..rows).all(|row| (found.seconds[row] - truth(row)).abs() < tolerance_s));
        }
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
            let base = base(&t, &ClockMapping { max_back_s: Some(2.0), ..usual() }).unwrap();
            let samples = base.kept.clone().unwrap_or_else(|| (0..t.len() as u32).collect());
            let kept: Vec<u32> = samples.iter().copied().filter(|row| *row != LOST).collect();
            prop_assert!(kept.windows(2).all(|w| t[w[0] as usize] < t[w[1] as usize]));
            prop_assert_eq!(kept.len(), distinct.len());
            prop_assert_eq!(base.segments.iter().map(ExactSizeIterator::len).sum::<usize>(), samples.len());
        }
    }
}
