//! Timestamps of a time column: integers, reals, Arrow timestamps or text, to seconds since the first one.

use arrow::array::{ArrayRef, AsArray};
use arrow::compute::cast;
use arrow::datatypes::{DataType, Int64Type, TimeUnit as ArrowTimeUnit};
use jiff::{Timestamp, civil};

use crate::error::ErrorKind;
use crate::parquet::numeric::{append, as_text, wrong_type};
use crate::time::clock::{DAY_S, TimeOrigin, Timestamps};

/// What zero means.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum TickEpoch {
    Own,
    Midnight,
    Utc,
    Local,
}

/// What the numbers of a time column are.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TickFormat {
    pub(crate) per_second: f64,
    /// Whether they have no fraction; texts are read as whole nanoseconds.
    pub(crate) is_whole: bool,
    pub(crate) is_text: bool,
    pub(crate) origin: TickEpoch,
    /// Zero of an instant, s since 1970.
    pub(crate) zero_s: i64,
    pub(crate) wraps_at: Option<f64>,
}

impl TickFormat {
    pub(crate) fn of_timestamp(unit: ArrowTimeUnit, is_local: bool) -> Self {
        let origin = if is_local { TickEpoch::Local } else { TickEpoch::Utc };
        Self { origin, ..Self::of_duration(unit) }
    }

    /// A time of the day, which starts again at midnight.
    pub(crate) fn of_day(unit: ArrowTimeUnit) -> Self {
        let ticks = Self::of_duration(unit);
        Self { origin: TickEpoch::Midnight, wraps_at: Some(DAY_S * ticks.per_second), ..ticks }
    }

    /// A time since an unknown zero.
    pub(crate) fn of_duration(unit: ArrowTimeUnit) -> Self {
        let per_second = match unit {
            ArrowTimeUnit::Second => 1.0,
            ArrowTimeUnit::Millisecond => 1e3,
            ArrowTimeUnit::Microsecond => 1e6,
            ArrowTimeUnit::Nanosecond => 1e9,
        };
        Self { per_second, is_whole: true, is_text: false, origin: TickEpoch::Own, zero_s: 0, wraps_at: None }
    }

    /// ISO 8601 text; an offset in it is taken, and without one the time is local. Where `may_be_of_day`, a text may be
    /// a time of the day alone.
    pub(crate) fn text(may_be_of_day: bool) -> Self {
        let ticks = if may_be_of_day { Self::of_day } else { Self::of_duration };
        Self { is_text: true, origin: TickEpoch::Local, ..ticks(ArrowTimeUnit::Nanosecond) }
    }
}

/// Turns a time column into seconds since its first stamp: ticks are subtracted before they become
/// seconds, so that counts since 1970 lose nothing.
pub(crate) struct TimestampParser<'a> {
    column: &'a str,
    ticks: TickFormat,
    /// The first tick, if it is a whole number.
    first_whole: Option<i64>,
    turns: f64,
    before: f64,
    /// Seconds since the first stamp; of real ticks the ticks themselves, until all are there.
    pub(crate) seconds: Vec<f64>,
}

impl<'a> TimestampParser<'a> {
    pub(crate) fn new(column: &'a str, ticks: TickFormat, rows: usize) -> Self {
        let seconds = Vec::with_capacity(rows.min(1 << 26));
        Self { column, ticks, first_whole: None, turns: 0.0, before: f64::NAN, seconds }
    }

    pub(crate) fn append(&mut self, array: &ArrayRef) -> Result<(), ErrorKind> {
        if self.ticks.is_text {
            let text = as_text(self.column, array)?;
            for (row, value) in text.as_string::<i32>().iter().enumerate() {
                let tick = value.map(|value| self.parsed(value, row)).transpose()?;
                self.push_whole(tick);
            }
        } else if self.ticks.is_whole {
            let whole = cast(array, &DataType::Int64);
            let whole = whole.map_err(|_| wrong_type(self.column, array, "time stamps"))?;
            whole.as_primitive::<Int64Type>().iter().for_each(|tick| self.push_whole(tick));
        } else {
            append(self.column, array, &mut self.seconds)?;
        }
        Ok(())
    }

    fn parsed(&mut self, value: &str, row: usize) -> Result<i64, ErrorKind> {
        let value = value.trim();
        let zoned = value.parse::<Timestamp>().ok();
        if zoned.is_some() && self.ticks.origin == TickEpoch::Local {
            self.ticks.origin = TickEpoch::Utc;
        }
        let local = || {
            let local = value.parse::<civil::DateTime>().ok()?;
            jiff::tz::TimeZone::UTC.to_timestamp(local).ok()
        };
        let instant = zoned.or_else(local);
        let mut tick = instant.and_then(|t| i64::try_from(t.as_nanosecond()).ok());
        if tick.is_none()
            && self.ticks.wraps_at.is_some()
            && let Ok(time) = value.parse::<civil::Time>()
        {
            self.ticks.origin = TickEpoch::Midnight;
            tick = i64::try_from(time.duration_since(civil::Time::midnight()).as_nanos()).ok();
        }
        let found = || format!("`{value}` in row {row}");
        tick.ok_or_else(|| ErrorKind::TimeUnit { column: self.column.to_owned(), found: found() })
    }

    fn push_whole(&mut self, tick: Option<i64>) {
        let Some(tick) = tick else { return self.seconds.push(f64::NAN) };
        let first = *self.first_whole.get_or_insert(tick);
        let second = self.second_of(tick.wrapping_sub(first) as f64);
        self.seconds.push(second);
    }

    /// Ticks since the first one in seconds. A counter that starts again only ever goes on: a fall by more than half its
    /// range is a turn.
    fn second_of(&mut self, mut ticks: f64) -> f64 {
        if let Some(range) = self.ticks.wraps_at {
            if ticks - self.before < -0.5 * range {
                self.turns += 1.0;
            }
            self.before = ticks;
            ticks += self.turns * range;
        }
        ticks / self.ticks.per_second
    }

    /// Real ticks become seconds in their place; returns the first one.
    fn convert_reals(&mut self) -> Option<f64> {
        let mut ticks = std::mem::take(&mut self.seconds);
        let first = ticks.iter().copied().find(|tick| tick.is_finite());
        for tick in &mut ticks {
            *tick = match first {
                Some(first) if tick.is_finite() => self.second_of(*tick - first),
                _ => f64::NAN,
            };
        }
        self.seconds = ticks;
        first
    }

    pub(crate) fn stamps(mut self) -> Timestamps {
        let per_second = self.ticks.per_second;
        let whole = |first: i64| (first as f64 / per_second, i128::from(first) * (1e9 / per_second) as i128);
        let real = |first: f64| (first / per_second, (first / per_second * 1e9) as i128);
        let first =
            if self.ticks.is_whole { self.first_whole.map(whole) } else { self.convert_reals().map(real) };
        let first_s = first.map_or(0.0, |(first_s, _)| first_s);
        let zero_ns = 1_000_000_000 * i128::from(self.ticks.zero_s);
        let instant = || Timestamp::from_nanosecond(first?.1 + zero_ns).ok();
        let origin = match self.ticks.origin {
            TickEpoch::Utc => instant().map(TimeOrigin::Utc),
            TickEpoch::Local => instant().map(TimeOrigin::Local),
            TickEpoch::Midnight => Some(TimeOrigin::OfDay(first_s)),
            TickEpoch::Own => None,
        };
        let origin = origin.unwrap_or(TimeOrigin::Counted(first_s));
        Timestamps { column: self.column.to_owned(), seconds: self.seconds, origin }
    }
}
