//! Wrong settings and tables that gave a wrong number or lost one without a word: each is found, and named.

use crate::harness::{TestFleet, facts, facts_with, rewrite};

/// Columns depend on the part, so a position whose unit is not booked may lack its columns: it is an error all the same.
#[test]
fn a_position_between_two_stays_is_an_error_even_if_its_columns_depend_on_the_part() {
    let fleet = TestFleet::sample_data();
    fleet.edit("sample-data/installations.csv", |table| {
        let kept = table.lines().filter(|row| !(row.starts_with("N412FP") && row.contains("1060-0012")));
        kept.collect::<Vec<_>>().join("\n")
    });
    let run = fleet.freeplay(&["run", "--tail", "N412FP"]);
    assert_eq!(run.code, Some(1), "{run:?}");
    assert!(run.err.contains("no unit is booked in elevator_right of N412FP"), "{}", run.err);
    assert!(!run.err.contains("nearest"), "the table has this tail: {}", run.err);
}

/// The samples of another aircraft's log under a log's own name: no range shows it, but two estimates are one.
#[test]
fn the_samples_of_another_aircraft_are_named_with_both_flights() {
    let fleet = TestFleet::sample();
    let logs = fleet.logs();
    let of = |tail: &str| logs.iter().find(|log| log.to_string_lossy().contains(tail)).unwrap();
    let (own, other) = (of("N412FP"), of("N413FP"));
    rewrite(other, own, &facts(own), |_| true, |_| true);
    let run = fleet.run_ok(&["run"]);
    let line = run.lines().find(|line| line.contains("  repeated ")).unwrap();
    for name in ["N412FP-0001 of N412FP", "N413FP-0001 of N413FP", "aileron_left, aileron_right", "correct"] {
        assert!(line.contains(name), "{line}");
    }
    assert_eq!(run.matches("  repeated ").count(), 1, "{run}");
}

/// Minutes in the metadata of a log; and a log that is gone.
#[test]
fn flight_hours_in_minutes_are_refused_in_a_log_too() {
    let fleet = TestFleet::sample();
    let log = &fleet.logs()[0];
    let own = facts_with(log, "flight_hours", "110.4");
    rewrite(log, &log.with_file_name("minutes.parquet"), &own, |_| true, |_| true);
    let run = fleet.freeplay(&["run"]);
    assert_eq!(run.code, Some(1), "{run:?}");
    assert!(
        run.err.contains("identity_invalid") && run.err.contains("give hours, not minutes"),
        "{}",
        run.err
    );
    std::fs::remove_file(log.with_file_name("minutes.parquet")).unwrap();
    std::fs::remove_file(&fleet.logs()[1]).unwrap();
    let run = fleet.run_ok(&["run"]);
    assert!(run.contains("absent      1 log of earlier runs that no pattern matches any more"), "{run}");
}
