//! Ways for a run to fail without an error: each is injected, and must be reported by its code. Mistakes in files and
//! settings are in `tests/data/errors.md`.

use std::path::PathBuf;

use crate::harness::{CommandResult, TestFleet, copy, facts, print_line, rewrite};
use crate::runs::injected_faults::Injector;

const DAY_S: i64 = 86_400;

/// The first two flights of one tail.
fn tiny() -> TestFleet {
    let fleet = TestFleet::sample();
    for log in fleet.logs() {
        let name = log.file_name().unwrap().to_string_lossy().into_owned();
        if !(name.ends_with("N413FP-0001.parquet") || name.ends_with("N413FP-0002.parquet")) {
            std::fs::remove_file(log).unwrap();
        }
    }
    fleet
}

fn first(fleet: &TestFleet) -> PathBuf {
    fleet.logs()[0].clone()
}

/// Copies the first log under another identity.
fn relabel(fleet: &TestFleet, name: &str, key: &str, value: &str) {
    let log = first(fleet);
    let mut labels = facts(&log);
    labels.iter_mut().filter(|(known, _)| known == key).for_each(|(_, old)| value.clone_into(old));
    rewrite(&log, &log.with_file_name(name), &labels, |_| true, |_| true);
}

fn run(fleet: &TestFleet) -> CommandResult {
    fleet.freeplay(&["run", "--jobs", "1"])
}

/// A fault: what it is, how it is planted and met, the exit code, and the name under which it is reported.
type Way = (&'static str, fn(&TestFleet, &Injector) -> CommandResult, i32, &'static str);

const WAYS: &[Way] = &[
    (
        "a log cannot be listed",
        |f, _| {
            let link = first(f).with_file_name("loop.parquet");
            std::os::unix::fs::symlink("loop.parquet", link).unwrap();
            run(f)
        },
        1,
        "file_unreadable",
    ),
    (
        "a tail sends nothing while others do",
        |f, _| {
            copy(
                &crate::harness::top().join("tests/data/three-aircraft/sample-data/logs/N412FP"),
                &f.path("sample-data/logs/N412FP"),
            );
            let newest = f.logs().into_iter().rfind(|log| log.to_string_lossy().contains("N412FP")).unwrap();
            for log in
                f.logs().into_iter().filter(|log| log.to_string_lossy().contains("N412FP") && *log != newest)
            {
                std::fs::remove_file(log).unwrap();
            }
            let mut labels = facts(&newest);
            let departure = labels.iter_mut().find(|(key, _)| key == "departure_utc").unwrap();
            "2026-11-15T08:00:00Z".clone_into(&mut departure.1);
            rewrite(&newest, &newest.with_file_name("late.parquet"), &labels, |_| true, |_| true);
            std::fs::remove_file(newest).unwrap();
            run(f)
        },
        0,
        "N413FP since",
    ),
    (
        "a log is dated ahead",
        |f, _| {
            relabel(f, "ahead.parquet", "departure_utc", "2062-03-01T12:00:00Z");
            run(f)
        },
        1,
        "departure_ahead",
    ),
    (
        "the clock is ten years back",
        |f, injector| injector.with_clock(f, &["run", "--jobs", "1"], -3650 * DAY_S),
        1,
        "departure_ahead",
    ),
    (
        "the clock was ahead when the last run ended",
        |f, injector| {
            injector.with_clock(f, &["run", "--jobs", "1"], 3650 * DAY_S);
            f.freeplay(&["store", "info", "--max-age", "30h"])
        },
        1,
        "after this machine's clock",
    ),
    ("the disk is full", |f, injector| injector.full_disk(f), 3, "No space left on device"),
    ("another run holds the store", |f, injector| injector.beside_a_run_that_hangs(f), 3, "store_held"),
    (
        "the run before was killed",
        |f, injector| {
            injector.killed(f);
            run(f)
        },
        0,
        "did not finish",
    ),
    (
        "two logs hold one flight",
        |f, _| {
            let log = first(f);
            rewrite(&log, &log.with_file_name("other.parquet"), &facts(&log), |_| true, |row| row < 5000);
            run(f)
        },
        1,
        "duplicate_flight",
    ),
    (
        "an aircraft is not in the table",
        |f, _| {
            relabel(f, "new.parquet", "tail_number", "N999ZZ");
            run(f)
        },
        1,
        "tail_unknown",
    ),
    (
        "a load is scaled away",
        |f, _| {
            f.configure("unit = \"N\"", "unit = \"N\"\nscale = 1e-12");
            run(f)
        },
        1,
        "load_too_small",
    ),
    ("a log never ends", |f, injector| injector.hanging_log(f), 1, "log_timeout"),
];

#[test]
fn a_run_that_goes_quietly_wrong_is_noticed_by_name() {
    let Some(injector) = Injector::get() else { return };
    let mut missed = Vec::new();
    for (way, plant, code, name) in WAYS {
        let found = plant(&tiny(), injector);
        let text = format!("{}{}", found.out, found.err);
        if found.code != Some(*code) || !text.contains(name) {
            missed.push(format!("{way}: exit code {:?}, expected {code} and `{name}`\n{text}", found.code));
        }
    }
    print_line(&format!("{} ways planted, {} missed", WAYS.len(), missed.len()));
    assert!(missed.is_empty(), "{}", missed.join("\n\n"));
}
