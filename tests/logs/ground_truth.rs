//! The sample fleet against its truth.

use std::process::Command;

use crate::gate::is_gate;
use crate::harness::{CommandResult, Table, TestFleet, print_line};

/// What the sample fleet is there to show: small errors, each state, an event that is not on record, a removal, and dates
/// within months of the last flight.
#[test]
fn the_sample_fleet_has_a_median_error_below_one_per_cent_every_state_and_dates_within_months() {
    let fleet = TestFleet::sample_data();
    let account = fleet.run_ok(&["run"]);
    fleet.run_ok(&["store", "export", "--format", "parquet", "--output", "gaps.parquet"]);
    let found = Table::read(&fleet.path("gaps.parquet")).by_flight("gap_m");
    let truth = Table::read(&fleet.path("sample-data/truth.parquet")).by_flight("gap_m");
    assert_eq!(found.keys().collect::<Vec<_>>(), truth.keys().collect::<Vec<_>>());
    let (rows, flights) = (truth.len(), truth.len() / 4);
    let stored = format!("{rows} records of {flights} flights: {rows} estimated, 0 refused");
    assert!(
        account.contains(&stored) && account.contains("1 log with the samples of another log"),
        "{account}"
    );
    let mut errors: Vec<f64> =
        found.iter().map(|(key, gap)| 100.0 * (gap / truth[key] - 1.0).abs()).collect();
    errors.sort_by(f64::total_cmp);
    let (median, p95, worst) = (errors[rows / 2], errors[rows * 19 / 20], errors[rows - 1]);
    print_line(&format!(
        "gap against truth, {rows} records: median {median:.2} %, 95 % {p95:.2} %, worst {worst:.2} %"
    ));
    assert!(median < 1.0, "median error {median} %");

    let units = fleet.rows(&["trend"]);
    let of = |serial: &str| units.iter().find(|unit| unit["serial_number"] == serial).unwrap();
    let states = ["1040-0013", "1040-0009", "1060-0015", "1040-0006", "1040-0010", "1040-0014"];
    assert_eq!(
        states.map(|serial| of(serial)["state"].as_str()),
        [Some("act"), Some("plan"), Some("plan"), Some("watch"), Some("normal"), None]
    );
    let reason = |serial: &str| of(serial)["reason"].as_str().unwrap().to_owned();
    assert!(reason("1040-0006").contains("not on record"), "{}", reason("1040-0006"));
    assert!(reason("1040-0014").contains("removed"), "{}", reason("1040-0014"));
    for serial in ["1040-0009", "1060-0015"] {
        let hours = of(serial)["crossing_hours_p05"].as_f64().unwrap();
        // At 7.6 h a day, three weeks to three months.
        assert!((160.0..700.0).contains(&hours), "{serial} in {hours} h");
    }
}

/// `init --sample` needs no source tree, and simulates the files of `sample-data/` again, byte for byte.
#[test]
fn the_sample_fleet_is_made_anywhere_and_is_the_same_again() {
    if !is_gate() {
        print_line("skipped: 20 s of simulation; set FREEPLAY_TESTS=gate");
        return;
    }
    let (made, kept) = (TestFleet::empty(), TestFleet::sample_data());
    let result = made.freeplay(&["init", "--sample", "demo"]);
    assert_eq!(result.code, Some(0), "{result:?}");
    assert!(result.err.contains("next: cd demo && freeplay run"), "{}", result.err);
    std::fs::remove_file(kept.path("sample-data/README.md")).unwrap();
    let compared = CommandResult::of(Command::new("diff").arg("-r").args([made.path("demo"), kept.path("")]));
    assert_eq!(compared.code, Some(0), "{compared:?}");
    for folder in ["demo/sample-data", "demo/pipeline.toml"] {
        let again = made.freeplay(&["init", "demo", "--sample"]);
        assert!(again.code == Some(2) && again.err.contains("would_overwrite"), "{again:?}");
        let path = made.path(folder);
        if path.is_dir() {
            std::fs::remove_dir_all(path).unwrap();
        } else {
            std::fs::remove_file(path).unwrap();
        }
    }
    assert_eq!(made.freeplay(&["init", "--sample", "--from", "demo"]).code, Some(2));
}
