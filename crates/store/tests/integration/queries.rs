//! Queries: the right rows, from the right files.

use arrow::array::{Array, AsArray};
use arrow::datatypes::{Float64Type, Int32Type, TimestampMicrosecondType};
use jiff::SignedDuration;
use proptest::prelude::*;
use records::GapRecord;
use store::{Query, Store};

use crate::fixtures::{POSITIONS, departure, filled, fresh, result};

/// The same question asked of rows one by one.
fn fits(query: &Query, record: &GapRecord) -> bool {
    let same = |asked: &Option<String>, found: &str| asked.as_ref().is_none_or(|asked| asked == found);
    let at = record.flight.departure_utc;
    same(&query.tail_number, record.flight.tail_number.as_str())
        && same(&query.serial_number, record.serial_number.as_str())
        && same(&query.part_number, record.part_number.as_str())
        && same(&query.flight_id, record.flight.flight_id.as_str())
        && same(&query.position, record.position.as_str())
        && query.since_utc.is_none_or(|since| since <= at)
        && query.until_utc.is_none_or(|until| at < until)
}

fn questions() -> impl Strategy<Value = Query> {
    let text = |values: Vec<&'static str>| {
        let values: Vec<String> = values.into_iter().map(str::to_owned).collect();
        prop::option::of(prop::sample::select(values))
    };
    let near = || prop::option::of((-1_i64..5, -1_i64..2));
    let when = |(flight, ns): (i64, i64)| departure(flight) + SignedDuration::from_nanos(ns);
    (
        text(vec!["N0", "N1", "N9", ""]),
        text(vec!["S-1-elevator", "S-2-aileron_left", "none"]),
        text(vec!["EMA-27"]),
        text(vec!["F0001", "F0003"]),
        text(POSITIONS.to_vec()),
        near(),
        near(),
        prop::option::of(0_usize..40),
    )
        .prop_map(move |(tail, serial, part, flight, position, since, until, last)| Query {
            tail_number: tail,
            serial_number: serial,
            part_number: part,
            flight_id: flight,
            position,
            run_id: None,
            since_utc: since.map(when),
            until_utc: until.map(when),
            last,
        })
}

/// Departure, serial number and gap of the rows of all parts, in order.
fn parted(store: &Store, query: &Query) -> Vec<(i64, String, Option<u64>)> {
    let parts = store.scan_columns(query, &["gap_m", "serial_number", "departure_utc"]).unwrap();
    let mut rows = Vec::new();
    for batch in (0..parts.file_count()).flat_map(|part| parts.read(part).unwrap()) {
        let gaps_m = batch.column(0).as_primitive::<Float64Type>();
        let coded = batch.column(1).as_dictionary::<Int32Type>();
        let serials = coded.values().as_string::<i32>();
        let departures = batch.column(2).as_primitive::<TimestampMicrosecondType>();
        rows.extend((0..batch.num_rows()).map(|row| {
            let serial = serials.value(coded.key(row).unwrap()).to_owned();
            (departures.value(row), serial, gaps_m.is_valid(row).then(|| gaps_m.value(row).to_bits()))
        }));
    }
    rows.sort();
    rows
}

/// Whether files hold the rows of a run, or of a unit.
#[test]
fn a_query_and_the_parts_of_a_scan_answer_what_asking_every_row_would() {
    let (dir, mut writer) = filled(3, 4);
    let all = writer.store().records(&Query::default()).unwrap();
    assert_eq!(all.len(), 36);
    let check = |store: &Store| {
        let config = ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(40) };
        proptest!(config, |(query in questions())| {
            let fitting: Vec<GapRecord> = all.iter().filter(|record| fits(&query, record)).cloned().collect();
            let row = |r: &GapRecord| {
                let at = r.flight.departure_utc.as_microsecond();
                (at, r.serial_number.to_string(), r.estimate.gap_m.map(f64::to_bits))
            };
            let mut rows: Vec<_> = fitting.iter().map(row).collect();
            rows.sort();
            prop_assert_eq!(parted(store, &query), rows);
            let first = fitting.len() - query.last.unwrap_or(usize::MAX).min(fitting.len());
            prop_assert_eq!(store.records(&query).unwrap(), &fitting[first..]);
        });
    };
    check(writer.store());
    writer.compact().unwrap();
    let store = Store::open(dir.path()).unwrap();
    assert_eq!(store.scan_columns(&Query::default(), &["gap_m"]).unwrap().file_count(), 1);
    assert!(store.scan_columns(&Query::default(), &["gap_mm"]).is_err(), "a column that no file has");
    check(&store);
}

/// A unit moves between tails, and its number is not ordered by tail: bounds exclude no file. A day is in one file.
#[test]
fn only_files_that_hold_the_unit_or_the_day_are_opened_also_after_a_checkpoint() {
    let (dir, mut writer) = fresh();
    for tail in 0..25 {
        let mut result = result(tail, tail as i64, 30e-6);
        for (position, record) in result.records.iter_mut().enumerate() {
            let number = (tail * 7 + position * 40) % 100;
            record.serial_number = records::SerialNumber::new(format!("{number:02}")).unwrap();
        }
        writer.commit(&[result]).unwrap();
    }
    assert!(dir.path().join("gaps/_delta_log/_last_checkpoint").exists());
    let wanted = Query { serial_number: Some("21".into()), ..Query::default() };
    let found = writer.store().records(&wanted).unwrap();
    assert!(!found.is_empty());
    let tails: Vec<&str> = found.iter().map(|r| r.flight.tail_number.as_str()).collect();
    // Without every other file the answer is the same: they are not opened.
    for file in writer.store().table_files("gaps").unwrap() {
        let version: usize = file.file_name().unwrap().to_str().unwrap()[..12].parse().unwrap();
        if version > 0 && !tails.contains(&format!("N{}", version - 1).as_str()) {
            std::fs::remove_file(file).unwrap();
        }
    }
    let store = Store::open(dir.path()).unwrap();
    assert_eq!(store.records(&wanted).unwrap(), found);
    let at = found[0].flight.departure_utc;
    let until_utc = Some(at + SignedDuration::from_hours(1));
    let day = Query { since_utc: Some(at), until_utc, ..Query::default() };
    assert_eq!(store.records(&day).unwrap().len(), POSITIONS.len());
    assert!(store.records(&Query::default()).is_err());
}
