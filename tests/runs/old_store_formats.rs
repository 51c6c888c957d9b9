//! Stores as earlier releases left them.
//!
//! `tests/data/store-0.1` was written by release 0.1 before logs had the status *not reached*: one run over two logs
//! of the small fleet, one over the rest of that tail with a failed log, one `--redo` of one log, and a run on
//! another tail that was killed between the commits of its records and of its log status.

use crate::harness::{TestFleet, copy, top, without};

fn old() -> TestFleet {
    let fleet = TestFleet::sample();
    copy(&top().join("tests/data/store-0.1"), &fleet.path("results"));
    fleet
}

#[test]
fn an_older_store_is_read_as_it_is() {
    let fleet = old();
    let mark = std::fs::read(fleet.path("results/store.json")).unwrap();
    assert!(fleet.run_ok(&["store", "verify"]).ends_with("OK: all data files present and unchanged\n"));
    let info = fleet.run_ok(&["store", "info"]);
    assert!(info.contains("52 of 13 flights, 8 units, 2 tails"), "{info}");
    assert!(info.contains("3 logs processed (12 estimated, 0 refused, 0 failed), 0 not processed"), "{info}");
    assert!(fleet.run_ok(&["query", "tail", "N412FP"]).contains("\n40 records\n"));
    let runs = fleet.rows(&["store", "runs"]);
    let counts: Vec<_> = runs.iter().map(|r| (r["done"].as_i64(), r["errors"].as_i64())).collect();
    assert_eq!(counts, [(2, 0), (9, 1), (1, 0), (3, 0)].map(|(done, errors)| (Some(done), Some(errors))));
    assert_eq!(std::fs::read(fleet.path("results/store.json")).unwrap(), mark, "reading changes nothing");
}

#[test]
fn a_run_on_an_older_store_ends_where_a_new_one_does() {
    let fleet = old();
    let summary = fleet.run_ok(&["run"]);
    assert!(summary.contains("did not finish: 3 logs processed, 0 remaining"), "{summary}");
    let plain = TestFleet::processed();
    let numbers = |fleet: &TestFleet| without(&fleet.exported(), &["program_version"]);
    assert_eq!(numbers(&fleet), numbers(&plain));
    assert!(fleet.run_ok(&["store", "verify"]).ends_with("OK: all data files present and unchanged\n"));
    fleet.run_ok(&["store", "compact"]);
    assert_eq!(numbers(&fleet), numbers(&plain));
    assert!(fleet.run_ok(&["run"]).contains("0 new or changed, 30 already processed"));
}

/// Only some of the files have the newer columns; all are one table for Freeplay and for other engines.
#[test]
fn files_of_two_releases_are_one_table() {
    let fleet = old();
    fleet.run_ok(&["run", "--tail", "N412FP", "--limit", "3"]);
    let rows = fleet.rows(&["query", "tail", "N412FP"]);
    let has_skew_se = |row: &serde_json::Value| row["skew_se_s"].is_number();
    assert!(rows.iter().any(has_skew_se) && !rows.iter().all(has_skew_se), "old rows and new ones");
    assert!(rows.iter().all(|row| row["gap_m"].is_number() == (row["status"] == "estimated")));
    let log = fleet.path("results/gaps/_delta_log");
    let schemas: Vec<String> = std::fs::read_dir(log)
        .unwrap()
        .filter_map(|entry| std::fs::read_to_string(entry.unwrap().path()).ok())
        .filter(|text| text.contains("\"metaData\"") && text.contains("skew_se_s"))
        .collect();
    assert_eq!(schemas.len(), 1, "the table's new columns were committed once");
    assert!(fleet.run_ok(&["store", "verify"]).ends_with("OK: all data files present and unchanged\n"));
    fleet.run_ok(&["store", "compact"]);
    assert_eq!(fleet.rows(&["query", "tail", "N412FP"]), rows);
}
