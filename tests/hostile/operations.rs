//! What an operator sees of a run that failed, by its exit code and its metrics.

use crate::harness::TestFleet;

/// A value of the metrics file.
fn metric(fleet: &TestFleet, name: &str) -> Option<f64> {
    let name = format!("freeplay_{name} ");
    fleet.read("freeplay.prom").lines().find_map(|line| line.strip_prefix(&name)?.parse().ok())
}

/// The rules `FreeplayRunFailed` and `FreeplayRunOverdue` fire on what is written after code 2 and 3.
#[test]
fn a_failed_run_writes_its_code_and_keeps_when_one_last_completed() {
    let fleet = TestFleet::sample();
    let run = ["run", "-q", "--metrics", "freeplay.prom"];
    fleet.run_ok(&run);
    let completed = metric(&fleet, "run_completed_timestamp_seconds").unwrap();
    let ended = metric(&fleet, "run_ended_timestamp_seconds").unwrap();
    assert!(metric(&fleet, "newest_departure_timestamp_seconds").is_some_and(|newest| newest > 1.7e9));
    let table = fleet.path("sample-data/installations.csv");
    std::fs::rename(&table, fleet.path("moved.csv")).unwrap();
    assert_eq!(fleet.freeplay(&run).code, Some(2));
    assert_eq!(metric(&fleet, "run_exit_code"), Some(2.0));
    std::fs::rename(fleet.path("moved.csv"), &table).unwrap();
    std::fs::remove_file(fleet.path("results/lock")).unwrap();
    std::fs::create_dir(fleet.path("results/lock")).unwrap();
    assert_eq!(fleet.freeplay(&run).code, Some(3));
    assert_eq!(metric(&fleet, "run_exit_code"), Some(3.0));
    assert_eq!(metric(&fleet, "run_completed_timestamp_seconds"), Some(completed));
    assert!(metric(&fleet, "run_ended_timestamp_seconds").unwrap() > ended);
    assert_eq!(metric(&fleet, "logs_found"), Some(30.0), "values of the last run that had some");
}

/// All is stored when the summary cannot be written: `/dev/full` is a disk without space.
#[cfg(target_os = "linux")]
#[test]
fn a_summary_that_cannot_be_written_does_not_fail_the_run() {
    let fleet = TestFleet::sample();
    let full = std::fs::File::options().write(true).open("/dev/full").unwrap();
    let output = fleet.command(&["run"]).stdout(full).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    assert!(String::from_utf8_lossy(&output.stderr).contains("output_failed"), "{output:?}");
}

/// An object store that takes requests for a listing and answers none of them.
#[cfg(unix)]
#[test]
fn a_signal_during_a_slow_listing_ends_the_run_within_two_seconds() {
    let fleet = TestFleet::sample();
    fleet.configure("sample-data/logs/**/*.parquet", "s3://fleet/logs/**/*.parquet");
    for signal in ["-INT", "-TERM"] {
        let server = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let mut run = fleet.command(&["run", "--metrics", "freeplay.prom"]);
        run.env("AWS_ENDPOINT_URL", format!("http://{}", server.local_addr().unwrap()));
        run.envs([("AWS_ACCESS_KEY_ID", "a"), ("AWS_SECRET_ACCESS_KEY", "b"), ("AWS_REGION", "c")]);
        let mut run = run.spawn().unwrap();
        let _request = server.accept().unwrap();
        let begun = std::time::Instant::now();
        std::process::Command::new("kill").args([signal, &run.id().to_string()]).status().unwrap();
        assert_eq!(run.wait().unwrap().code(), Some(130));
        assert!(begun.elapsed() < std::time::Duration::from_secs(2), "{:?}", begun.elapsed());
        assert_eq!(metric(&fleet, "run_exit_code"), Some(130.0));
    }
}
