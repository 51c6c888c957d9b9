//! Query: selection of gap records.

use arrow::array::{BooleanArray, RecordBatch, StringArray, TimestampMicrosecondArray};
use arrow::compute::kernels::cmp::{eq, gt_eq, lt};
use arrow::error::ArrowError;
use jiff::Timestamp;
use polars::prelude::{Expr, Scalar, TimeUnit, TimeZone, col, lit};

use crate::delta::file_stats::Stats;

/// Selection of records; a field that is `None` does not restrict it.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Query {
    /// Aircraft.
    pub tail_number: Option<String>,
    /// Unit, on any tail; unique only together with its part number.
    pub serial_number: Option<String>,
    /// Part number.
    pub part_number: Option<String>,
    /// Flight.
    pub flight_id: Option<String>,
    /// One location.
    pub position: Option<String>,
    /// Run.
    pub run_id: Option<String>,
    /// Departures at or after this time.
    pub since_utc: Option<Timestamp>,
    /// Departures before this time.
    pub until_utc: Option<Timestamp>,
    /// At most this many records, the latest.
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

    /// Whether a file may hold matching records, by its statistics.
    pub(crate) fn may_be_in(&self, stats: &Stats) -> bool {
        let (earliest_us, latest_us) = stats.times_us("departure_utc");
        self.texts().all(|(column, value)| stats.may_hold(column, value))
            && self.since_utc.is_none_or(|since| since.as_microsecond() <= latest_us)
            && self.until_utc.is_none_or(|until| earliest_us < until_us(until))
    }

    /// The selection as a Polars filter.
    pub(crate) fn condition(&self) -> Option<Expr> {
        let departure = || col("departure_utc");
        let texts = self.texts().map(|(column, value)| col(column).eq(lit(value.to_owned())));
        // A departure is cut to whole microseconds in the table, so a bound between two of them rounds up.
        let since = self.since_utc.map(|since| departure().gt_eq(time(until_us(since))));
        let until = self.until_utc.map(|until| departure().lt(time(until_us(until))));
        texts.chain(since).chain(until).reduce(Expr::and)
    }

    /// Columns that the selection reads.
    pub(crate) fn columns(&self) -> impl Iterator<Item = &'static str> {
        let is_timed = self.since_utc.or(self.until_utc).is_some();
        self.texts().map(|(column, _)| column).chain(is_timed.then_some("departure_utc"))
    }

    /// Masks of the matching rows of a batch of these columns (times in µs), one per condition.
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
