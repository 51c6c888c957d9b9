//! Inputs that would end a run, delete other files, or execute a program: the run names each, and processes all others.

mod corpus;
mod operations;

use std::process::Stdio;

use crate::harness::{CommandResult, TestFleet, facts, write_log};

/// The command under a limit of its address space, KiB. The GNU allocator otherwise reserves 64 MiB of it per thread.
fn limited(fleet: &TestFleet, args: &str, kib: u64) -> CommandResult {
    let script = format!("ulimit -v {kib} && exec \"$0\" {args}");
    let mut command = std::process::Command::new("sh");
    command.args(["-c", &script, env!("CARGO_BIN_EXE_freeplay")]).current_dir(fleet.path("."));
    command.env("MALLOC_ARENA_MAX", "2").env_remove("FREEPLAY_CONFIG");
    CommandResult::of(command.stdin(Stdio::null()))
}

/// Each hostile log twice, under names that sort before and after those of the thirty sound ones, under 1 GiB.
#[test]
fn a_night_with_hostile_logs_stores_all_sound_ones() {
    let sound = TestFleet::sample();
    sound.run_ok(&["run", "-q"]);
    let fleet = TestFleet::sample();
    for folder in ["000", "zzz"] {
        let folder = fleet.path(&format!("sample-data/logs/{folder}"));
        std::fs::create_dir(&folder).unwrap();
        for hostile in corpus::all() {
            std::fs::write(folder.join(format!("{}.parquet", hostile.name)), hostile.bytes).unwrap();
        }
    }
    for command in ["check -v --limit 100", "run -v --jobs 2"] {
        let result = limited(&fleet, command, 1 << 20);
        assert_eq!(result.code, Some(1), "{command}: {}", result.err);
        for hostile in corpus::all() {
            let code = format!("error[{}]", hostile.code);
            let is_named = result.err.contains(hostile.says) && result.err.contains(&code);
            assert!(is_named, "{} is not named: {}", hostile.name, result.err);
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
    for hostile in corpus::all() {
        std::fs::write(fleet.path("table.parquet"), hostile.bytes).unwrap();
        let result = limited(&fleet, "run", 1 << 20);
        assert_eq!(result.code, Some(2), "{}: {}", hostile.name, result.err);
        assert!(!result.err.contains("panic"), "{}: {}", hostile.name, result.err);
        // A footer is read in the same way, whatever it is of.
        let is_named = hostile.code != "not_parquet" || result.err.contains(hostile.says);
        assert!(is_named, "{}: {}", hostile.name, result.err);
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
        let result = limited(&fleet, "run", 1 << 20);
        assert!(result.code == Some(2) && result.err.contains(says), "{says}: {}", result.err);
        assert!(result.err.len() < 5000, "{says}: {} bytes", result.err.len());
    }
}

#[cfg(unix)]
#[test]
fn a_link_in_the_place_of_the_lock_is_refused_and_its_target_stays() {
    let fleet = TestFleet::sample();
    fleet.run_ok(&["run", "-q"]);
    let target = fleet.path("target");
    std::fs::write(&target, "years").unwrap();
    std::fs::remove_file(fleet.path("results/lock")).unwrap();
    std::os::unix::fs::symlink(&target, fleet.path("results/lock")).unwrap();
    assert_eq!(fleet.freeplay(&["run"]).code, Some(3));
    assert_eq!(std::fs::read_to_string(&target).unwrap(), "years");
}

/// Two logs of one flight, and a file of someone else where a normalized log would be.
#[test]
fn normalize_overwrites_nothing_but_its_own() {
    let fleet = TestFleet::sample();
    let (log, copy) = (fleet.logs()[0].clone(), fleet.path("copy.parquet"));
    std::fs::copy(&log, &copy).unwrap();
    let (log, copy) = (log.display().to_string(), copy.display().to_string());
    let both = fleet.freeplay(&["normalize", &log, &copy, "--output", "normalized"]);
    assert_eq!(both.code, Some(1), "{both:?}");
    assert!(
        both.err.contains("error[would_overwrite]") && both.out.contains("4 normalized logs"),
        "{both:?}"
    );
    fleet.run_ok(&["normalize", &log, "--output", "normalized"]);
    let written = fleet.glob("normalized/*/*/*");
    assert_eq!(written.len(), 4, "{written:?}");
    std::fs::write(&written[0], "years").unwrap();
    assert_eq!(fleet.freeplay(&["normalize", &log, "--output", "normalized"]).code, Some(1));
    assert_eq!(std::fs::read_to_string(&written[0]).unwrap(), "years");
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

/// A supplier's folder whose logs may be of one tail only; a key that comes later finds what was stored before.
#[test]
fn a_log_in_a_folder_of_other_tails_is_an_error_until_its_tail_is_allowed() {
    let fleet = TestFleet::sample();
    fleet.configure("[logs]", "[logs]\ntails = { \"*/N412FP/*0003*\" = [\"N41[34]FP\"] }");
    let failed = fleet.freeplay(&["run"]);
    assert_eq!(failed.code, Some(1), "{failed:?}");
    assert!(
        failed.err.contains("error[tail_not_allowed]") && failed.err.contains("N412FP"),
        "{}",
        failed.err
    );
    assert!(failed.out.contains("116 records of 29 flights"), "{}", failed.out);
    fleet.configure("N41[34]FP", "N41?FP");
    assert!(fleet.run_ok(&["run"]).contains("4 records of 1 flight"));
    fleet.configure("N41?FP", "N999*");
    let failed = fleet.freeplay(&["run"]);
    assert_eq!(failed.code, Some(1), "{failed:?}");
    assert!(failed.out.contains("4 stored records of logs that failed now stay"), "{}", failed.out);
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
