//! Only new work: what is accounted for is not done again, and what changed is.

use crate::harness::{TestFleet, facts, rewrite};

fn to_do(account: &str) -> String {
    account.lines().find(|l| l.trim_start().starts_with("found")).unwrap().trim().to_owned()
}

#[test]
fn a_second_run_does_nothing() {
    let fleet = TestFleet::processed();
    let before = fleet.exported();
    let account = fleet.run_ok(&["run"]);
    assert!(to_do(&account).ends_with("30 logs: 0 new or changed, 30 already processed"), "{account}");
    assert_eq!(fleet.exported(), before);
}

/// Less memory and more workers than logs move no number.
#[test]
fn a_memory_budget_and_idle_workers_change_no_record() {
    let plain = TestFleet::sample();
    plain.configure("sample-data/logs/**/*.parquet", "sample-data/logs/N412FP/*0003.parquet");
    plain.run_ok(&["run", "--jobs", "1"]);
    for settings in ["", "[run]\nmemory_mib = 1\n\n", "[run]\nmemory_mib = 4\n\n"] {
        let spread = TestFleet::sample();
        spread.configure("sample-data/logs/**/*.parquet", "sample-data/logs/N412FP/*0003.parquet");
        spread.configure("[store]", &format!("{settings}[store]"));
        spread.run_ok(&["run", "--jobs", "8"]);
        assert_eq!(spread.exported(), plain.exported(), "{settings}");
    }
}

/// Two recordings of one flight: the one whose name sorts first is used, and the other is named, also where two recorders
/// write the flight id differently.
#[test]
fn a_rival_log_of_the_same_flight_is_in_error_whichever_is_read_first() {
    for (jobs, flight_id) in [("1", None), ("2", None), ("1", Some("412-4"))] {
        let fleet = TestFleet::sample();
        let logs = fleet.logs();
        let mut truth = facts(&logs[3]);
        truth.extend(flight_id.map(|id| ("flight_id".to_owned(), id.to_owned())));
        rewrite(&logs[4], &logs[3].with_file_name("z_rival.parquet"), &truth, |_| true, |_| true);
        let result = fleet.freeplay(&["run", "--jobs", jobs]);
        assert_eq!(result.code, Some(1), "{result:?}");
        assert!(result.err.contains("error[duplicate_flight]"), "{}", result.err);
        assert!(result.err.contains("z_rival.parquet"), "{}", result.err);
        let plain = TestFleet::processed();
        assert_eq!(fleet.exported(), plain.exported());
    }
}

#[test]
fn the_account_does_not_depend_on_who_was_faster() {
    let account = |jobs: &str| {
        let fleet = TestFleet::sample();
        let logs = fleet.logs();
        let rival = logs[3].with_file_name("z_rival.parquet");
        rewrite(&logs[4], &rival, &facts(&logs[3]), |_| true, |_| true);
        let json = fleet.freeplay(&["run", "--json", "--jobs", jobs]).out;
        let report: serde_json::Value = serde_json::from_str(&json).unwrap();
        ["found", "known", "done", "flights", "estimated", "refused"].map(|key| report[key].to_string())
    };
    assert_eq!(account("1"), account("2"));
}

/// The screw channel of one aircraft is 4 ms late from some flight on: the run reports it, and the gap stays.
#[test]
fn a_recorder_change_is_distinguished_from_wear() {
    let fleet = TestFleet::sample();
    fleet.configure("sample-data/logs/**/*.parquet", "sample-data/logs/N412FP/*.parquet");
    let late: Vec<_> =
        fleet.logs().into_iter().filter(|log| log.to_string_lossy().contains("N412FP")).skip(6).collect();
    std::fs::create_dir_all(fleet.path("sample-data/late")).unwrap();
    for log in &late {
        std::fs::rename(log, fleet.path("sample-data/late").join(log.file_name().unwrap())).unwrap();
    }
    assert!(!fleet.run_ok(&["run"]).contains("not wear"));
    // Read with a latency of −4 ms, those logs are what a recorder that is 4 ms late would have written.
    fleet.configure("sample-data/logs/N412FP/*.parquet", "sample-data/late/*.parquet");
    fleet.configure(
        "column = \"{position}_screw_mm\"",
        "column = \"{position}_screw_mm\"\nlatency_s = -0.004",
    );
    let account = fleet.run_ok(&["run"]);
    assert!(
        account.contains(
            "recorder    N412FP all of aileron_left, aileron_right, elevator_left, elevator_right: delay"
        ),
        "{account}"
    );
}
