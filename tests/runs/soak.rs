//! A fleet whose logs arrive day by day, while runs are killed, meet failing disks, broken files and wrong clocks, logs go and are
//! corrected, tables are corrected, and flights are taken out and brought back, all in an order from a seed.
//!
//! At the end, what is stored and stated is what one run over the last logs and tables makes, and a run needs no more memory than
//! at first. The test has a few fleets and days; `FREEPLAY_SOAK=365` is one fleet for a year.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::Duration;

use serde_json::Value;

use crate::gate::is_gate;
use crate::harness::{TestFleet, each, facts, print_line, rewrite};
use crate::runs::injected_faults::Injector;
use crate::runs::interruption::whole_flights;

/// Fleets and days of the test, and of the gate.
const SIZES: [(u64, usize); 2] = [(2, 4), (8, 8)];

const FLIGHTS: usize = 2;

/// Rows of a log: enough for an estimate, few enough for a year of days.
const ROWS: usize = 6000;

const TABLE: &str = "sample-data/installations.csv";

/// A fleet without logs, and the logs that it starts from. Logs are sent to `logs`; `sent` holds the last content of each.
fn bare() -> (TestFleet, Vec<PathBuf>) {
    let fleet = TestFleet::sample();
    fleet.configure("sample-data/logs/**/*.parquet", "logs/*.parquet");
    for folder in ["logs", "sent"] {
        std::fs::create_dir_all(fleet.path(folder)).unwrap();
    }
    let logs = fleet.logs_of("N413FP");
    (fleet, logs)
}

/// Writes the log of a flight: a sample log from a row on, as another flight. Flights follow each other by 30 minutes, all of them
/// after the installation and before today.
fn fly(source: &Path, to: &Path, flight: usize, first: usize) {
    let begin: jiff::Timestamp = "2026-10-01T00:00:00Z".parse().unwrap();
    let mut labels = facts(source);
    for (key, value) in &mut labels {
        match key.as_str() {
            "flight_id" => *value = format!("S{flight:05}"),
            "departure_utc" => {
                *value = (begin + jiff::SignedDuration::from_mins(30 * flight as i64)).to_string();
            }
            _ => {}
        }
    }
    rewrite(source, to, &labels, |row| (first..ROWS).contains(&row));
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

/// Writes a version of the installations table: as it is; another unit on the left aileron; the elevators swapped earlier.
fn write_table(fleet: &TestFleet, version: usize, text: &str) {
    let text = match version {
        0 => text.to_owned(),
        1 => text.replace(
            "N413FP,aileron_left,EMA-27-1040,1040-0009",
            "N413FP,aileron_left,EMA-27-1040,1040-0099",
        ),
        _ => text.replace("2026-10-12", "2026-09-25"),
    };
    std::fs::write(fleet.path(TABLE), text).unwrap();
}

/// Every record, and the trend of every unit by serial number.
fn results(fleet: &TestFleet) -> (String, BTreeMap<String, Value>) {
    let rows = fleet.rows(&["trend"]).into_iter();
    (fleet.exported(), rows.map(|row| (row["serial_number"].as_str().unwrap().to_owned(), row)).collect())
}

#[test]
fn days_of_faults_and_corrections_end_with_the_store_of_one_run() {
    let Some(injector) = Injector::get() else { return };
    let year = std::env::var("FREEPLAY_SOAK").ok().and_then(|n| n.parse().ok());
    let (fleets, days) = year.map_or(SIZES[usize::from(is_gate())], |days| (1, days));
    each(&(0..fleets).collect::<Vec<_>>(), |seed| soak(injector, *seed, days));
}

fn soak(injector: &Injector, seed: u64, days: usize) {
    let mut chance = fastrand::Rng::with_seed(seed);
    let (fleet, sources) = bare();
    let table = fleet.read(TABLE);
    let log = |folder: &str, flight: usize| fleet.path(&format!("{folder}/{flight:05}.parquet"));
    let send = |flight: usize| {
        std::fs::copy(log("sent", flight), log("logs", flight)).unwrap();
    };
    let (mut peaks, mut counts, mut broken) = (Vec::new(), [0; 6], Vec::new());
    for day in 0..days {
        // Files that were broken are sent again, whole.
        std::mem::take(&mut broken).into_iter().for_each(send);
        for flight in day * FLIGHTS..(day + 1) * FLIGHTS {
            fly(&sources[flight % sources.len()], &log("sent", flight), flight, 0);
            send(flight);
            if chance.usize(..10) == 0 {
                let bytes = std::fs::read(log("sent", flight)).unwrap();
                std::fs::write(log("logs", flight), &bytes[..chance.usize(..bytes.len())]).unwrap();
                broken.push(flight);
                counts[5] += 1;
            }
        }
        let flight = chance.usize(..(day + 1) * FLIGHTS);
        match chance.usize(..6) {
            0 => drop(std::fs::remove_file(log("logs", flight))),
            1 => write_table(&fleet, chance.usize(..3), &table),
            2 => {
                fly(
                    &sources[flight % sources.len()],
                    &log("sent", flight),
                    flight,
                    200 + chance.usize(..200),
                );
                send(flight);
            }
            kind @ (3 | 4) => {
                let undo = if kind == 3 { &["--undo"][..] } else { &[] };
                fleet.freeplay(&[&["store", "forget", "--flight", &format!("S{flight:05}")], undo].concat());
            }
            _ => {}
        }
        let kind = chance.usize(..5);
        counts[kind] += 1;
        match kind {
            0 => drop(run_watched(&fleet, Some(Duration::from_secs_f64(3.0 * chance.f64())))),
            1 => drop(injector.with_clock(&fleet, &["run", "-q"], 86_400 * 3650)),
            2 => drop(injector.with_clock(&fleet, &["run", "-q"], -86_400 * 400)),
            3 => injector.random_fault(&fleet, chance.usize(..300)),
            _ => peaks.extend(run_watched(&fleet, None)),
        }
    }
    (0..days * FLIGHTS).for_each(send);
    let version = chance.usize(..3);
    write_table(&fleet, version, &table);
    fleet.freeplay(&["store", "forget", "--tail", "N413FP", "--undo"]);
    let last = run_watched(&fleet, None).unwrap();
    fleet.run_ok(&["run", "--retry", "-q"]);
    assert_eq!(whole_flights(&fleet), days * FLIGHTS * 4, "seed {seed}");
    let found = results(&fleet);
    // Readers join another table before a run writes it.
    write_table(&fleet, (version + 1) % 3, &table);
    let joined = fleet.exported();
    fleet.run_ok(&["run", "-q"]);
    assert_eq!(fleet.exported(), joined, "seed {seed}");
    write_table(&fleet, version, &table);
    std::fs::remove_dir_all(fleet.path("results")).unwrap();
    fleet.run_ok(&["run", "-q"]);
    assert_eq!(found, results(&fleet), "seed {seed}: the store is not that of one run");
    let [killed, ahead, back, failed, sound, files] = counts;
    print_line(&format!(
        "{days} days: {killed} killed, {failed} with a failing disk, {ahead} with the clock ahead, {back} with it \
         back, {sound} undisturbed, {files} broken files; {} records, 0 lost; memory {:?} to {last} KiB",
        days * FLIGHTS * 4,
        peaks.first()
    ));
    // A year of records is a few MB; the rest of a run's memory does not grow.
    let first = *peaks.first().unwrap_or(&last);
    assert!(last < first + first / 2, "memory grew from {first} to {last} KiB");
}
