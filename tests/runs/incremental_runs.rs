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

#[test]
fn a_renamed_or_touched_log_is_recognised_by_its_content() {
    let fleet = TestFleet::processed();
    let before = fleet.exported();
    let log = &fleet.logs()[0];
    std::fs::rename(log, log.with_file_name("renamed.parquet")).unwrap();
    let other = &fleet.logs()[5];
    let bytes = std::fs::read(other).unwrap();
    std::fs::remove_file(other).unwrap();
    std::fs::write(other, bytes).unwrap();
    let account = fleet.run_ok(&["run"]);
    assert!(account.contains("0 records of 0 flights"), "{account}");
    assert_eq!(fleet.exported(), before);
    assert!(to_do(&fleet.run_ok(&["run"])).ends_with("30 logs: 0 new or changed, 30 already processed"));
}

/// A changed byte that changes neither size nor date: found only when contents are compared.
#[test]
fn content_is_compared_on_request() {
    let fleet = TestFleet::sample();
    fleet.configure("sample-data/logs/**/*.parquet", "sample-data/logs/N412FP/*.parquet");
    fleet.run_ok(&["run"]);
    let log = &fleet.logs()[4];
    let written = std::fs::metadata(log).unwrap().modified().unwrap();
    let mut content = std::fs::read(log).unwrap();
    let sound = content.clone();
    let middle = content.len() / 2;
    content[middle] ^= 1;
    std::fs::write(log, content).unwrap();
    std::fs::File::options().append(true).open(log).unwrap().set_modified(written).unwrap();
    assert!(to_do(&fleet.run_ok(&["run"])).ends_with("10 logs: 0 new or changed, 10 already processed"));
    let result = fleet.freeplay(&["run", "--verify-content"]);
    assert!(to_do(&result.out).ends_with("10 logs: 1 new or changed, 9 already processed"), "{result:?}");
    // A failed log of the same size and date is compared too.
    assert_eq!(result.code, Some(1), "its checksum is wrong: {result:?}");
    std::fs::write(log, sound).unwrap();
    std::fs::File::options().append(true).open(log).unwrap().set_modified(written).unwrap();
    assert_eq!(fleet.freeplay(&["run"]).code, Some(1), "the same size and date");
    fleet.run_ok(&["run", "--verify-content"]);
    let page = fleet.run_ok(&["store", "runs", "--run", "last"]);
    assert!(page.contains("known 9") && page.contains("10 logs"), "{page}");
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

#[test]
fn a_copy_of_a_log_adds_nothing_whichever_is_read_first() {
    let fleet = TestFleet::sample();
    let log = &fleet.logs()[3];
    std::fs::copy(log, log.with_file_name("copy.parquet")).unwrap();
    fleet.run_ok(&["run"]);
    let plain = TestFleet::processed();
    assert_eq!(fleet.exported(), plain.exported());
}

/// Two recordings of one flight: the one whose name sorts first is used, and the other is named.
#[test]
fn a_rival_log_of_the_same_flight_is_in_error_whichever_is_read_first() {
    for jobs in ["1", "2"] {
        let fleet = TestFleet::sample();
        let logs = fleet.logs();
        let truth = facts(&logs[3]);
        rewrite(&logs[4], &logs[3].with_file_name("z_rival.parquet"), &truth, |_| true, |_| true);
        let result = fleet.freeplay(&["run", "--jobs", jobs]);
        assert_eq!(result.code, Some(1), "{result:?}");
        assert!(result.err.contains("error[duplicate_flight]"), "{}", result.err);
        assert!(result.err.contains("z_rival.parquet"), "{}", result.err);
        let plain = TestFleet::processed();
        assert_eq!(fleet.exported(), plain.exported());
    }
}

/// When the log that spoke for a flight breaks, its copy takes over on the next run.
#[test]
fn a_copy_speaks_when_the_first_log_breaks() {
    let fleet = TestFleet::sample();
    let log = &fleet.logs()[3];
    std::fs::copy(log, log.with_file_name("z_copy.parquet")).unwrap();
    fleet.run_ok(&["run"]);
    let before = fleet.exported();
    std::fs::write(log, b"broken").unwrap();
    assert_eq!(fleet.freeplay(&["run"]).code, Some(1));
    assert!(fleet.run_ok(&["run", "--dry-run"]).contains("its flight has no other log now"));
    // The broken log stays an error until it is repaired.
    assert_eq!(fleet.freeplay(&["run"]).code, Some(1));
    assert_eq!(fleet.exported(), before);
    let again = fleet.freeplay(&["run"]);
    assert_eq!(again.code, Some(1));
    assert!(to_do(&again.out).ends_with("31 logs: 0 new or changed, 31 already processed"));
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

#[test]
fn a_pattern_that_reaches_our_own_results_does_not_read_them() {
    let fleet = TestFleet::sample();
    fleet.configure("sample-data/logs/**/*.parquet", "**/*_N41*.parquet");
    fleet.run_ok(&["run"]);
    fleet.configure("**/*_N41*.parquet", "**/*.parquet");
    std::fs::remove_file(fleet.path("sample-data/truth.parquet")).unwrap();
    assert!(to_do(&fleet.run_ok(&["run"])).ends_with("30 logs: 0 new or changed, 30 already processed"));
}

/// A stored estimate can be recomputed from the provenance in its record.
#[test]
fn a_record_is_explained_and_recomputed_bitwise() {
    let fleet = TestFleet::sample();
    fleet.configure("sample-data/logs/**/*.parquet", "sample-data/logs/N412FP/*0003.parquet");
    fleet.run_ok(&["run"]);
    let output = fleet.run_ok(&["explain", "N412FP-0003", "aileron_left"]);
    for part in ["bit-identical", "stiffness_n_per_m = 50000000.0", "motor [m]", "computed by Freeplay"] {
        assert!(output.contains(part), "{part} is not in {output}");
    }
    let json = fleet.run_ok(&["explain", "N412FP-0003", "aileron_left", "--json"]);
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["replay"]["verdict"], "same");
    fleet.configure("stiffness_n_per_m = 5.0e7", "stiffness_n_per_m = 5.1e7");
    assert!(fleet.run_ok(&["explain", "N412FP-0003", "aileron_left"]).contains("settings changed"));
    std::fs::write(&fleet.logs()[2], b"gone").unwrap();
    let result = fleet.freeplay(&["explain", "N412FP-0003", "aileron_left"]);
    assert_eq!(result.code, Some(1), "{result:?}");
    assert!(result.err.contains("error[not_parquet]"), "{}", result.err);
    assert_eq!(fleet.freeplay(&["explain", "N412FP-0003", "rudder"]).code, Some(2));
}

#[test]
fn metrics_tell_when_a_run_last_completed_and_how() {
    let fleet = TestFleet::sample();
    fleet.configure("sample-data/logs/**/*.parquet", "sample-data/logs/N412FP/*.parquet");
    std::fs::write(&fleet.logs()[0], b"").unwrap();
    let result = fleet.freeplay(&["run", "--metrics", "freeplay.prom"]);
    assert_eq!(result.code, Some(1));
    let text = std::fs::read_to_string(fleet.path("freeplay.prom")).unwrap();
    for line in [
        "freeplay_logs_found 10",
        "freeplay_logs_in_error 1",
        "freeplay_records_estimated 36",
        "freeplay_run_exit_code 1",
    ] {
        assert!(text.contains(&format!("\n{line}\n")), "{line} is not in {text}");
    }
    assert!(text.contains("freeplay_run_completed_timestamp_seconds 1"));
    // Every sample has its help and type, as the format asks.
    let samples = text.lines().filter(|l| !l.starts_with('#')).count();
    assert_eq!(text.lines().filter(|l| l.starts_with("# TYPE")).count(), samples);
}

#[test]
fn a_tail_that_went_quiet_is_named() {
    let fleet = TestFleet::sample();
    let account = fleet.run_ok(&["run"]);
    assert!(!account.contains("no data"), "{account}");
    let installations = fleet.path("pipeline.toml");
    let text = std::fs::read_to_string(&installations).unwrap() + "stale_after_days = 20.0\n";
    std::fs::write(&installations, text).unwrap();
    for log in fleet.logs().iter().rev().filter(|log| log.to_string_lossy().contains("N414FP")).take(6) {
        std::fs::remove_file(log).unwrap();
    }
    std::fs::remove_dir_all(fleet.path("results")).unwrap();
    let account = fleet.run_ok(&["run"]);
    assert!(account.contains("no data     from 1 tail: N414FP since"), "{account}");
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
