//! What is asked of the records, and by what a record is known.

use arrow::array::{BooleanArray, RecordBatch, StringArray, TimestampMicrosecondArray};
use arrow::compute::kernels::cmp::{eq, gt_eq, lt};
use arrow::error::ArrowError;
use jiff::Timestamp;
use polars::prelude::{Expr, Scalar, TimeUnit, TimeZone, col, lit};
use records::GapRecord;

use crate::stats::Stats;

/// By what a record is known: one actuator's flight has one record.
///
/// Its order is the order in which records are shown and exported.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct RecordKey {
    /// Departure, µs since 1970 UTC.
    pub departure_us: i64,
    /// The aircraft.
    pub tail_number: String,
    /// The flight.
    pub flight_id: String,
    /// The place on the aircraft.
    pub position: String,
}

impl RecordKey {
    /// The columns that hold it, in the order of its fields.
    pub(crate) const COLUMNS: [&'static str; 4] = ["departure_utc", "tail_number", "flight_id", "position"];

    /// The key of a record.
    pub fn of(record: &GapRecord) -> Self {
        Self {
            departure_us: record.flight.departure_utc.as_microsecond(),
            tail_number: record.flight.tail_number.to_string(),
            flight_id: record.flight.flight_id.to_string(),
            position: record.position.to_string(),
        }
    }
}

/// Which records are asked for; what is `None` is not asked.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Query {
    /// One aircraft.
    pub tail_number: Option<String>,
    /// One unit, wherever it flew; unique only with its part number.
    pub serial_number: Option<String>,
    /// One design.
    pub part_number: Option<String>,
    /// One flight.
    pub flight_id: Option<String>,
    /// One place.
    pub position: Option<String>,
    /// One run.
    pub run_id: Option<String>,
    /// Departures from then on.
    pub since_utc: Option<Timestamp>,
    /// Departures before then.
    pub until_utc: Option<Timestamp>,
    /// So many at most, the latest.
    pub last: Option<usize>,
}

impl Query {
    fn texts(&self) -> impl Iterator<Item = (&'static str, &str)> {
        [
            ("tail_number", &self.tail_number),
            ("serial_number", &self.serial_number),
            ("part_number", &self.part_number),
            ("flight_id", &self.flight_id),
            ("position", &self.position),
            ("run_id", &self.run_id),
        ]
        .into_iter()
        .filter_map(|(column, value)| Some((column, value.as_deref()?)))
    }

    /// Whether a file may hold an answer.
    pub(crate) fn may_be_in(&self, stats: &Stats) -> bool {
        let (earliest_us, latest_us) = stats.times_us("departure_utc");
        self.texts().all(|(column, value)| stats.may_hold(column, value))
            && self.since_utc.is_none_or(|since| since.as_microsecond() <= latest_us)
            && self.until_utc.is_none_or(|until| earliest_us < until_us(until))
    }

    /// The same as a condition on rows.
    pub(crate) fn condition(&self) -> Option<Expr> {
        let departure = || col("departure_utc");
        let texts = self.texts().map(|(column, value)| col(column).eq(lit(value.to_owned())));
        // A departure is cut to whole microseconds in the table, so a bound between two of them rounds up.
        let since = self.since_utc.map(|since| departure().gt_eq(time(until_us(since))));
        let until = self.until_utc.map(|until| departure().lt(time(until_us(until))));
        texts.chain(since).chain(until).reduce(Expr::and)
    }

    /// The columns by which rows are told to fit.
    pub(crate) fn columns(&self) -> impl Iterator<Item = &'static str> {
        let is_timed = self.since_utc.or(self.until_utc).is_some();
        self.texts().map(|(column, _)| column).chain(is_timed.then_some("departure_utc"))
    }

    /// The same condition on the rows of a batch of these columns, times in µs, one answer for each part of it.
    pub(crate) fn fits(&self, batch: &RecordBatch) -> impl Iterator<Item = Result<BooleanArray, ArrowError>> {
        let column = |name: &str| batch.schema_ref().index_of(name).map(|at| batch.column(at));
        let texts = self.texts().map(move |(name, value)| eq(column(name)?, &StringArray::new_scalar(value)));
        let bound = |time: Timestamp| {
            let bound = TimestampMicrosecondArray::from(vec![until_us(time)]).with_timezone("UTC");
            arrow::array::Scalar::new(bound)
        };
        let since = self.since_utc.map(|since| gt_eq(column("departure_utc")?, &bound(since)));
        let until = self.until_utc.map(|until| lt(column("departure_utc")?, &bound(until)));
        texts.chain(since).chain(until)
    }
}

/// The first whole microsecond at or after a time.
fn until_us(time: Timestamp) -> i64 {
    let whole_us = time.as_microsecond();
    let rest = time.as_nanosecond() - i128::from(whole_us) * 1_000;
    whole_us + i64::from(rest > 0)
}

fn time(micros: i64) -> Expr {
    lit(Scalar::new_datetime(micros, TimeUnit::Microseconds, Some(TimeZone::UTC)))
}
