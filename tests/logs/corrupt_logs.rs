//! Logs that cannot be used become a reason; everything else is stored.

use crate::harness::TestFleet;

/// Truncated, empty, not Parquet, a flipped byte in a page, an unknown tail: five logs, five codes.
fn spoil(fleet: &TestFleet) {
    let logs = fleet.logs();
    let bytes = std::fs::read(&logs[0]).unwrap();
    std::fs::write(&logs[0], &bytes[..bytes.len() / 2]).unwrap();
    std::fs::write(&logs[1], b"").unwrap();
    std::fs::write(&logs[2], b"tail,flight\nN412FP,1\n").unwrap();
    let table = fleet.path("sample-data/installations.csv");
    let text = std::fs::read_to_string(&table).unwrap();
    let kept: Vec<&str> = text.lines().filter(|line| !line.starts_with("N414FP,elevator_left")).collect();
    std::fs::write(&table, kept.join("\n")).unwrap();
}

#[test]
fn broken_logs_are_named_and_the_others_stored() {
    let fleet = TestFleet::sample();
    spoil(&fleet);
    let result = fleet.freeplay(&["run"]);
    assert_eq!(result.code, Some(1), "{result:?}");
    for code in ["not_parquet", "empty_log", "unit_unknown"] {
        assert!(result.err.contains(&format!("error[{code}]")), "{code} is not in {}", result.err);
    }
    assert!(result.out.contains("98 records of 27 flights"), "{}", result.out);
    assert!(result.out.contains("13 logs could not be used; all others are stored"), "{}", result.out);
    assert!(result.out.contains("freeplay run --retry"), "{}", result.out);
}

#[test]
fn an_error_is_not_tried_again_until_asked_or_mended() {
    let fleet = TestFleet::sample();
    spoil(&fleet);
    fleet.freeplay(&["run"]);
    let again = fleet.freeplay(&["run"]);
    assert_eq!(again.code, Some(1), "nothing new, and the logs are still in error: {again:?}");
    let retried = fleet.freeplay(&["run", "--retry"]);
    assert_eq!(retried.code, Some(1), "{retried:?}");
    let sound = TestFleet::sample();
    for (mended, whole) in fleet.logs().iter().zip(sound.logs()).take(3) {
        std::fs::copy(whole, mended).unwrap();
    }
    std::fs::copy(sound.path("sample-data/installations.csv"), fleet.path("sample-data/installations.csv"))
        .unwrap();
    assert_eq!(fleet.freeplay(&["run"]).code, Some(0));
    sound.run_ok(&["run"]);
    assert_eq!(fleet.exported(), sound.exported());
}

#[test]
fn check_and_estimate_say_what_is_wrong_with_code_1() {
    let fleet = TestFleet::sample();
    spoil(&fleet);
    let log = fleet.logs()[0].display().to_string();
    for command in ["check", "estimate"] {
        let result = fleet.freeplay(&[command, &log]);
        assert_eq!(result.code, Some(1), "{result:?}");
        assert!(result.err.contains("error[not_parquet]"), "{}", result.err);
        assert!(result.err.contains("hint:"), "{}", result.err);
    }
}

#[test]
fn a_log_that_lacks_a_mapped_column_names_it() {
    let fleet = TestFleet::sample();
    fleet.configure("column = \"time_s\"", "column = \"time\"");
    let log = fleet.logs()[0].display().to_string();
    let result = fleet.freeplay(&["check", &log]);
    assert_eq!(result.code, Some(1));
    assert!(result.err.contains("error[column_missing]"), "{}", result.err);
    assert!(result.err.contains("`time_s`?"), "{}", result.err);
}
