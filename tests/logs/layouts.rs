//! Logs in shapes that are made row by row give the numbers of the plain ones. The other shapes are in
//! `tests/data/logs.md`. A log far wider than any fleet's costs time in proportion to its size.

use std::time::{Duration, Instant};

use crate::harness::{Table, TestFleet, facts, rewrite, without, write_log};

/// Every number of every record, without what names the log and the settings it was read by.
fn numbers(fleet: &TestFleet) -> Vec<String> {
    let rows = without(&fleet.exported(), &["log_digest", "config_digest"]);
    let mut lines: Vec<String> = rows.lines().map(str::to_owned).collect();
    lines.sort();
    lines
}

/// One tail of the small fleet, so that each case costs a third.
fn one_tail() -> TestFleet {
    let fleet = TestFleet::sample();
    fleet.configure("sample-data/logs/**/*.parquet", "sample-data/logs/N412FP/*.parquet");
    fleet
}

/// A table of many flights, one file a day: rows of different flights alternate, and one flight goes on in the next file.
#[test]
fn flights_in_the_rows_of_a_few_files_give_the_numbers_of_their_own_files() {
    use ingest::parquet::writer::{Column, write_parquet};
    let fleet = one_tail();
    let tables: Vec<_> = fleet.logs_of("N412FP").iter().map(|log| (Table::read(log), facts(log))).collect();
    let mut days: [Vec<(usize, usize)>; 3] = Default::default();
    let longest = tables.iter().map(|(table, _)| table.rows()).max().unwrap();
    for (row, flight) in (0..longest).flat_map(|row| (0..tables.len()).map(move |flight| (row, flight))) {
        let day = if flight == 3 && row >= 4321 { 1 } else { flight / 4 };
        if row < tables[flight].0.rows() {
            days[day].push((flight, row));
        }
    }
    for (day, rows) in days.iter().enumerate() {
        let fact =
            |flight: usize, key: &str| tables[flight].1.iter().find(|(k, _)| k == key).unwrap().1.clone();
        let text = |key: &str| Column::Text(rows.iter().map(|row| fact(row.0, key)).collect());
        let keys = ["tail_number", "flight_id", "departure_utc", "flight_hours", "tail_hours_end"];
        let mut columns: Vec<(String, Column)> = keys.map(|key| (key.to_owned(), text(key))).into();
        for name in tables[0].0.names() {
            let all: Vec<Vec<f64>> = tables.iter().map(|(table, _)| table.numbers(&name)).collect();
            let values = rows.iter().map(|&(flight, row)| all[flight][row]).collect();
            columns.push((name, Column::Real(values)));
        }
        write_parquet(&fleet.path(&format!("days/{day}.parquet")), &columns, &[]).unwrap();
    }
    fleet.configure("sample-data/logs/N412FP/*.parquet", "days/*.parquet");
    fleet.configure("metadata = {", "by_row = true\ncolumns = {");
    fleet.configure("[store]", "pieces = true\n\n[store]");
    let account = fleet.run_ok(&["run"]);
    assert!(account.contains("10 logs: 10 new or changed"), "{account}");
    let plain = one_tail();
    plain.run_ok(&["run"]);
    assert_eq!(numbers(&fleet), numbers(&plain));
    assert!(fleet.run_ok(&["run"]).contains("10 logs: 0 new or changed, 10 already processed"));
    let checked = fleet.run_ok(&["check", "days/2.parquet"]);
    assert!(
        checked.contains("2 logs checked, 0 failed") && checked.contains("2.parquet#N412FP/"),
        "{checked}"
    );
}

/// A log is delivered again with another departure, in its metadata or in its name alone. The records of a file that is gone
/// move, and are made again when it comes back; the samples of both then count once.
#[test]
fn a_log_delivered_again_with_another_departure_counts_once() {
    for is_in_name in [false, true] {
        let fleet = one_tail();
        if is_in_name {
            fleet.configure("[identity]", "[identity]\npath = '(?<departure_utc>\\d{8}T\\d{6}Z)_'");
            fleet.configure(", departure_utc = \"departure_utc\"", "");
        }
        fleet.run_ok(&["run"]);
        let estimates = || -> Vec<u64> {
            let rows = fleet.rows(&["trend", "--tail", "N412FP"]);
            rows.iter().map(|row| row["estimates"].as_u64().unwrap()).collect()
        };
        let (records, counted) = (numbers(&fleet).len(), estimates());
        let log = fleet.logs_of("N412FP").pop().unwrap();
        let again = fleet.path("sample-data/logs/N412FP/20261117T010203Z_again.parquet");
        let mut facts = facts(&log);
        let departure = facts.iter_mut().filter(|(key, _)| !is_in_name && key == "departure_utc");
        departure.for_each(|(_, at)| *at = "2026-11-17T01:02:03Z".to_owned());
        let kept = fleet.path("kept");
        if is_in_name {
            std::fs::copy(&log, &again).unwrap();
        } else {
            rewrite(&log, &again, &facts, |_| true);
        }
        std::fs::rename(&log, &kept).unwrap();
        fleet.run_ok(&["run"]);
        fleet.run_ok(&["store", "verify"]);
        assert_eq!((numbers(&fleet).len(), estimates()), (records, counted.clone()), "name {is_in_name}");
        std::fs::rename(&kept, &log).unwrap();
        fleet.run_ok(&["run"]);
        fleet.run_ok(&["store", "verify"]);
        assert!(numbers(&fleet).len() > records, "name {is_in_name}");
        assert_eq!(estimates(), counted, "name {is_in_name}");
    }
}

/// Thirty thousand columns of ten thousand positions, none of which is installed.
#[test]
fn a_log_of_ten_thousand_positions_costs_seconds() {
    let fleet = TestFleet::sample();
    let log = &fleet.logs()[0];
    let columns = (0..10_000).map(|k| (format!("p{k}_motor_deg"), vec![0.0, 1.0])).collect();
    write_log(log, columns, &facts(log));
    let begun = Instant::now();
    assert_eq!(fleet.freeplay(&["check", &log.display().to_string()]).code, Some(1));
    assert!(begun.elapsed() < Duration::from_secs(20), "{:?}", begun.elapsed());
}
