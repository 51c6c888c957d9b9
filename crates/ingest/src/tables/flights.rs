//! The flights table: an operator's own data about flights, with and without logs.

use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use jiff::{SignedDuration, Timestamp, civil, tz::TimeZone};
use records::{Flight, FlightId, TailNumber};

use crate::error::Error;
use crate::log::identity::{IdentityFields, date_alone, instant};
use crate::mapping::{IdentityField, IdentityMapping};
use crate::tables::cell::{self, name, not_negative};
use crate::tables::table::{ColumnAliases, Table};

/// A flight may seem to last longer than until the next departure by this factor and by these hours: clocks and rounding.
const OVERLAP_SHARE: f64 = 1.25;
/// See [`OVERLAP_SHARE`].
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
    by_tail: HashMap<String, TailRows>,
}

/// The rows of one aircraft.
#[derive(Debug, Clone, Default, PartialEq)]
struct TailRows {
    /// By departure, which is noon where it is a date alone.
    by_departure: HashMap<(Timestamp, bool), Vec<usize>>,
    by_id: HashMap<String, Vec<usize>>,
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
    /// Every cell that cannot be read, and a second flight of one id on one date without a time.
    pub fn read(file: &Path, names: &ColumnAliases, identity: &IdentityMapping) -> Result<Self, Vec<Error>> {
        let table = Table::read(file).map_err(|e| vec![e])?.with_aliases(names);
        let needed = table.columns(["tail_number", "flight_id", "departure_utc"])?;
        let optional = ["flight_hours", "tail_hours_end", "path", "position"].map(|name| table.find(&[name]));
        let (mut flights, mut errors) = (Self::default(), Vec::new());
        for row in table.rows() {
            errors.extend(flights.enter(&table, row, needed, optional, identity).err());
        }
        if let (true, Some(hours)) = (errors.is_empty(), optional[0]) {
            errors = flights.overlapping(&table, hours);
        }
        if !errors.is_empty() {
            return Err(errors);
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

    /// Flights that last beyond the next departure of their aircraft: hours in another unit, or a wrong row.
    fn overlapping(&self, table: &Table, column: usize) -> Vec<Error> {
        let mut by_tail = BTreeMap::<&str, Vec<(usize, &Flight)>>::new();
        for (row, Row { flight, .. }) in self.rows.iter().enumerate() {
            by_tail.entry(flight.tail_number.as_str()).or_default().push((row, flight));
        }
        let mut errors = Vec::new();
        for flights in by_tail.values_mut() {
            flights.sort_by_key(|(_, flight)| flight.departure_utc);
            for (k, (row, flight)) in flights.iter().enumerate() {
                let is_next = |&(next, other): &(usize, &Flight)| {
                    other.departure_utc > flight.departure_utc
                        && self.rows[next].is_date == self.rows[*row].is_date
                };
                let next = flights[k..].iter().copied().find(is_next);
                let (Some((_, next)), Some(hours)) = (next, flight.flight_hours) else { continue };
                let until_next =
                    next.departure_utc.duration_since(flight.departure_utc).as_secs_f64() / 3600.0;
                if hours > OVERLAP_SHARE * until_next + OVERLAP_HOURS {
                    let what = format!(
                        "{hours} flight hours, but {} departs again {until_next:.1} h later ({}): give hours, not minutes, \
                         and check the two departures",
                        flight.tail_number, next.flight_id
                    );
                    errors.push((*row, table.error(*row, column, what)));
                }
            }
        }
        errors.sort_by_key(|(row, _)| *row);
        errors.into_iter().map(|(_, error)| error).collect()
    }

    fn enter(
        &mut self,
        table: &Table,
        row: usize,
        [tail, flight, departure]: [usize; 3],
        [hours, tail_hours, path, position]: [Option<usize>; 4],
        identity: &IdentityMapping,
    ) -> Result<(), Error> {
        let departs = |text: &str| match date_alone(text, identity) {
            Some(date) => noon(date).map(|noon| (noon, Some(date))),
            None => cell::utc(text).or_else(|e| instant(text, identity).map_err(|_| e)).map(|at| (at, None)),
        };
        let (departure_utc, date) = table.required(row, departure, departs)?;
        let flown = Flight {
            tail_number: table.required(row, tail, name::<TailNumber>)?,
            flight_id: table.required(row, flight, name::<FlightId>)?,
            departure_utc,
            flight_hours: table.optional(row, hours, not_negative)?,
            tail_hours_end: table.optional(row, tail_hours, not_negative)?,
        };
        let index = self.rows.len();
        if let Some(path) = path.and_then(|column| table.text(row, column)) {
            self.by_path.insert(path.replace('\\', "/"), index);
        }
        let of_tail = self.by_tail.entry(flown.tail_number.to_string()).or_default();
        let same_id = of_tail.by_id.entry(flown.flight_id.to_string()).or_default();
        let is_same = |&other: &usize| {
            self.rows[other].is_date && self.rows[other].flight.departure_utc == departure_utc
        };
        if let Some(date) = date.filter(|_| same_id.iter().any(is_same)) {
            let (tail, id) = (&flown.tail_number, &flown.flight_id);
            let what =
                format!("a second flight {id} of {tail} on {date}: give both departures with their time");
            return Err(table.error(row, departure, what));
        }
        of_tail.by_departure.entry((departure_utc, date.is_some())).or_default().push(index);
        same_id.push(index);
        let position = position.and_then(|column| table.text(row, column)).map(str::to_owned);
        self.rows.push(Row { flight: flown, is_date: date.is_some(), position });
        Ok(())
    }

    /// Every flight of the table.
    pub fn iter(&self) -> impl Iterator<Item = &Flight> {
        self.rows.iter().map(|row| &row.flight)
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
        if let Some(row) = of_tail.by_departure.get(&(departure_utc, false)).and_then(|rows| rows.last()) {
            return Some(*row);
        }
        let away = |row: &usize| self.rows[*row].flight.departure_utc.duration_since(departure_utc).abs();
        let Some(id) = flight_id else {
            let noon = noon(TimeZone::UTC.to_datetime(departure_utc).date()).ok()?;
            return of_tail.by_departure.get(&(noon, true)).and_then(|rows| only(rows));
        };
        let same_id = of_tail.by_id.get(id)?.iter().copied();
        same_id.filter(|row| away(row) <= SAME_FLIGHT).min_by_key(away)
    }

    /// What the table knows of a log: by its path, else by its tail and departure, else by its tail and flight id. An id that
    /// several rows have is found by the departure alone, which may be that of the log's clock.
    pub fn facts(
        &self,
        path: &Path,
        said: &IdentityFields,
        start: Option<Timestamp>,
        identity: &IdentityMapping,
    ) -> IdentityFields {
        if self.rows.is_empty() {
            return IdentityFields::new();
        }
        let text = |fact: IdentityField| said.get(&fact).map(|t| t.trim());
        let by_identity = || {
            let (tail, id) = (text(IdentityField::TailNumber)?, text(IdentityField::FlightId));
            let departure = match text(IdentityField::DepartureUtc) {
                Some(text) => Some(instant(text, identity).ok()?),
                None => start,
            };
            match departure {
                Some(at) => self.row_of(tail, id, at),
                None => only(self.by_tail.get(tail)?.by_id.get(id?)?),
            }
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

fn only(rows: &[usize]) -> Option<usize> {
    if let [row] = rows { Some(*row) } else { None }
}

/// Noon of a date, UTC.
fn noon(date: civil::Date) -> Result<Timestamp, String> {
    TimeZone::UTC.to_timestamp(date.at(12, 0, 0, 0)).map_err(|e| e.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = "tail_number,flight_id,departure_utc,flight_hours\n";

    /// The flights of a table with this text.
    fn read(text: &str, names: &ColumnAliases) -> Result<Flights, Vec<Error>> {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        Flights::read(file.path(), names, &IdentityMapping::default())
    }

    #[test]
    fn a_log_finds_its_flight_by_path_or_by_its_identity() {
        let text = "reg,leg,off,flight_hours,path\nN1,0413,2026-11-19T04:13:00Z,2.5,N1/a.parquet\nN1,0500,2026-11-20 05:00,,\n";
        let names = [("tail_number", "reg"), ("flight_id", "leg"), ("departure_utc", "off")];
        let names = names.map(|(ours, theirs)| (ours.to_owned(), theirs.to_owned())).into();
        let identity = IdentityMapping::default();
        let flights = read(text, &names).unwrap();
        let by_path = flights.facts(Path::new("/logs/N1/a.parquet"), &IdentityFields::new(), None, &identity);
        assert_eq!(
            (by_path[&IdentityField::FlightId].as_str(), by_path[&IdentityField::FlightHours].as_str()),
            ("0413", "2.5")
        );
        let said = IdentityFields::from([
            (IdentityField::TailNumber, "N1".into()),
            (IdentityField::DepartureUtc, "2026-11-20T05:00:00Z".into()),
        ]);
        let by_departure = flights.facts(Path::new("/logs/x.parquet"), &said, None, &identity);
        assert_eq!(by_departure[&IdentityField::FlightId], "0500");
        assert!(
            flights.facts(Path::new("/logs/y.parquet"), &IdentityFields::new(), None, &identity).is_empty()
        );
    }

    /// A flight number that flies every day: only the departure tells which row is meant.
    #[test]
    fn an_id_that_recurs_is_found_by_departure() {
        let row = |day: u32| format!("N1,FP100,2026-03-{day:02}T06:10:00Z,{day}.5\n");
        let rows: String = (1..=9).map(row).collect();
        let identity = IdentityMapping::default();
        let flights = read(&format!("{HEADER}{rows}"), &ColumnAliases::new()).unwrap();
        let said = IdentityFields::from([
            (IdentityField::TailNumber, "N1".into()),
            (IdentityField::FlightId, "FP100".into()),
        ]);
        let at = |text: &str| text.parse::<Timestamp>().unwrap();
        let hours = |start: Option<Timestamp>| {
            flights.facts(Path::new("/x"), &said, start, &identity).get(&IdentityField::FlightHours).cloned()
        };
        assert_eq!(hours(None), None, "nine flights have this id");
        assert_eq!(hours(Some(at("2026-03-04T06:25:00Z"))).as_deref(), Some("4.5"));
        assert_eq!(hours(Some(at("2026-03-20T06:10:00Z"))), None);
        let of = |text: &str| flights.of("N1", "FP100", at(text)).and_then(|flight| flight.flight_hours);
        assert_eq!((of("2026-03-07T06:10:00Z"), of("2026-03-07T07:00:00Z")), (Some(7.5), Some(7.5)));
    }

    /// Two legs of one day and one of the next, each with its date alone: the log's clock has the time.
    #[test]
    fn a_date_alone_is_joined_to_the_log_of_its_id_or_to_the_only_one_of_its_day() {
        let read = |rows: &str| read(&format!("{HEADER}{rows}"), &ColumnAliases::new());
        let flights = read("N1,A,2026-03-04,2\nN1,B,2026-03-04,3\nN1,C,2026-03-05,4\n").unwrap();
        let hours = |id: Option<&str>, at: &str| {
            let id = id.map(|id| (IdentityField::FlightId, id.to_owned()));
            let said = [(IdentityField::TailNumber, "N1".to_owned())].into_iter().chain(id).collect();
            let facts = flights.facts(Path::new("/x"), &said, at.parse().ok(), &IdentityMapping::default());
            facts.get(&IdentityField::FlightHours).cloned()
        };
        assert_eq!(hours(Some("A"), "2026-03-04T23:10:00Z").as_deref(), Some("2"));
        assert_eq!(hours(Some("B"), "2026-03-04T00:10:00Z").as_deref(), Some("3"));
        assert_eq!(hours(None, "2026-03-05T00:10:00Z").as_deref(), Some("4"));
        assert_eq!(hours(None, "2026-03-04T12:00:00Z"), None, "two flights depart on this day");
        assert_eq!(hours(Some("A"), "2026-03-05T12:10:00Z"), None, "another day");
        let error = read("N1,A,2026-03-04,2\nN1,A,2026-03-04,3\n").unwrap_err()[0].diagnostic().to_string();
        assert!(error.contains("row 2") && error.contains("give both departures with their time"), "{error}");
    }
}
