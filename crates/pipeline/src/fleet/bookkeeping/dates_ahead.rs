//! Dates of the operator's tables that are still to come.

use jiff::Timestamp;
use jiff::tz::TimeZone;
use records::time::days_between;
use records::{Installation, Installations};
use serde::Serialize;

/// A date of the installations, maintenance or inspections table that is still to come.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[expect(missing_docs, reason = "each field is named for the contract's column")]
pub struct DateAhead {
    pub part_number: Option<String>,
    pub serial_number: String,
    /// `installed_utc`, `removed_utc`, or the date of a maintenance or an inspection.
    pub column: &'static str,
    pub date: Timestamp,
    /// The same date with day and month exchanged, if that is past.
    pub exchanged: Option<Timestamp>,
}

impl DateAhead {
    pub(crate) fn new(
        part_number: Option<String>,
        serial_number: String,
        column: &'static str,
        date: Timestamp,
    ) -> Self {
        Self { part_number, serial_number, column, date, exchanged: exchanged(date) }
    }
}

/// Part, serial number, column and date, and what may be wrong with it.
impl std::fmt::Display for DateAhead {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { part_number, serial_number, column, date, exchanged } = self;
        let day = |at: &Timestamp| at.strftime("%Y-%m-%d");
        let part_number = part_number.as_deref().unwrap_or("any part");
        write!(f, "{part_number} / {serial_number}: `{column}` is {}, a date to come", day(date))?;
        match exchanged {
            Some(past) => write!(f, "; day and month may be exchanged ({})", day(past)),
            None => Ok(()),
        }
    }
}

/// The dates of the installations table, and of the `others`, that are more than a day ahead of `now`.
pub fn dates_ahead(
    installations: &Installations,
    others: impl IntoIterator<Item = DateAhead>,
    now: Timestamp,
) -> Vec<DateAhead> {
    let dates = |i: &Installation| {
        let columns = [("installed_utc", Some(i.installed_utc)), ("removed_utc", i.removed_utc)];
        let (part, serial) = (Some(i.part_number.to_string()), i.serial_number.to_string());
        columns.map(|(column, date)| Some(DateAhead::new(part.clone(), serial.clone(), column, date?)))
    };
    let all = installations.iter().flat_map(dates).flatten().chain(others);
    let ahead = all.filter(|row| days_between(now, row.date) > 1.0);
    ahead.map(|row| DateAhead { exchanged: row.exchanged.filter(|other| *other <= now), ..row }).collect()
}

/// A date with day and month exchanged, if there is one.
fn exchanged(at: Timestamp) -> Option<Timestamp> {
    let there = at.to_zoned(TimeZone::UTC).datetime();
    let (month, day) = (there.month(), there.day());
    if month == day {
        return None;
    }
    there.with().month(day).day(month).build().ok()?.to_zoned(TimeZone::UTC).ok().map(|z| z.timestamp())
}
