//! File-system calls of a run that fail, are killed at, or never return: `tests/data/disk/faults.c`, preloaded.
//!
//! Every call of the process on a folder is counted, so that each can be tried. The gate tries a sample; all of them
//! are tried with `FREEPLAY_FAULTS=all`. `docs/reliability.md` has the figures.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::harness::{CommandResult, TestFleet, print_line};
use crate::runs::interruption::{small, whole_flights};

/// Numbers of `errno(3)`.
const EIO: &str = "5";
const ESTALE: &str = "116";

/// Calls that the gate tries of each kind of fault.
const SAMPLE: usize = 4;

/// The compiled injector, or why there is none.
pub(crate) struct Injector {
    _folder: tempfile::TempDir,
    library: PathBuf,
}

/// Where a fault strikes.
#[derive(Debug, Clone, Copy)]
struct Fault {
    /// Part of the paths whose calls count.
    under: &'static str,
    kind: &'static str,
    mode: &'static str,
    /// The first call that fails; nothing fails at 0.
    at: usize,
    /// The last one; 0 for all that follow.
    last: usize,
}

impl Injector {
    pub(crate) fn new() -> Option<Self> {
        let folder = tempfile::tempdir().unwrap();
        let library = folder.path().join("faults.so");
        let source = crate::harness::top().join("tests/data/disk/faults.c");
        let mut compile = Command::new("cc");
        compile.args(["-O1", "-shared", "-fPIC", "-o"]).arg(&library).arg(source).arg("-ldl");
        match compile.status() {
            Ok(status) if status.success() => Some(Self { _folder: folder, library }),
            _ => {
                print_line("skipped: no C compiler");
                None
            }
        }
    }

    fn command(&self, fleet: &TestFleet, args: &[&str], fault: &Fault) -> Command {
        let mut command = fleet.command(args);
        command.env("LD_PRELOAD", &self.library).env("FAULT_UNDER", fault.under);
        command.env("FAULT_KIND", fault.kind).env("FAULT_MODE", fault.mode);
        if fault.at > 0 {
            command.env("FAULT_AT", fault.at.to_string()).env("FAULT_LAST", fault.last.to_string());
        }
        command
    }

    fn run(&self, fleet: &TestFleet, args: &[&str], fault: &Fault) -> CommandResult {
        let output = self.command(fleet, args, fault).output().unwrap();
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        CommandResult { code: output.status.code(), out: text(output.stdout), err: text(output.stderr) }
    }

    /// A command under a clock that is ahead by `ahead_s` seconds.
    pub(crate) fn with_clock(&self, fleet: &TestFleet, args: &[&str], ahead_s: i64) -> CommandResult {
        let mut command = fleet.command(args);
        command.env("LD_PRELOAD", &self.library).env("CLOCK_OFFSET_S", ahead_s.to_string());
        let output = command.output().unwrap();
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        CommandResult { code: output.status.code(), out: text(output.stdout), err: text(output.stderr) }
    }

    /// A run whose writes to the store fail with `ENOSPC` from one on.
    pub(crate) fn full_disk(&self, fleet: &TestFleet) -> CommandResult {
        let count = self.count(fleet, &["run", "--jobs", "1", "--limit", "1"], "results", "write");
        std::fs::remove_dir_all(fleet.path("results")).unwrap();
        let fault = Fault { under: "results", kind: "write", mode: "28", at: count / 2, last: 0 };
        self.run(fleet, &["run", "--jobs", "1"], &fault)
    }

    /// A run that is killed in the middle of its writes.
    pub(crate) fn killed(&self, fleet: &TestFleet) {
        let count = self.count(fleet, &["run", "--jobs", "1"], "results", "write");
        std::fs::remove_dir_all(fleet.path("results")).unwrap();
        let fault = Fault { under: "results", kind: "write", mode: "kill", at: count * 3 / 4, last: 0 };
        assert_eq!(self.run(fleet, &["run", "--jobs", "1"], &fault).code, None);
    }

