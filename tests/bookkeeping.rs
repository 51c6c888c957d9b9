//! Corrected tables: what is stored stays, and every surface shows the correction at once, with or without the logs.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

use serde_json::Value;

use crate::gate::is_gate;
use crate::harness::{TestFleet, facts, rewrite, without};

const TABLE: &str = "sample-data/installations.csv";

/// The trend of every unit, by serial number.
fn trend(fleet: &TestFleet) -> BTreeMap<String, Value> {
    let rows = fleet.rows(&["trend"]);
    rows.into_iter().map(|row| (row["serial_number"].as_str().unwrap().to_owned(), row)).collect()
}

fn run(fleet: &TestFleet) -> Value {
    fleet.freeplay(&["run", "--json"]).json()
}

/// Number of exported records that hold a text.
fn records_with(fleet: &TestFleet, text: &str) -> usize {
    fleet.exported().lines().filter(|line| line.contains(text)).count()
}

/// A unit that was exchanged on 1 October is entered when the logs are in the archive.
#[test]
fn a_corrected_table_counts_without_the_logs_and_before_the_next_run() {
    let fleet = TestFleet::processed();
    fleet.configure("limit_m = 150e-6\nwatch_m = 110e-6", "limit_m = 60e-6");
    std::fs::rename(fleet.path("sample-data/logs/N414FP"), fleet.path("archive")).unwrap();
    let before = trend(&fleet)["1040-0013"].clone();
    assert_eq!(before["state"], "act", "{before}");
    fleet.edit(TABLE, |table| {
        table.replace(
            "N414FP,aileron_left,EMA-27-1040,1040-0013,2026-09-07T00:00:00Z,,2310.0,3744.0",
            "N414FP,aileron_left,EMA-27-1040,1040-0013,2026-09-07T00:00:00Z,2026-10-01T00:00:00Z,2310.0,3744.0\n\
             N414FP,aileron_left,EMA-27-1040,1040-0099,2026-10-01T00:00:00Z,,100.0,3760.0",
        )
    });
    // The gaps above the limit are those of the unit that the table names now, before any run.
    let now = trend(&fleet);
    assert_eq!((&now["1040-0099"]["state"], &now["1040-0013"]["state"]), (&"act".into(), &Value::Null));
    let flights = |row: &Value| row["flights"].as_i64().unwrap();
    assert_eq!(flights(&now["1040-0099"]) + flights(&now["1040-0013"]), flights(&before));
    let queried = fleet.run_ok(&["query", "serial", "1040-0099", "--format", "csv"]);
    assert_eq!(queried.lines().count() as i64, 1 + flights(&now["1040-0099"]));
    let summary = run(&fleet);
    let moved = &summary["moved"][0];
    assert_eq!(moved["from_serial_number"], "1040-0013");
    assert_eq!(
        (&moved["serial_number"], &moved["flights"]),
        (&"1040-0099".into(), &now["1040-0099"]["flights"])
    );
    let changed = summary["changed"].as_array().unwrap();
    let change = changed.iter().find(|change| change["serial_number"] == "1040-0099").unwrap();
    assert_eq!((&change["cause"], &change["to"]), (&"bookkeeping".into(), &"act".into()), "{change}");
    assert!(change["because"].as_str().unwrap().contains("N414FP aileron_left"), "{change}");
    // What other programs read is rewritten, once.
    assert_eq!(trend(&fleet), now);
    let files = fleet.run_ok(&["store", "files"]);
    assert!(run(&fleet)["moved"].as_array().unwrap().is_empty());
    assert_eq!(fleet.run_ok(&["store", "files"]), files);
    assert_eq!(fleet.freeplay(&["run", "--fail-on", "act"]).code, Some(4));
}

