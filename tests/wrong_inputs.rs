//! Wrong settings and tables that gave a wrong number or lost one without a word: each is found, and named.

use crate::harness::{TestFleet, facts, facts_with, rewrite};

fn gaps_um(fleet: &TestFleet) -> Vec<f64> {
    let rows = fleet.rows(&["query", "tail", "N412FP"]);
    rows.iter().map(|row| row["gap_m"].as_f64().unwrap() * 1e6).collect()
}

/// A stiffness in N/µm, or of another part: the gaps stay right, and the run names the key.
#[test]
fn a_stiffness_of_another_unit_is_named_and_moves_no_gap() {
    let fleet = TestFleet::sample();
    fleet.run_ok(&["run", "--tail", "N412FP", "--quiet"]);
    let right = gaps_um(&fleet);
    for (from, to) in [("5.0e7", "5.0e8"), ("5.0e8", "5.0e10")] {
        fleet.configure(from, to);
        let check = fleet.freeplay(&["check"]);
        assert_eq!(check.code, Some(1), "{check:?}");
        assert!(check.err.contains("fit a stiffness unlike the configured one"), "{}", check.err);
        assert!(check.err.contains("`stiffness_n_per_m`"), "{}", check.err);
        let run = fleet.freeplay(&["run", "--tail", "N412FP"]);
        assert_eq!(run.code, Some(1), "{run:?}");
        assert!(run.out.contains("all actuators of part EMA-27-1040: stiffness_unlike"), "{}", run.out);
        assert!(run.out.contains("`stiffness_n_per_m`"), "{}", run.out);
        let found = gaps_um(&fleet);
        assert_eq!(found.len(), right.len());
        for (found, right) in found.iter().zip(&right) {
            assert!((found - right).abs() < 1.0, "{to}: {found} µm instead of {right} µm");
        }
    }
}

/// Hours in minutes make a unit wear sixty times slower.
#[test]
fn flight_hours_in_minutes_are_refused_with_their_row() {
    let fleet = TestFleet::sample();
    fleet.configure("[logs]\n", "[logs]\nflights = \"flights.csv\"\n");
    let table = |hours: [&str; 3]| {
        let rows = ["2026-09-07T04:00:00Z", "2026-09-07T09:00:00Z", "2026-09-08T04:00:00Z"].iter().zip(hours);
        let rows: Vec<String> =
            rows.enumerate().map(|(k, (at, hours))| format!("N412FP,F{k},{at},{hours}")).collect();
        format!("tail_number,flight_id,departure_utc,flight_hours\n{}\n", rows.join("\n"))
    };
    std::fs::write(fleet.path("flights.csv"), table(["2.1", "2.2", "2.3"])).unwrap();
    fleet.run_ok(&["check", "--limit", "1"]);
    for (hours, words) in [
        (["126", "2.2", "2.3"], ["126 flight hours", "departs again 5.0 h later", "row 1"]),
        (["2.1", "132", "2.3"], ["132 flight hours", "not minutes", "row 2"]),
        (["2.1", "-2.2", "2.3"], ["`-2.2` is below zero", "flight_hours", "row 2"]),
    ] {
        std::fs::write(fleet.path("flights.csv"), table(hours)).unwrap();
        let run = fleet.freeplay(&["run"]);
        assert_eq!(run.code, Some(2), "{run:?}");
        assert!(run.err.contains("bad_table") && run.err.contains("flights.csv"), "{}", run.err);
        assert!(words.iter().all(|word| run.err.contains(word)), "{words:?}: {}", run.err);
        assert!(!fleet.path("results").exists());
    }
}

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

#[test]
fn work_on_a_unit_that_was_never_installed_is_named() {
    let fleet = TestFleet::sample_data();
    fleet.edit("sample-data/maintenance.csv", |table| {
        table.to_owned() + "EMA-27-1040,1040-9999,2026-10-05T00:00:00Z,reshim\n"
    });
    fleet.edit("sample-data/inspections.csv", |table| table.replacen("1040-0013", "1040-0099", 1));
    let run = fleet.freeplay(&["run", "--tail", "N412FP"]);
    assert!(run.out.contains("maintenance.csv: EMA-27-1040 / 1040-9999: no such unit"), "{}", run.out);
    assert!(run.out.contains("1040-0099: no such unit"), "{}", run.out);
    let json = fleet.freeplay(&["run", "--tail", "N412FP", "--json"]);
    assert_eq!(json.json()["unknown_units"].as_array().unwrap().len(), 2);
}

/// Inputs are not written over; a device is written to and stays one; a link stays a link.
#[test]
fn an_output_replaces_no_input_and_no_device() {
    let fleet = TestFleet::sample();
    fleet.run_ok(&["run", "--tail", "N412FP", "--limit", "1", "--quiet"]);
    for input in ["pipeline.toml", "sample-data/installations.csv"] {
        let before = std::fs::read(fleet.path(input)).unwrap();
        for args in [&["trend", "--json", "-o", input][..], &["run", "--metrics", input]] {
            let result = fleet.freeplay(args);
            assert_eq!(result.code, Some(2), "{args:?}: {result:?}");
            assert!(result.err.contains("would_overwrite") && result.err.contains(input), "{}", result.err);
        }
        assert_eq!(std::fs::read(fleet.path(input)).unwrap(), before);
    }
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt;
        fleet.run_ok(&["trend", "--json", "-o", "/dev/null"]);
        assert!(std::fs::metadata("/dev/null").unwrap().file_type().is_char_device());
        std::os::unix::fs::symlink("real.json", fleet.path("link.json")).unwrap();
        std::fs::write(fleet.path("real.json"), "old").unwrap();
        fleet.run_ok(&["trend", "--json", "-o", "link.json"]);
        assert!(fleet.path("link.json").is_symlink());
        assert!(std::fs::read_to_string(fleet.path("real.json")).unwrap().starts_with('['));
    }
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

/// Minutes in the metadata of a log, a workbook, a column that is there twice, and a play in micrometres.
#[test]
fn units_and_formats_of_single_files_are_refused_with_what_is_wanted() {
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

    fleet.configure("[logs]\n", "[logs]\ninspections = \"checks.csv\"\n");
    let header = "serial_number,date_utc,play_m\n";
    for (content, wanted) in [
        (
            format!("{header}1040-0005,2026-09-20T00:00:00Z,64\n"),
            "`64` is not between 0 and 0.01 m: 64 µm are 64e-6",
        ),
        ("serial_number,date_utc,play_m,play_m\n".to_owned(), "column `play_m` twice"),
        ("PK\u{3}\u{4}workbook".to_owned(), "this is an Excel workbook: save it as CSV in UTF-8"),
    ] {
        std::fs::write(fleet.path("checks.csv"), content).unwrap();
        let report = fleet.freeplay(&["report", "--output", "pages"]);
        assert_eq!(report.code, Some(2), "{wanted}: {report:?}");
        assert!(report.err.contains("checks.csv") && report.err.contains(wanted), "{wanted}: {}", report.err);
    }
}
