//! Logs, corrected tables and withdrawals in any order. Single corrections are in `tests/data/commands.md` and
//! `tests/data/logs.md`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

use serde_json::Value;

use crate::gate::is_gate;
use crate::harness::{TestFleet, facts, facts_with, rewrite};

const TABLE: &str = "sample-data/installations.csv";

/// The trend of every unit, by serial number.
fn trend(fleet: &TestFleet) -> BTreeMap<String, Value> {
    let rows = fleet.rows(&["trend"]);
    rows.into_iter().map(|row| (row["serial_number"].as_str().unwrap().to_owned(), row)).collect()
}

/// Versions of the installations table: as it is; another unit on the left aileron; the elevators swapped earlier.
fn table(version: usize, text: &str) -> String {
    match version {
        0 => text.to_owned(),
        1 => text.replace(
            "N412FP,aileron_left,EMA-27-1040,1040-0005",
            "N412FP,aileron_left,EMA-27-1040,1040-0099",
        ),
        _ => text.replace("2026-10-12", "2026-09-25"),
    }
}

/// Logs that arrive, go and are corrected, corrected tables, flights taken out and brought back, and killed runs, through
/// the command in any order: what is stored and stated in the end is what one run over the last logs and tables makes.
#[test]
fn any_order_of_commands_ends_where_one_run_does() {
    let source = TestFleet::sample();
    source.configure("logs/**/*.parquet", "logs/N412FP/*.parquet");
    let whole = source.read(TABLE);
    let logs: Vec<PathBuf> = source.logs().into_iter().take(5).collect();
    let name = |log: &Path| log.strip_prefix(source.path("")).unwrap().to_owned();
    for seed in 0..if is_gate() { 24 } else { 2 } {
        let mut chance = fastrand::Rng::with_seed(seed);
        let fleet = source.copied();
        fleet.logs().iter().for_each(|log| std::fs::remove_file(log).unwrap());
        let mut contents: Vec<PathBuf> = logs.clone();
        for _ in 0..12 {
            let k = chance.usize(..logs.len());
            let here = fleet.path(name(&logs[k]).to_str().unwrap());
            match chance.usize(..10) {
                0 | 1 => drop(std::fs::copy(&contents[k], &here).unwrap()),
                2 => drop(std::fs::remove_file(&here)),
                3 => std::fs::write(fleet.path(TABLE), table(chance.usize(..3), &whole)).unwrap(),
                4 => {
                    contents[k] = fleet.path(&format!("{k}-{}.corrected", chance.usize(..1_000)));
                    let first = 200 + chance.usize(..200);
                    rewrite(&logs[k], &contents[k], &facts(&logs[k]), |_| true, |row| row >= first);
                }
                5 => {
                    let flight = format!("N412FP-{:04}", k + 1);
                    let undo = if chance.usize(..2) == 0 { &["--undo"][..] } else { &[] };
                    fleet.freeplay(&[&["store", "forget", "--flight", &flight], undo].concat());
                }
                _ => {
                    let silent = std::process::Stdio::null;
                    let mut run = fleet.command(&["run"]).stdout(silent()).stderr(silent()).spawn().unwrap();
                    if chance.usize(..3) > 0 {
                        std::thread::sleep(Duration::from_millis(20 * chance.usize(..20) as u64));
                        drop(run.kill());
                    }
                    run.wait().unwrap();
                }
            }
        }
        let once = source.copied();
        let version = chance.usize(..3);
        for fleet in [&fleet, &once] {
            std::fs::write(fleet.path(TABLE), table(version, &whole)).unwrap();
            fleet.logs().iter().for_each(|log| std::fs::remove_file(log).unwrap());
            for (log, content) in logs.iter().zip(&contents) {
                std::fs::copy(content, fleet.path(name(log).to_str().unwrap())).unwrap();
            }
            fleet.freeplay(&["store", "forget", "--tail", "N412FP", "--undo"]);
            fleet.run_ok(&["run", "-q"]);
            fleet.run_ok(&["store", "verify"]);
        }
        assert_eq!(fleet.exported(), once.exported(), "seed {seed}");
        assert_eq!(trend(&fleet), trend(&once), "seed {seed}");
        // Readers join another table before a run writes it.
        std::fs::write(fleet.path(TABLE), table((version + 1) % 3, &whole)).unwrap();
        let joined = fleet.exported();
        fleet.run_ok(&["run", "-q"]);
        assert_eq!(fleet.exported(), joined, "seed {seed}");
    }
}

/// A recorder sends a log again under the same name, first with its departure corrected and then with its tail: each time the
/// records of the same samples under the old identity go.
#[test]
fn a_log_sent_again_with_another_identity_is_one_flight() {
    let fleet = TestFleet::sample();
    let kept = fleet.logs_of("N413FP").remove(0);
    fleet.logs().iter().filter(|log| **log != kept).for_each(|log| std::fs::remove_file(log).unwrap());
    let source = fleet.path("source.parquet");
    std::fs::rename(&kept, &source).unwrap();
    let send = |facts: &[(String, String)]| {
        rewrite(&source, &kept, &facts.to_vec(), |_| true, |_| true);
        fleet.run_ok(&["run", "-q"]);
        let rows = fleet.rows(&["store", "export"]);
        let names = |row: &Value| ["tail_number", "departure_utc"].map(|name| row[name].clone());
        (rows.len(), rows.iter().map(names).collect::<Vec<_>>())
    };
    let (count, _) = send(&facts(&source));
    let later = "2026-11-02T10:00:00Z";
    for (key, value) in [("departure_utc", later), ("tail_number", "N414FP")] {
        let corrected = facts_with(&source, key, value);
        let (now, names) = send(&corrected);
        assert_eq!(now, count, "{key}: {names:?}");
        let column = usize::from(key == "departure_utc");
        assert!(
            names.iter().all(|row| row[column].as_str().is_some_and(|found| found.starts_with(&value[..6])))
        );
    }
}
