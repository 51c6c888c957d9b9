//! Rejections of most flights of an actuator, a tail or a part number: a wrong mapping, not a matter of the flights.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use arrow::array::RecordBatch;
use ingest::tables::TableBatch;
use jiff::{SignedDuration, Timestamp};
use job::rejection;
use serde::Serialize;
use store::{Query, Store};

use crate::error::Error;
use crate::history::parallel_scan::read_each;
use crate::history::row_keys::{KeyCache, KeyColumns, TextColumn};
use crate::monitoring::recent::PositionKey;

/// Reach of the search before the newest flight.
const WINDOW: SignedDuration = SignedDuration::from_hours(24 * 120);

/// Latest flights of an actuator that count.
const LATEST: usize = 5;

/// Fewest flights of a scope that show a fault.
const MIN_FLIGHTS: usize = 3;

/// The latest flights of an actuator by departure, each with its rejection code.
pub(crate) type LatestRejections = BTreeMap<PositionKey, Vec<(Timestamp, Option<String>)>>;

/// A wrong mapping, sign, unit or rate, by its effect: most of the latest flights of a scope are rejected for it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct MappingFault {
    /// The part number, if all its actuators are affected.
    pub part_number: Option<String>,
    /// The aircraft, if one only is affected.
    pub tail_number: Option<String>,
    /// The position, if one only is affected.
    pub position: Option<String>,
    /// Rejection code.
    pub reason: String,
    /// Rejected flights among the latest ones, and all of these, over the actuators of the scope.
    pub refused: usize,
    /// Latest flights of the scope.
    pub flights: usize,
    /// What to change in the configuration.
    pub remedy: &'static str,
    /// Whether this run has processed flights of the scope.
    pub is_of_run: bool,
}

impl MappingFault {
    /// The affected scope as text.
    pub fn scope(&self) -> String {
        match (&self.part_number, &self.tail_number, &self.position) {
            (Some(part), _, _) => format!("all actuators of part {part}"),
            (_, Some(tail), Some(position)) => format!("{position} of {tail}"),
            (_, Some(tail), None) => format!("all actuators of {tail}"),
            _ => "all actuators".to_owned(),
        }
    }
}

/// Reads the latest flights of each actuator.
///
/// # Errors
/// When the store cannot be read.
pub(crate) fn latest_rejections(store: &Store, until: Timestamp) -> Result<LatestRejections, Error> {
    const COLUMNS: [&str; 7] =
        ["tail_number", "position", "part_number", "serial_number", "departure_utc", "status", "reason"];
    let since_utc = until.checked_sub(WINDOW).ok();
    let until_utc = until.checked_add(SignedDuration::from_micros(1)).ok();
    let query = Query { since_utc, until_utc, ..Query::default() };
    let mut found = LatestRejections::new();
    read_each(&store.scan_columns(&query, &COLUMNS)?, |batch| add(&mut found, batch))?;
    for flights in found.values_mut() {
        flights.sort();
        flights.drain(..flights.len().saturating_sub(LATEST));
    }
    Ok(found)
}

fn add(found: &mut LatestRejections, batch: &RecordBatch) -> Result<(), ingest::Error> {
    let chunk = TableBatch::new(Path::new("results"), batch.clone(), 0);
    let keys = KeyColumns::of(&chunk)?;
    let (statuses, reasons) = (TextColumn::of(&chunk, &["status"])?, TextColumn::of(&chunk, &["reason"])?);
    let departures = chunk.timestamps(Some(chunk.column(&["departure_utc"])?))?;
    let (mut seen, mut known) = (KeyCache::default(), Vec::<(PositionKey, Vec<_>)>::new());
    for row in 0..chunk.len() {
        let Ok(departure_utc) = Timestamp::from_microsecond(departures.value(row)) else { continue };
        let Some(who) = keys.who(row) else { continue };
        let key = seen.get(&keys, row).unwrap_or_else(|| {
            known.push((PositionKey::of(who), Vec::new()));
            seen.put(&keys, row, known.len() - 1);
            known.len() - 1
        });
        let is_refused = statuses.get(row) == Some("refused");
        let reason = reasons.get(row).filter(|_| is_refused).map(str::to_owned);
        known[key].1.push((departure_utc, reason));
    }
    for (key, flights) in known {
        found.entry(key).or_default().extend(flights);
    }
    Ok(())
}

/// Rejections for one code, and flights, of some actuators.
#[derive(Default)]
struct Tally<'a> {
    flights: usize,
    by_reason: BTreeMap<&'a str, usize>,
    members: BTreeSet<&'a PositionKey>,
}

impl<'a> Tally<'a> {
    fn add(&mut self, key: &'a PositionKey, flights: &'a [(Timestamp, Option<String>)]) {
        self.flights += flights.len();
        self.members.insert(key);
        for reason in flights.iter().filter_map(|(_, reason)| reason.as_deref()) {
            *self.by_reason.entry(reason).or_default() += 1;
        }
    }

