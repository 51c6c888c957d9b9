//! The flights table: an operator's own data about flights, with and without logs.

use std::collections::HashMap;
use std::path::Path;

use jiff::{SignedDuration, Timestamp, civil, tz::TimeZone};
use records::{Flight, FlightId, TailNumber};

use crate::error::Error;
use crate::log::identity::{IdentityFields, date_alone, instant};
use crate::mapping::{IdentityField, IdentityMapping};
use crate::tables::cell::{self, name, not_negative};
use crate::tables::column_batches::{ColumnAliases, TableBatch};

/// A flight may seem to last longer than until the next departure by this factor and by these hours: clocks and rounding.
const OVERLAP_SHARE: f64 = 1.25;
const OVERLAP_HOURS: f64 = 1.0;

/// A departure in the table and one in a log are those of one flight of the same id when they differ by at most this:
/// airlines use an id again every day. From noon, it is the day of a departure that is a date alone.
const SAME_FLIGHT: SignedDuration = SignedDuration::from_hours(12);

/// Flights, found by the path of their log, or by the identity in the log.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Flights {
    rows: Vec<Row>,
    digest: String,
    by_path: HashMap<String, usize>,
    /// The rows of each aircraft, in order of departure.
    by_tail: HashMap<String, Vec<usize>>,
}

#[derive(Debug, Clone, PartialEq)]
struct Row {
    /// Departs at noon where the table has a date alone.
    flight: Flight,
    is_date: bool,
    position: Option<String>,
}

impl Row {
    fn facts(&self) -> IdentityFields {
        let Flight { tail_number, flight_id, departure_utc, flight_hours, tail_hours_end } = &self.flight;
        let date = TimeZone::UTC.to_datetime(*departure_utc).date();
        let departure = if self.is_date { date.to_string() } else { departure_utc.to_string() };
        let known = [
            (IdentityField::TailNumber, Some(tail_number.to_string())),
            (IdentityField::FlightId, Some(flight_id.to_string())),
            (IdentityField::DepartureUtc, Some(departure)),
            (IdentityField::FlightHours, flight_hours.map(|h| h.to_string())),
            (IdentityField::TailHoursEnd, tail_hours_end.map(|h| h.to_string())),
            (IdentityField::Position, self.position.clone()),
        ];
        known.into_iter().filter_map(|(fact, text)| Some((fact, text?))).collect()
    }
}

impl Flights {
    /// Reads the table: `tail_number, flight_id, departure_utc` and optionally `flight_hours`,
    /// `tail_hours_end`, `path` (the end of the log's path is enough) and `position`.
    ///
    /// Departures are read as those of logs are; without a format and a zone they are UTC. A departure that is a date alone
    /// is joined to the log of its flight id, or to the only one of its day, and the log's clock has the time.
    ///
    /// # Errors
    /// Every cell that cannot be read, or, when all can, every row that another one contradicts: a second flight of one id
    /// on one date without a time, and flight hours beyond the next departure.
    pub fn read(file: &Path, names: &ColumnAliases, identity: &IdentityMapping) -> Result<Self, Vec<Error>> {
        let mut table = TableBatch::read(file).map_err(|e| vec![e])?;
        table.names = Some(names.clone());
        let needed = table.columns(["tail_number", "flight_id", "departure_utc"])?;
        let optional = ["flight_hours", "tail_hours_end", "path", "position"].map(|name| table.find(&[name]));
        let ([tail, flight, departure], [hours, tail_hours, path, position]) = (needed, optional);
        let departs = |text: &str| match date_alone(text, identity) {
            Some(date) => noon(date).map(|noon| (noon, true)),
            None => cell::utc(text).or_else(|e| instant(text, identity).map_err(|_| e)).map(|at| (at, false)),
        };
        let text = |row, column: Option<usize>| column.and_then(|column| table.text(row, column));
        let rows = table.read_rows(|row| {
            let (departure_utc, is_date) = table.required(row, departure, departs)?;
            let flight = Flight {
                tail_number: table.required(row, tail, name::<TailNumber>)?,
                flight_id: table.required(row, flight, name::<FlightId>)?,
                departure_utc,
                flight_hours: table.optional(row, hours, not_negative)?,
                tail_hours_end: table.optional(row, tail_hours, not_negative)?,
            };
            Ok(Row { flight, is_date, position: text(row, position).map(str::to_owned) })
        })?;
        let mut by_tail = HashMap::<String, Vec<usize>>::new();
        for (index, row) in rows.iter().enumerate() {
            by_tail.entry(row.flight.tail_number.to_string()).or_default().push(index);
        }
        by_tail.values_mut().for_each(|of_tail| of_tail.sort_by_key(|row| rows[*row].flight.departure_utc));
        let by_path =
            table.rows().filter_map(|row| Some((text(row, path)?.replace('\\', "/"), row))).collect();
        let mut flights = Self { rows, digest: String::new(), by_path, by_tail };
        let mut errors = flights.contradictions(departure, hours);
        if !errors.is_empty() {
            errors.sort_by_key(|(row, ..)| *row);
            let error = |(row, column, what)| table.error(row, Some(column), what);
            return Err(errors.into_iter().map(error).collect());
        }
        let mut hash = blake3::Hasher::new();
        let columns: Vec<usize> = needed.into_iter().chain(optional.into_iter().flatten()).collect();
        for row in table.rows() {
            for column in &columns {
                hash.update(table.text(row, *column).unwrap_or_default().as_bytes());
                hash.update(&[0]);
            }
        }
        flights.digest = hash.finalize().to_hex().to_string();
        Ok(flights)
    }

