//! Interrupted runs: finished flights are kept, and the next run reaches the same store as an uninterrupted one.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::Stdio;
use std::time::Duration;

use crate::harness::{TestFleet, wait_until};

#[cfg(unix)]
fn interrupt(child: &std::process::Child) {
    std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
}

/// A run of one worker that has begun.
#[cfg(unix)]
fn begun(fleet: &TestFleet) -> std::process::Child {
    let mut run = fleet.command(&["run", "--jobs", "1", "--no-progress"]);
    let mut child = run.stdout(Stdio::piped()).spawn().unwrap();
    let entry = fleet.path("results/runs/_delta_log/00000000000000000001.json");
    wait_until(|| entry.exists() || child.try_wait().unwrap().is_some());
    child
}

/// A run that receives an interrupt finishes the flights in progress and reports the others; a second interrupt ends the run
/// within a second, whatever is in progress.
#[cfg(unix)]
#[test]
fn an_interrupted_run_exits_with_130_and_the_next_one_finishes() {
    for is_repeated in [false, true] {
        let fleet = TestFleet::sample();
        let child = begun(&fleet);
        let struck = std::time::Instant::now();
        (0..=usize::from(is_repeated)).for_each(|_| interrupt(&child));
        let output = child.wait_with_output().unwrap();
        let (text, took) = (String::from_utf8(output.stdout).unwrap(), struck.elapsed());
        assert_eq!(output.status.code(), Some(130), "{text}");
        assert!(
            if is_repeated { took < Duration::from_secs(1) } else { text.contains("not processed") },
            "{took:?}: {text}"
        );
        fleet.run_ok(&["run"]);
        assert_eq!(whole_flights(&fleet), 120);
    }
}

/// Ten flights of four actuators.
pub(crate) fn small() -> TestFleet {
    let fleet = TestFleet::sample();
    fleet.configure("sample-data/logs/**/*.parquet", "sample-data/logs/N413FP/*.parquet");
    fleet
}

/// Opens a store as another program would, and counts its records: four for each flight, each once; or what is wrong.
pub(crate) fn stored_records(folder: &Path) -> Result<usize, String> {
    let store = match store::Store::open(folder) {
        Ok(store) => store,
        // Killed before the store was made, or while it was.
        Err(error) if error.diagnostic().code == "store_missing" => return Ok(0),
        Err(error) => return Err(format!("the store does not open: {error}")),
    };
    let records = store.records(&store::Query::default()).map_err(|e| e.to_string())?;
    let mut flights = BTreeMap::<String, BTreeSet<String>>::new();
    for record in &records {
        let (flight, position) = (record.flight.flight_id.to_string(), record.position.to_string());
        if !flights.entry(flight).or_default().insert(position) {
            return Err(format!("{} of {} is there twice", record.position, record.flight.flight_id));
        }
    }
    if !flights.values().all(|positions| positions.len() == 4) {
        return Err(format!("half a flight: {flights:?}"));
    }
    let found = store.verify();
    if found.is_empty() { Ok(records.len()) } else { Err(format!("{found:?}")) }
}

/// Number of records in the fleet's store, which must be whole.
pub(crate) fn whole_flights(fleet: &TestFleet) -> usize {
    stored_records(&fleet.path("results")).unwrap()
}

/// A run that waits for another hears the first signal.
#[cfg(target_os = "linux")]
#[test]
fn a_run_that_waits_can_be_interrupted() {
    let fleet = small();
    fleet.run_ok(&["run", "--limit", "1"]);
    let store = store::Store::open(fleet.path("results")).unwrap();
    let held = store.lock(None).unwrap();
    let run = ["run", "--wait", "10m", "--metrics", "freeplay.prom"];
    let child = fleet.command(&run).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let opened = format!("/proc/{}/fd/*", child.id());
    let has_lock =
        |file: std::path::PathBuf| std::fs::read_link(file).is_ok_and(|file| file.ends_with("lock"));
    wait_until(|| glob::glob(&opened).unwrap().flatten().any(has_lock));
    interrupt(&child);
    let result = child.wait_with_output().unwrap();
    assert_eq!(result.status.code(), Some(130), "{result:?}");
    let metrics = fleet.read("freeplay.prom");
    assert!(metrics.contains("\nfreeplay_run_exit_code 130\n"), "{metrics}");
    drop(held);
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
        assert!(begun.elapsed() < Duration::from_secs(2), "{:?}", begun.elapsed());
        let metrics = fleet.read("freeplay.prom");
        assert!(metrics.contains("\nfreeplay_run_exit_code 130\n"), "{metrics}");
    }
}
