//! Timestamps of a time column: integers, reals, Arrow timestamps or text, to seconds since the first one.

use arrow::array::{ArrayRef, AsArray};
use arrow::compute::cast;
use arrow::datatypes::{DataType, Int64Type, TimeUnit as ArrowTimeUnit};
use jiff::{Timestamp, civil};

use crate::error::{Fault, time_text_unknown, time_unit_unknown};
use crate::mapping::units::TimeUnit;
use crate::mapping::{ClockMapping, Epoch};
use crate::parquet::numeric::{append, as_text, wrong_type};
use crate::time::clock::{DAY_S, TimeOrigin, Timestamps};

/// Zero of spreadsheet dates, 1899-12-30T00:00:00.
pub(crate) const EXCEL_ZERO: Timestamp = Timestamp::constant(-25_569 * 86_400, 0);

/// What the numbers of a time column are.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TickFormat {
    pub(crate) per_second: f64,
    /// Whether they have no fraction; texts are read as whole nanoseconds.
    pub(crate) is_whole: bool,
    pub(crate) is_text: bool,
    pub(crate) zero: TimeOrigin,
    pub(crate) wraps_at: Option<f64>,
}

impl TickFormat {
    /// What the numbers of a column of this type are: by the type, by the unit of a `duration`, or else by the mapped clock.
    /// A column that is read as text holds ISO 8601; an offset in it is taken, and without one the time is local. An error is
    /// what was found, where neither the type nor the mapping has a unit.
    pub(crate) fn of(
        kind: &DataType,
        is_text: bool,
        duration: Option<ArrowTimeUnit>,
        clock: &ClockMapping,
    ) -> Result<Self, String> {
        let unit = match kind {
            DataType::Timestamp(unit, _) | DataType::Time32(unit) | DataType::Time64(unit) => Some(*unit),
            _ if is_text => Some(ArrowTimeUnit::Nanosecond),
            _ => duration,
        };
        let zero = match (kind, clock.epoch) {
            (DataType::Timestamp(_, Some(_)), _) => TimeOrigin::Utc(Timestamp::UNIX_EPOCH),
            (DataType::Timestamp(..), _) => TimeOrigin::Local(Timestamp::UNIX_EPOCH),
            (DataType::Time32(_) | DataType::Time64(_), _) => TimeOrigin::OfDay(0.0),
            _ if is_text => TimeOrigin::Local(Timestamp::UNIX_EPOCH),
            (_, Epoch::None) => TimeOrigin::Counted(0.0),
            _ if unit.is_some() => TimeOrigin::Counted(0.0),
            (_, Epoch::Unix) => TimeOrigin::Utc(Timestamp::UNIX_EPOCH),
            (_, Epoch::Midnight) => TimeOrigin::OfDay(0.0),
            (_, Epoch::Excel) => TimeOrigin::Local(EXCEL_ZERO),
        };
        let per_second = match (unit, clock.unit) {
            (Some(ArrowTimeUnit::Second), _) => 1.0,
            (Some(ArrowTimeUnit::Millisecond), _) => 1e3,
            (Some(ArrowTimeUnit::Microsecond), _) => 1e6,
            (Some(ArrowTimeUnit::Nanosecond), _) => 1e9,
            (None, Some(TimeUnit::Count)) => clock.rate_hz.ok_or("a counter, and no `clock.rate_hz`")?,
            (None, Some(unit)) => unit.per_second().unwrap_or(1.0),
            (None, None) => return Err(kind.to_string()),
        };
        // With `clock.epoch` = "midnight", a text may be a time of the day alone.
        let is_of_day = matches!(zero, TimeOrigin::OfDay(_)) || (is_text && clock.epoch == Epoch::Midnight);
        let day = is_of_day.then_some(DAY_S * per_second);
        let wraps_at = if unit.is_none() { clock.wraps_at.or(day) } else { day };
        let is_whole = unit.is_some() || kind.is_integer();
        Ok(Self { per_second, is_whole, is_text, zero, wraps_at })
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

    pub(crate) fn append(&mut self, array: &ArrayRef) -> Result<(), Fault> {
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

    fn parsed(&mut self, value: &str, row: usize) -> Result<i64, Fault> {
        let value = value.trim();
        let zoned = value.parse::<Timestamp>().ok();
        if let (Some(_), TimeOrigin::Local(zero)) = (zoned, self.ticks.zero) {
            self.ticks.zero = TimeOrigin::Utc(zero);
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
            self.ticks.zero = TimeOrigin::OfDay(0.0);
            tick = i64::try_from(time.duration_since(civil::Time::midnight()).as_nanos()).ok();
        }
        tick.ok_or_else(|| {
            let error = if value.parse::<f64>().is_ok() { time_unit_unknown } else { time_text_unknown };
            error(self.column, &format!("`{value}` in row {row}"))
        })
    }

    fn push_whole(&mut self, tick: Option<i64>) {
        let Some(tick) = tick else { return self.seconds.push(f64::NAN) };
        let first = *self.first_whole.get_or_insert(tick);
        let second = self.second_of(tick.wrapping_sub(first) as f64);
        self.seconds.push(second);
    }

    /// Ticks since the first one, in seconds. A counter never runs backwards: a fall by more than half of its range is a
    /// wrap.
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
        let instant = |zero: Timestamp| Timestamp::from_nanosecond(first?.1 + zero.as_nanosecond()).ok();
        let origin = match self.ticks.zero {
            TimeOrigin::Utc(zero) => instant(zero).map(TimeOrigin::Utc),
            TimeOrigin::Local(zero) => instant(zero).map(TimeOrigin::Local),
            TimeOrigin::OfDay(_) => Some(TimeOrigin::OfDay(first_s)),
            TimeOrigin::Counted(_) | TimeOrigin::Start => None,
        };
        let origin = origin.unwrap_or(TimeOrigin::Counted(first_s));
        Timestamps { column: self.column.to_owned(), seconds: self.seconds, origin }
    }
}
