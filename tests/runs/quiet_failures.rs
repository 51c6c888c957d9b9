//! Ways for a run to fail without an error: each is injected, and must be reported by its code. Mistakes in files and
//! settings are in `tests/data/errors.md`, failing disks and logs that never end in `injected_faults`.

use crate::harness::{CommandResult, TestFleet, facts_with, print_line, rewrite};
use crate::runs::injected_faults::Injector;

const DAY_S: i64 = 86_400;

/// The first two flights of one tail.
fn tiny() -> TestFleet {
    let fleet = TestFleet::sample();
    let kept = &fleet.logs_of("N413FP")[..2];
    fleet.logs().iter().filter(|log| !kept.contains(log)).for_each(|log| std::fs::remove_file(log).unwrap());
    fleet
}

/// Copies the first log under another identity.
fn relabel(fleet: &TestFleet, name: &str, key: &str, value: &str) {
    let log = &fleet.logs()[0];
    rewrite(log, &log.with_file_name(name), &facts_with(log, key, value), |_| true, |_| true);
}

fn run(fleet: &TestFleet) -> CommandResult {
    fleet.freeplay(&["run", "--jobs", "1"])
}

/// A fault: what it is, how it is planted and met, the exit code, and the name under which it is reported.
type Way = (&'static str, fn(&TestFleet, &Injector) -> CommandResult, i32, &'static str);

const WAYS: &[Way] = &[
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