    /// A run in which the second log never ends, with a short time limit.
    pub(crate) fn hanging_log(&self, fleet: &TestFleet) -> CommandResult {
        let fault = self.hang(fleet);
        let config = std::fs::read_to_string(fleet.path("pipeline.toml")).unwrap();
        std::fs::write(fleet.path("pipeline.toml"), format!("{config}\n[run]\nlog_timeout_s = 2\n")).unwrap();
        self.run(fleet, &["run", "--jobs", "1"], &fault)
    }

    /// A run while another one hangs in its second log.
    pub(crate) fn beside_a_run_that_hangs(&self, fleet: &TestFleet) -> CommandResult {
        let fault = self.hang(fleet);
        let mut other = self.command(fleet, &["run", "--jobs", "1", "-q"], &fault);
        let mut other = other.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        while !fleet.path("results/runs/_delta_log/00000000000000000001.json").exists() {
            std::thread::sleep(Duration::from_millis(20));
        }
        let found = fleet.freeplay(&["run"]);
        other.kill().unwrap();
        other.wait().unwrap();
        found
    }

    /// A hang in the middle of the reads of the small tail's second flight.
    fn hang(&self, fleet: &TestFleet) -> Fault {
        let under = "N413FP-0002.parquet";
        let count = self.count(fleet, &["run", "--jobs", "1"], under, "read");
        std::fs::remove_dir_all(fleet.path("results")).unwrap();
        Fault { under, kind: "read", mode: "hang", at: count / 2, last: 0 }
    }

    /// How many calls a command makes.
    fn count(&self, fleet: &TestFleet, args: &[&str], under: &'static str, kind: &'static str) -> usize {
        let file = fleet.path("calls.txt");
        let fault = Fault { under, kind, mode: EIO, at: 0, last: 0 };
        let mut command = self.command(fleet, args, &fault);
        assert!(command.env("FAULT_COUNT", &file).stdout(Stdio::null()).status().unwrap().success());
        std::fs::read_to_string(file).unwrap().parse().unwrap()
    }
}

/// The calls to test: all, or the number of the gate, spread evenly.
fn calls(count: usize) -> Vec<usize> {
    let step = if std::env::var("FREEPLAY_FAULTS").is_ok_and(|which| which == "all") {
        1
    } else {
        count.div_ceil(SAMPLE).max(1)
    };
    (1..=count).step_by(step).collect()
}

/// The logs that the small fleet's configuration names.
fn logs_of(fleet: &TestFleet) -> Vec<PathBuf> {
    fleet.logs().into_iter().filter(|log| log.to_string_lossy().contains("N413FP")).collect()
}

/// The small fleet with a run behind it and two logs that are new.
fn grown() -> TestFleet {
    let fleet = small();
    let kept: Vec<(PathBuf, Vec<u8>)> =
        logs_of(&fleet).into_iter().take(2).map(|log| (log.clone(), std::fs::read(log).unwrap())).collect();
    kept.iter().for_each(|(log, _)| std::fs::remove_file(log).unwrap());
    fleet.run_ok(&["run", "-q"]);
    kept.iter().for_each(|(log, bytes)| std::fs::write(log, bytes).unwrap());
    fleet
}