/// Departures are found before flight numbers, which fly every day again.
#[test]
fn a_flight_number_that_recurs_takes_the_hours_of_its_own_day() {
    let fleet = TestFleet::processed();
    let before = trend(&fleet)["1040-0005"].clone();
    let flights = fleet.run_ok(&["query", "tail", "N412FP", "--format", "csv"]);
    let header: Vec<&str> = flights.lines().next().unwrap().split(',').collect();
    let column = |name: &str| header.iter().position(|column| *column == name).unwrap();
    let cells = ["departure_utc", "flight_hours", "tail_hours_end"].map(column);
    let rows: std::collections::BTreeSet<String> = flights
        .lines()
        .skip(1)
        .map(|line| {
            let row: Vec<&str> = line.split(',').collect();
            format!("N412FP,FP100,{},{},{}\n", row[cells[0]], row[cells[1]], row[cells[2]])
        })
        .collect();
    assert_eq!(rows.len(), 10);
    let table = "tail_number,flight_id,departure_utc,flight_hours,tail_hours_end\n".to_owned();
    std::fs::write(fleet.path("flights.csv"), rows.iter().fold(table, |all, row| all + row)).unwrap();
    fleet.configure("[logs]\n", "[logs]\nflights = \"flights.csv\"\n");
    for log in fleet.logs_of("N412FP") {
        let mut identity = facts(&log);
        identity.retain(|(key, _)| key != "flight_hours" && key != "tail_hours_end");
        identity.iter_mut().filter(|(key, _)| key == "flight_id").for_each(|(_, id)| *id = "FP100".into());
        let new = log.with_extension("new");
        rewrite(&log, &new, &identity, |_| true, |_| true);
        std::fs::rename(&new, &log).unwrap();
    }
    std::fs::remove_dir_all(fleet.path("results")).unwrap();
    fleet.run_ok(&["run"]);
    let now = trend(&fleet)["1040-0005"].clone();
    for column in ["flights", "unit_hours", "gap_m", "state"] {
        assert_eq!(now[column], before[column], "{column}");
    }
    // One of them is named by its departure, and each is drawn from its own log.
    let refused = fleet.freeplay(&["explain", "FP100", "aileron_left"]);
    assert_eq!(refused.code, Some(2));
    assert!(refused.err.contains("10 flights") && refused.err.contains("--since"), "{}", refused.err);
    let second = ["--since", "2026-09-12", "--until", "2026-09-20"];
    let explained = fleet.run_ok(&[&["explain", "FP100", "aileron_left"][..], &second].concat());
    assert!(explained.contains("20260919T141840Z_N412FP-0002.parquet"), "{explained}");
    let normalized = fleet.run_ok(&["normalize", "--output", "normalized"]);
    assert!(normalized.contains("120 normalized logs"), "{normalized}");
    assert!(fleet.run_ok(&["diff", "results", "results"]).starts_with("0 of 120 "));
    fleet.run_ok(&["report", "--output", "report", "--serial", "1040-0005", "--diagnostics"]);
    assert_eq!(std::fs::read_dir(fleet.path("report/flight")).unwrap().count(), 3);
}

/// A flights table in local time, five hours behind UTC, is named; the logs' own departures stay.
#[test]
fn departures_in_another_zone_are_named() {
    let fleet = TestFleet::processed();
    let row = |log: PathBuf| {
        let facts: BTreeMap<String, String> = facts(&log).into_iter().collect();
        let departure: jiff::Timestamp = facts["departure_utc"].parse().unwrap();
        let local = (departure - jiff::SignedDuration::from_hours(5)).strftime("%Y-%m-%d %H:%M:%S");
        format!("{},{},{local}\n", facts["tail_number"], facts["flight_id"])
    };
    let rows: String = fleet.logs().into_iter().map(row).collect();
    std::fs::write(fleet.path("flights.csv"), format!("tail_number,flight_id,departure_utc\n{rows}"))
        .unwrap();
    fleet.configure("[logs]\n", "[logs]\nflights = \"flights.csv\"\n");
    let before = trend(&fleet);
    let notes = run(&fleet)["notes"].to_string();
    assert!(notes.contains("departures are -5 h from those of the logs"), "{notes}");
    assert_eq!(trend(&fleet), before);
}

/// A log is sent again for the one position that failed.
#[test]
fn of_two_logs_of_a_flight_the_better_record_counts_position_by_position() {
    let fleet = TestFleet::sample();
    let log = fleet.logs().swap_remove(0);
    let whole = log.with_file_name("z_whole.parquet");
    let before = TestFleet::processed().exported();
    std::fs::copy(&log, fleet.path("whole")).unwrap();
    rewrite(
        &fleet.path("whole"),
        &log,
        &facts(&log),
        |column| !column.starts_with("aileron_left_load"),
        |_| true,
    );
    fleet.freeplay(&["run"]);
    assert_eq!(records_with(&fleet, "channel_unmapped"), 1);
    std::fs::rename(fleet.path("whole"), &whole).unwrap();
    fleet.run_ok(&["run"]);
    let gaps = |text: &str| without(text, &["log_digest"]);
    assert_eq!(gaps(&fleet.exported()), gaps(&before));
    // Both logs new in one run: neither is an error, and each accounts for its own, whichever is read first. The larger
    // one is: that without a load in the second case, where the other one has the ailerons alone.
    let run_anew = || {
        std::fs::remove_dir_all(fleet.path("results")).unwrap();
        let summary = fleet.run_ok(&["run", "--jobs", "1"]);
        assert_eq!(gaps(&fleet.exported()), gaps(&before));
        assert!(
            summary.contains(&format!("  stored      {} records of 30 flights", before.lines().count() - 1)),
            "{summary}"
        );
        fleet.run_ok(&["store", "verify"]);
        assert!(fleet.run_ok(&["run"]).contains("0 new or changed"));
    };
    run_anew();
    let of_ailerons = |column: &str| column == "time_s" || column.starts_with("aileron");
    rewrite(&whole, &fleet.path("ailerons"), &facts(&whole), of_ailerons, |_| true);
    std::fs::rename(fleet.path("ailerons"), &whole).unwrap();
    run_anew();
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
