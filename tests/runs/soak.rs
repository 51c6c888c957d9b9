//! A fleet whose logs arrive day by day, while runs are killed, meet failing disks, broken files and wrong clocks.
//!
//! At the end the store equals that of one run over the same logs, and a run needs no more memory than at first. The
//! test lasts two days, the gate six; `FREEPLAY_SOAK=365` is a year.

use std::path::Path;
use std::process::Stdio;
use std::time::Duration;

use crate::gate::is_gate;
use crate::harness::{TestFleet, facts, print_line, rewrite};
use crate::runs::injected_faults::Injector;
use crate::runs::interruption::whole_flights;

/// Days of the test, and of the gate.
const DAYS: [usize; 2] = [2, 6];

/// Flights that a day brings.
const FLIGHTS: usize = 2;

/// Rows of a log: enough for an estimate, few enough for a year of days.
const ROWS: usize = 6000;

/// A fleet without logs, and the logs that it starts from.
fn bare() -> (TestFleet, Vec<std::path::PathBuf>) {
    let fleet = TestFleet::sample();
    let source = fleet.path("source");
    std::fs::create_dir_all(&source).unwrap();
    for log in fleet.logs_of("N413FP") {
        std::fs::rename(&log, source.join(log.file_name().unwrap())).unwrap();
    }
    fleet.configure("sample-data/logs/**/*.parquet", "logs/*.parquet");
    std::fs::create_dir_all(fleet.path("logs")).unwrap();
    let logs = fleet.glob("source/*.parquet");
    (fleet, logs)
}

/// Writes the log of a day: a sample log as another flight.
fn fly(source: &Path, to: &Path, flight: usize) {
    let mut labels = facts(source);
    for (key, value) in &mut labels {
        match key.as_str() {
            "flight_id" => *value = format!("S{flight:05}"),
            "departure_utc" => *value = departure(flight),
            _ => {}
        }
    }
    rewrite(source, to, &labels, |_| true, |row| row < ROWS);
}

/// Flights follow each other by 30 minutes, all of them after the installation and before today.
fn departure(flight: usize) -> String {
    let begin: jiff::Timestamp = "2026-10-01T00:00:00Z".parse().unwrap();
    (begin + jiff::SignedDuration::from_mins(30 * flight as i64)).to_string()
}

/// Runs to the end, or until it is killed; returns the largest memory seen, KiB.
fn run_watched(fleet: &TestFleet, kill_after: Option<Duration>) -> Option<u64> {
    let mut command = fleet.command(&["run", "--jobs", "1", "-q"]);
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let status = format!("/proc/{}/status", child.id());
    let (begun, mut peak) = (std::time::Instant::now(), None);
    loop {
        let text = std::fs::read_to_string(&status).unwrap_or_default();
        let seen =
            text.lines().find_map(|line| line.strip_prefix("VmHWM:")?.trim().split(' ').next()?.parse().ok());
        peak = peak.max(seen);
        if child.try_wait().unwrap().is_some() {
            return peak;
        }
        if kill_after.is_some_and(|after| begun.elapsed() > after) {
            child.kill().unwrap();
            child.wait().unwrap();
            return None;
        }
        std::thread::park_timeout(Duration::from_millis(5));
    }
}

#[test]
fn a_year_of_faults_ends_with_the_store_of_one_run() {
    let Some(injector) = Injector::get() else { return };
    let days = std::env::var("FREEPLAY_SOAK")
        .ok()
        .and_then(|n| n.parse().ok())
        .unwrap_or(DAYS[usize::from(is_gate())]);
    let mut chance = fastrand::Rng::with_seed(7);
    let (fleet, sources) = bare();
    let (mut peaks, mut counts) = (Vec::new(), [0; 6]);
    let mut broken: Vec<(std::path::PathBuf, Vec<u8>)> = Vec::new();
    for day in 0..days {
        // Files that were broken are sent again, whole.
        for (log, bytes) in std::mem::take(&mut broken) {
            std::fs::write(log, bytes).unwrap();
        }
        for flight in day * FLIGHTS..(day + 1) * FLIGHTS {
            let log = fleet.path(&format!("logs/{flight:05}.parquet"));
            fly(&sources[flight % sources.len()], &log, flight);
            if chance.f64() < 0.1 {
                let bytes = std::fs::read(&log).unwrap();
                std::fs::write(&log, &bytes[..(bytes.len() as f64 * chance.f64()) as usize]).unwrap();
                broken.push((log, bytes));
                counts[5] += 1;
            }
        }
        let kind = (chance.f64() * 5.0) as usize;
        counts[kind] += 1;
        match kind {
            0 => drop(run_watched(&fleet, Some(Duration::from_secs_f64(3.0 * chance.f64())))),
            1 => drop(injector.with_clock(&fleet, &["run", "-q"], 86_400 * 3650)),
            2 => drop(injector.with_clock(&fleet, &["run", "-q"], -86_400 * 400)),
            3 => injector.random_fault(&fleet, (chance.f64() * 300.0) as usize),
            _ => peaks.extend(run_watched(&fleet, None)),
        }
    }
    for (log, bytes) in broken {
        std::fs::write(log, bytes).unwrap();
    }
    let last = run_watched(&fleet, None).unwrap();
    fleet.run_ok(&["run", "--retry", "-q"]);
    let records = whole_flights(&fleet);
    let found = fleet.exported();
    std::fs::remove_dir_all(fleet.path("results")).unwrap();
    fleet.run_ok(&["run", "-q"]);
    assert_eq!(found, fleet.exported(), "the store is not that of one run");
    assert_eq!(records, days * FLIGHTS * 4);
    let [killed, ahead, back, failed, sound, files] = counts;
    print_line(&format!(
        "{days} days: {killed} killed, {failed} with a failing disk, {ahead} with the clock ahead, {back} with it \
         back, {sound} undisturbed, {files} broken files; {records} records, 0 lost; memory {:?} to {last} KiB",
        peaks.first()
    ));
    // A year of records is a few MB; the rest of a run's memory does not grow.
    let first = *peaks.first().unwrap_or(&last);
    assert!(last < first + first / 2, "memory grew from {first} to {last} KiB");
}