    /// Rows that another row of their aircraft contradicts, with the column and the reason: a second flight of one id on
    /// one date, and a flight that lasts beyond the next departure, whose hours are in another unit or of another flight.
    fn contradictions(&self, departure: usize, hours: Option<usize>) -> Vec<(usize, usize, String)> {
        let mut found = Vec::new();
        for of_tail in self.by_tail.values() {
            for (k, &row) in of_tail.iter().enumerate() {
                let Row { flight, is_date, .. } = &self.rows[row];
                let Flight { tail_number, flight_id, departure_utc, .. } = flight;
                let is_same = |other: &Flight| other.departure_utc == *departure_utc;
                let before = of_tail[..k].iter().rev().map(|&row| &self.rows[row]);
                let mut same = before.take_while(|other| is_same(&other.flight));
                if *is_date && same.any(|other| other.is_date && other.flight.flight_id == *flight_id) {
                    let date = TimeZone::UTC.to_datetime(*departure_utc).date();
                    let what = format!(
                        "a second flight {flight_id} of {tail_number} on {date}: give both departures with their time"
                    );
                    found.push((row, departure, what));
                }
                let mut after = of_tail[k..].iter().map(|&row| &self.rows[row]);
                let next = after.find(|other| other.is_date == *is_date && !is_same(&other.flight));
                let (Some(next), Some(column), Some(flown_h)) = (next, hours, flight.flight_hours) else {
                    continue;
                };
                let next = &next.flight;
                let until_next = next.departure_utc.duration_since(*departure_utc).as_secs_f64() / 3600.0;
                if flown_h > OVERLAP_SHARE * until_next + OVERLAP_HOURS {
                    let what = format!(
                        "{flown_h} flight hours, but {tail_number} departs again {until_next:.1} h later ({}): give hours, \
                         not minutes, and check the two departures",
                        next.flight_id
                    );
                    found.push((row, column, what));
                }
            }
        }
        found
    }

    /// Every flight of the table.
    pub fn iter(&self) -> impl Iterator<Item = &Flight> {
        self.rows.iter().map(|row| &row.flight)
    }

    /// The flights of an aircraft, in order of departure.
    pub fn of_tail(&self, tail_number: &str) -> impl Iterator<Item = &Flight> {
        self.by_tail.get(tail_number).into_iter().flatten().map(|row| &self.rows[*row].flight)
    }

    /// blake3 of all cells that are read; empty without a table.
    pub fn digest(&self) -> &str {
        &self.digest
    }

    /// Whether the table has no flight.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// The table's row of a flight: the one with its departure, else the one with its id that departs nearest to it,
    /// within 12 hours or on its date.
    pub fn of(&self, tail_number: &str, flight_id: &str, departure_utc: Timestamp) -> Option<&Flight> {
        self.row_of(tail_number, Some(flight_id), departure_utc).map(|row| &self.rows[row].flight)
    }

    fn row_of(&self, tail_number: &str, flight_id: Option<&str>, departure_utc: Timestamp) -> Option<usize> {
        let of_tail = self.by_tail.get(tail_number)?;
        let since = |row: &usize| self.rows[*row].flight.departure_utc.duration_since(departure_utc);
        let first = of_tail.partition_point(|row| since(row) < -SAME_FLIGHT);
        let near = of_tail[first..].iter().copied().take_while(|row| since(row) <= SAME_FLIGHT);
        let exact = near.clone().filter(|row| !self.rows[*row].is_date && since(row).is_zero()).last();
        exact.or_else(|| match flight_id {
            Some(id) => near.filter(|row| self.is_called(*row, id)).min_by_key(|row| since(row).abs()),
            None => {
                let noon = noon(TimeZone::UTC.to_datetime(departure_utc).date()).ok()?;
                let is_of_day = |Row { flight, is_date, .. }: &Row| *is_date && flight.departure_utc == noon;
                only(near.filter(|row| is_of_day(&self.rows[*row])))
            }
        })
    }

