//! Query: selection of gap records.

use jiff::Timestamp;

use crate::read::scan::Condition;

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
    /// Conditions that every matching record meets.
    pub(crate) fn conditions(&self) -> Vec<Condition> {
        let texts = [
            ("tail_number", &self.tail_number),
            ("serial_number", &self.serial_number),
            ("part_number", &self.part_number),
            ("flight_id", &self.flight_id),
            ("position", &self.position),
            ("run_id", &self.run_id),
        ];
        let text = |(column, value): (_, &Option<String>)| {
            Some(Condition::texts(column, value.as_ref()?, value.as_ref()?))
        };
        // A departure is cut to whole microseconds in the table, so a bound between two of them rounds up.
        let (first, last) = (self.since_utc.map(until_us), self.until_utc.map(|until| until_us(until) - 1));
        let is_timed = first.or(last).is_some();
        let (first, last) = (first.unwrap_or(i64::MIN), last.unwrap_or(i64::MAX));
        texts
            .into_iter()
            .filter_map(text)
            .chain(is_timed.then(|| Condition::times("departure_utc", first, last)))
            .collect()
    }
}

/// The first whole microsecond at or after a time.
fn until_us(time: Timestamp) -> i64 {
    let whole_us = time.as_microsecond();
    let rest = time.as_nanosecond() - i128::from(whole_us) * 1_000;
    whole_us + i64::from(rest > 0)
}
