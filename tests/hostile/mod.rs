//! Inputs that would end a run, delete other files, or execute a program: the run names each, and processes all others.

use crate::harness::{TestFleet, copy, facts, top, write_log};

/// The files of `tests/data/hostile`: name, code of the error, and a part of its text.
const HOSTILE: [[&str; 3]; 15] = [
    ["brotli", "decode_failed", "8006 bytes"],
    ["children", "not_parquet", "claims"],
    ["dictionary_texts", "decode_failed", "2147483647 values"],
    ["dictionary_values", "decode_failed", "2147483647 values"],
    ["field_zero", "not_parquet", "an offset below zero"],
    ["group_rows", "not_parquet", "claim 7 rows"],
    ["gzip", "decode_failed", "8006 bytes"],
    ["long_text", "decode_failed", "a text of 250000 bytes"],
    ["lz4", "decode_failed", "8006 bytes"],
    ["nested", "beyond_limit", "groups inside each other"],
    ["null_runs", "beyond_limit", "`run.max_rows`"],
    ["page_bytes", "decode_failed", "claims 2147483647 bytes"],
    ["page_rows", "decode_failed", "1000 values where 100000 are declared"],
    ["row_groups", "not_parquet", "claims"],
    ["schema_elements", "not_parquet", "claims"],
];

/// A limit of 1 GiB of address space.
const LIMIT: &str = "-v 1048576";

/// Each hostile log twice, under names that sort before and after those of the thirty sound ones, under 1 GiB.
#[test]
fn a_night_with_hostile_logs_stores_all_sound_ones() {
    let sound = TestFleet::sample();
    sound.run_ok(&["run", "-q"]);
    let fleet = TestFleet::sample();
    for folder in ["000", "zzz"] {
        copy(&top().join("tests/data/hostile"), &fleet.path(&format!("sample-data/logs/{folder}")));
    }
    for command in ["check -v --limit 100", "run -v --jobs 2"] {
        let result = fleet.limited(LIMIT, command);
        assert_eq!(result.code, Some(1), "{command}: {}", result.err);
        for [name, code, says] in HOSTILE {
            let is_named = result.err.contains(says) && result.err.contains(&format!("error[{code}]"));
            assert!(is_named, "{name} is not named: {}", result.err);
        }
        assert!(!result.err.contains("panicked"), "{}", result.err);
    }
    assert_eq!(fleet.exported(), sound.exported());
}

/// The same files as the installations table.
#[test]
fn hostile_tables_are_refused_with_code_2() {
    let fleet = TestFleet::sample();
    fleet.configure("sample-data/installations.csv", "table.parquet");
    for [name, code, says] in HOSTILE {
        let file = top().join(format!("tests/data/hostile/{name}.parquet"));
        std::fs::copy(file, fleet.path("table.parquet")).unwrap();
        let result = fleet.limited(LIMIT, "run");
        assert_eq!(result.code, Some(2), "{name}: {}", result.err);
        assert!(!result.err.contains("panic"), "{name}: {}", result.err);
        // A footer is read in the same way, whatever it is of.
        assert!(code != "not_parquet" || result.err.contains(says), "{name}: {}", result.err);
    }
    // CSV: columns, rows and names beyond what any table has, each with a short answer.
    let sound = fleet.read("sample-data/installations.csv");
    let columns: Vec<String> = (0..200_000).map(|k| format!("c{k}")).collect();
    let name = "p".repeat(1_000_000);
    fleet.configure("table.parquet", "table.csv");
    for (text, says) in [
        (columns.join(",") + "," + &sound, "claims 200008 columns"),
        (sound.clone() + &"N412FP,x,y,z,no date,,,\n".repeat(300_000), "299997 more"),
        (format!("{sound}N412FP,{name},EMA-27-1040,1,2026-01-01,,,\n"), "a position of 1000000 bytes"),
    ] {
        std::fs::write(fleet.path("table.csv"), text).unwrap();
        let result = fleet.limited(LIMIT, "run");
        assert!(result.code == Some(2) && result.err.contains(says), "{says}: {}", result.err);
        assert!(result.err.len() < 5000, "{says}: {} bytes", result.err.len());
    }
}

/// A log of the same flight whose name sorts first arrives for a later run.
#[test]
fn a_stored_flight_is_not_displaced_by_a_later_claim() {
    let fleet = TestFleet::sample();
    let logs = fleet.logs();
    fleet.run_ok(&["run", "-q"]);
    let before = fleet.exported();
    let rival = logs[3].with_file_name("0_rival.parquet");
    let claimed = facts(&logs[3]);
    crate::harness::rewrite(&logs[4], &rival, &claimed, |_| true, |_| true);
    let result = fleet.freeplay(&["run"]);
    assert_eq!(result.code, Some(1), "{result:?}");
    let owner = logs[3].file_name().unwrap().to_str().unwrap();
    assert!(result.err.contains("0_rival.parquet") && result.err.contains(owner), "{}", result.err);
    assert_eq!(fleet.exported(), before);
    let redone = fleet.freeplay(&["run", "--redo"]);
    assert_eq!(redone.code, Some(1), "{redone:?}");
    assert_eq!(fleet.exported(), before);
}

/// A pipe, folders that hold links to each other, and two names that differ in bytes that are no text, among the logs.
#[cfg(unix)]
#[test]
fn pipes_and_loops_are_named_and_the_logs_are_stored() {
    let fleet = TestFleet::sample();
    let folder = fleet.path("sample-data/logs");
    for link in ["loop", "loop2"] {
        std::os::unix::fs::symlink("..", folder.join("N412FP").join(link)).unwrap();
        std::os::unix::fs::symlink("..", folder.join("N413FP").join(link)).unwrap();
    }
    let pipe = folder.join("pipe.parquet");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    // Other systems refuse such names.
    for (log, byte) in fleet.logs().iter().zip([0xfe, 0xff_u8]).filter(|_| cfg!(target_os = "linux")) {
        let name = <std::ffi::OsStr as std::os::unix::ffi::OsStrExt>::from_bytes(&[byte]).to_owned();
        std::fs::rename(log, log.with_file_name(name).with_extension("parquet")).unwrap();
    }
    let result = fleet.freeplay(&["run"]);
    assert_eq!(result.code, Some(1), "{result:?}");
    assert!(result.out.contains("120 records of 30 flights"), "{}", result.out);
    for named in ["pipe.parquet", "N412FP/loop", "leads back"] {
        assert!(result.err.contains(named), "{named}: {}", result.err);
    }
}

/// Thirty thousand columns of ten thousand positions, none of which is installed.
#[test]
fn a_log_of_ten_thousand_positions_costs_seconds() {
    let fleet = TestFleet::sample();
    let log = &fleet.logs()[0];
    let columns = (0..10_000).map(|k| (format!("p{k}_motor_deg"), vec![0.0, 1.0])).collect();
    write_log(log, columns, &facts(log));
    let begun = std::time::Instant::now();
    assert_eq!(fleet.freeplay(&["check", &log.display().to_string()]).code, Some(1));
    assert!(begun.elapsed() < std::time::Duration::from_secs(20), "{:?}", begun.elapsed());
}