    /// The code of more than half of the flights.
    fn majority(&self) -> Option<(&'a str, usize)> {
        let most = self.by_reason.iter().max_by_key(|(_, count)| **count)?;
        (self.flights >= MIN_FLIGHTS && 2 * most.1 > self.flights).then_some((*most.0, *most.1))
    }
}

/// The faults of the mapping, the widest scope first: a part number, a tail, an actuator.
///
/// `touched` holds the part and serial numbers whose records this run changed.
pub(crate) fn detect(latest: &LatestRejections, touched: &BTreeSet<(String, String)>) -> Vec<MappingFault> {
    type Scope = fn(&PositionKey) -> (Option<&String>, Option<&String>, Option<&String>);
    let scopes: [Scope; 3] = [
        |key| (Some(&key.part_number), None, None),
        |key| (None, Some(&key.tail_number), None),
        |key| (None, Some(&key.tail_number), Some(&key.position)),
    ];
    let (mut found, mut explained) = (Vec::new(), BTreeSet::<&PositionKey>::new());
    for (width, scope) in scopes.into_iter().enumerate() {
        let mut tallies: BTreeMap<_, Tally<'_>> = BTreeMap::new();
        for (key, flights) in latest.iter().filter(|(key, _)| !explained.contains(key)) {
            tallies.entry(scope(key)).or_default().add(key, flights);
        }
        let is_wide = width < 2;
        for ((part, tail, position), tally) in tallies {
            let Some((reason, refused)) = tally.majority() else { continue };
            let remedy = match width {
                0 => rejection::part_remedy(reason),
                _ => rejection::remedy(reason).filter(|_| rejection::is_mapping_fault(reason)),
            };
            let Some(remedy) = remedy.filter(|_| !is_wide || tally.members.len() > 1) else { continue };
            let is_touched =
                |key: &PositionKey| touched.contains(&(key.part_number.clone(), key.serial_number.clone()));
            found.push(MappingFault {
                part_number: part.cloned(),
                tail_number: tail.cloned(),
                position: position.cloned(),
                reason: reason.to_owned(),
                refused,
                flights: tally.flights,
                remedy,
                is_of_run: tally.members.iter().any(|key| is_touched(key)),
            });
            explained.extend(tally.members);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(tail: &str, position: &str, part: &str) -> PositionKey {
        PositionKey {
            tail_number: tail.into(),
            position: position.into(),
            part_number: part.into(),
            serial_number: format!("{tail}{position}"),
        }
    }

    fn flights(reasons: [Option<&str>; 5]) -> Vec<(Timestamp, Option<String>)> {
        let flight = |(k, reason): (usize, Option<&str>)| {
            (Timestamp::UNIX_EPOCH + SignedDuration::from_hours(k as i64), reason.map(str::to_owned))
        };
        reasons.into_iter().enumerate().map(flight).collect()
    }

    const SIGN: Option<&str> = Some("load_sign_flipped");

    fn scopes(latest: &LatestRejections) -> Vec<String> {
        detect(latest, &BTreeSet::new()).iter().map(MappingFault::scope).collect()
    }

    #[test]
    fn most_flights_of_a_part_a_tail_or_an_actuator_name_the_widest_scope() {
        let bad = || flights([None, None, SIGN, SIGN, SIGN]);
        let good = || flights([SIGN, None, None, None, SIGN]);
        let part =
            [(key("A", "left", "P"), bad()), (key("B", "left", "P"), bad()), (key("B", "nose", "Q"), good())];
        assert_eq!(scopes(&part.into()), ["all actuators of part P"]);
        let tail = [
            (key("A", "left", "P"), bad()),
            (key("A", "nose", "Q"), bad()),
            (key("B", "left", "P"), good()),
            (key("B", "nose", "Q"), good()),
            (key("C", "left", "P"), good()),
            (key("C", "nose", "Q"), good()),
        ];
        assert_eq!(scopes(&tail.into()), ["all actuators of A"]);
        let one = [
            (key("A", "left", "P"), bad()),
            (key("A", "right", "P"), good()),
            (key("B", "left", "P"), good()),
        ];
        assert_eq!(scopes(&one.into()), ["left of A"]);
    }

    /// Flights that cannot show a gap are no fault; a unit of measure is at fault only where all of a part number is.
    #[test]
    fn causes_of_single_flights_are_no_fault_of_the_mapping() {
        let quiet = || flights([Some("no_load_reversal"); 5]);
        let small = || flights([Some("travel_too_small"); 5]);
        assert_eq!(
            scopes(&[(key("A", "left", "P"), quiet()), (key("B", "left", "P"), quiet())].into()),
            [""; 0]
        );
        assert_eq!(scopes(&[(key("A", "left", "P"), small())].into()), [""; 0]);
        let both = [(key("A", "left", "P"), small()), (key("B", "left", "P"), small())];
        assert_eq!(scopes(&both.into()), ["all actuators of part P"]);
    }
}