    fn is_called(&self, row: usize, flight_id: &str) -> bool {
        self.rows[row].flight.flight_id.as_str() == flight_id
    }

    /// The fields that the table has for a log: found by its path, else by its tail and departure, else by its tail and
    /// flight id. An id of several rows needs the departure, which may be that of the log's clock.
    pub fn facts(&self, path: &Path, said: &IdentityFields, departure: Option<Timestamp>) -> IdentityFields {
        let text = |fact: IdentityField| said.get(&fact).map(|t| t.trim());
        let by_identity = || {
            let (tail, id) = (text(IdentityField::TailNumber)?, text(IdentityField::FlightId));
            if let Some(at) = departure {
                return self.row_of(tail, id, at);
            }
            let (of_tail, id) = (self.by_tail.get(tail)?, id?);
            only(of_tail.iter().copied().filter(|row| self.is_called(*row, id)))
        };
        let found = self.of_path(path).or_else(by_identity);
        found.map(|row| self.rows[row].facts()).unwrap_or_default()
    }

    /// The row whose path the log's own path ends in, folder by folder.
    fn of_path(&self, path: &Path) -> Option<usize> {
        let text = crate::log::identity::absolute(path).to_string_lossy().replace('\\', "/");
        let mut rest = text.as_str();
        loop {
            if let Some(&row) = self.by_path.get(rest) {
                return Some(row);
            }
            rest = rest.split_once('/')?.1;
        }
    }
}

/// The row, where there is but one.
fn only(mut rows: impl Iterator<Item = usize>) -> Option<usize> {
    rows.next().filter(|_| rows.next().is_none())
}

/// Noon of a date, UTC.
fn noon(date: civil::Date) -> Result<Timestamp, String> {
    TimeZone::UTC.to_timestamp(date.at(12, 0, 0, 0)).map_err(|e| e.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The flights of a table with these rows.
    fn read(rows: &str) -> Result<Flights, Vec<Error>> {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), format!("tail_number,flight_id,departure_utc,flight_hours\n{rows}"))
            .unwrap();
        Flights::read(file.path(), &ColumnAliases::new(), &IdentityMapping::default())
    }

    /// The hours of the row that is found for a log of this id and departure.
    fn hours(flights: &Flights, id: Option<&str>, departure: Option<&str>) -> Option<String> {
        let id = id.map(|id| (IdentityField::FlightId, id.to_owned()));
        let said = [(IdentityField::TailNumber, "N1".to_owned())].into_iter().chain(id).collect();
        let departure = departure.map(|text| text.parse().unwrap());
        flights.facts(Path::new("/x"), &said, departure).remove(&IdentityField::FlightHours)
    }

    /// A flight number that flies every day: only the departure tells which row is meant.
    #[test]
    fn an_id_that_recurs_is_found_by_departure() {
        let row = |day: u32| format!("N1,FP100,2026-03-{day:02}T06:10:00Z,{day}.5\n");
        let rows: String = (1..=9).map(row).collect();
        let flights = read(&rows).unwrap();
        for (departure, wanted) in [
            (None, None),
            (Some("2026-03-04T06:25:00Z"), Some("4.5")),
            (Some("2026-03-07T06:10:00Z"), Some("7.5")),
            (Some("2026-03-20T06:10:00Z"), None),
        ] {
            assert_eq!(hours(&flights, Some("FP100"), departure).as_deref(), wanted);
            let of = departure.and_then(|at| flights.of("N1", "FP100", at.parse().unwrap()));
            assert_eq!(of.and_then(|flight| flight.flight_hours).map(|h| h.to_string()).as_deref(), wanted);
        }
    }

    /// Two legs of one day and one of the next, each with its date alone: the log's clock has the time.
    #[test]
    fn a_date_alone_is_joined_to_the_log_of_its_id_or_to_the_only_one_of_its_day() {
        let flights = read("N1,A,2026-03-04,2\nN1,B,2026-03-04,3\nN1,C,2026-03-05,4\n").unwrap();
        for (id, departure, wanted) in [
            (Some("A"), "2026-03-04T23:10:00Z", Some("2")),
            (Some("B"), "2026-03-04T00:10:00Z", Some("3")),
            (None, "2026-03-05T00:10:00Z", Some("4")),
            // Two flights depart on this day, and flight A on another one.
            (None, "2026-03-04T12:00:00Z", None),
            (Some("A"), "2026-03-05T12:10:00Z", None),
        ] {
            assert_eq!(hours(&flights, id, Some(departure)).as_deref(), wanted);
        }
        let error = read("N1,A,2026-03-04,2\nN1,A,2026-03-04,3\n").unwrap_err()[0].diagnostic().to_string();
        assert!(error.contains("row 2") && error.contains("give both departures with their time"), "{error}");
    }
}