/// Runs with a fault at each call, and then without: the second run must end with every record, and the first must
/// have reported an error if it lacks one.
fn survives(
    make: fn() -> TestFleet,
    under: &'static str,
    kind: &'static str,
    mode: &'static str,
    from: bool,
) {
    const RUN: &[&str] = &["run", "--jobs", "1"];
    let Some(injector) = Injector::new() else { return };
    let plain = small();
    plain.run_ok(&["run"]);
    let wanted = plain.exported();
    let count = injector.count(&make(), RUN, under, kind);
    let mut outcomes: BTreeMap<Option<i32>, usize> = BTreeMap::new();
    let tried = calls(count);
    for &at in &tried {
        let fleet = make();
        let fault = Fault { under, kind, mode, at, last: if from { 0 } else { at } };
        let struck = injector.run(&fleet, RUN, &fault);
        *outcomes.entry(struck.code).or_default() += 1;
        assert!(matches!(struck.code, None | Some(0..=3)), "{fault:?}: {struck:?}");
        if struck.code == Some(0) {
            assert_eq!(fleet.exported(), wanted, "{fault:?} was not reported: {struck:?}");
        }
        // A log of which one actuator cannot be read keeps the records of the others, and is an error.
        if under == "results" {
            whole_flights(&fleet);
        }
        let healed = fleet.freeplay(RUN);
        assert_eq!(healed.code, Some(0), "the run after {fault:?}: {healed:?}; it followed {struck:?}");
        assert_eq!(fleet.exported(), wanted, "the run after {fault:?}");
    }
    print_line(&format!(
        "{mode} at {} of {count} calls ({kind}, {under}, from then on: {from}): exit codes {outcomes:?}, 0 rows lost",
        tried.len()
    ));
    assert!(count > SAMPLE, "{count} calls were seen");
}

#[test]
fn a_log_read_that_fails_once_loses_no_flight() {
    survives(small, "sample-data/logs", "read", EIO, false);
    survives(small, "sample-data/logs", "read", ESTALE, false);
}

#[test]
fn a_log_folder_that_fails_from_some_call_on_is_reported_and_heals() {
    survives(small, "sample-data/logs", "read", EIO, true);
}

#[test]
fn a_store_call_that_fails_in_a_new_store_loses_nothing() {
    survives(small, "results", "write", EIO, false);
    survives(small, "results", "read", EIO, false);
}

#[test]
fn a_store_call_that_fails_in_a_grown_store_loses_nothing() {
    survives(grown, "results", "write", EIO, false);
    survives(grown, "results", "read", ESTALE, false);
}

#[test]
fn a_kill_at_any_call_loses_nothing() {
    survives(small, "results", "write", "kill", false);
    survives(grown, "results", "write", "kill", false);
}

#[test]
fn a_log_that_never_ends_is_an_error_of_that_log_and_the_rest_is_stored() {
    let Some(injector) = Injector::new() else { return };
    let plain = small();
    plain.run_ok(&["run"]);
    let wanted = plain.exported();
    for jobs in ["1", "2"] {
        let fleet = small();
        let logs = logs_of(&fleet).len();
        let fault = injector.hang(&fleet);
        let config = std::fs::read_to_string(fleet.path("pipeline.toml")).unwrap();
        std::fs::write(fleet.path("pipeline.toml"), format!("{config}\n[run]\nlog_timeout_s = 5\n")).unwrap();
        let began = Instant::now();
        let struck = injector.run(&fleet, &["run", "--jobs", jobs], &fault);
        assert!(began.elapsed() < Duration::from_mins(1), "{:?}", began.elapsed());
        assert_eq!(struck.code, Some(1), "{struck:?}");
        assert!(struck.err.contains("log_timeout") && struck.err.contains(fault.under), "{struck:?}");
        let stored = fleet.exported().lines().count() - 1;
        assert_eq!(stored, (logs - 1) * 4, "{struck:?}");
        // The cause may have passed: no `--retry` is needed.
        fleet.run_ok(&["run"]);
        assert_eq!(fleet.exported(), wanted);
    }
}

#[test]
fn a_run_with_a_log_that_never_ends_answers_a_signal() {
    let Some(injector) = Injector::new() else { return };
    let fleet = small();
    let fault = injector.hang(&fleet);
    let mut child =
        injector.command(&fleet, &["run", "--jobs", "1"], &fault).stdout(Stdio::null()).spawn().unwrap();
    std::thread::sleep(Duration::from_secs(3));
    let began = Instant::now();
    Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap();
    let code = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break status.code();
        }
        if began.elapsed() > Duration::from_secs(20) {
            child.kill().unwrap();
            panic!("no answer to SIGTERM in 20 s");
        }
        std::thread::sleep(Duration::from_millis(50));
    };
    assert_eq!(code, Some(130));
    fleet.run_ok(&["run"]);
}
