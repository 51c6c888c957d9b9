//! Cut short in the middle: what was finished is kept, and the next run ends where an uninterrupted one does.

use std::time::Duration;

use crate::bench::{Bench, tell};

/// Records seen in the store by a reader, or none while there is no store yet.
fn stored(bench: &Bench) -> usize {
    let ended = bench.freeplay(&["store", "export", "--format", "csv", "-q"]);
    if ended.code == Some(0) { ended.out.lines().count().saturating_sub(1) } else { 0 }
}

/// When a run is killed.
#[derive(Debug, Clone, Copy)]
enum When {
    /// So long after its start: nothing may be there yet.
    After(Duration),
    /// As soon as so many commits of records stand in the log of the table.
    Committed(usize),
}

/// Kills a run; on Unix this is SIGKILL, and nothing in the process gets a last word.
fn kill(bench: &Bench, when: When) {
    let mut child =
        bench.command(&["run", "--jobs", "1"]).stderr(std::process::Stdio::null()).spawn().unwrap();
    match when {
        When::After(pause) => std::thread::sleep(pause),
        When::Committed(commits) => {
            let entry = bench.path(&format!("results/gaps/_delta_log/{commits:020}.json"));
            while !entry.exists() && child.try_wait().unwrap().is_none() {
                std::thread::sleep(Duration::from_millis(1));
            }
        }
    }
    child.kill().unwrap();
    child.wait().unwrap();
}

#[test]
fn a_killed_run_keeps_whole_flights_and_the_next_one_finishes() {
    let plain = Bench::sample();
    plain.well(&["run"]);
    let wanted = plain.exported();
    let pauses = [0, 60, 200, 500].map(|ms| When::After(Duration::from_millis(ms)));
    for when in pauses.into_iter().chain([1, 2].map(When::Committed)) {
        let bench = Bench::sample();
        kill(&bench, when);
        let kept = stored(&bench);
        tell(&format!("killed {when:?}: {kept} of 120 records kept"));
        assert_eq!(kept % 4, 0, "half a flight, {when:?}: {kept} records");
        assert!(matches!(when, When::After(_)) || kept > 0, "a finished flight is lost, {when:?}");
        bench.well(&["run"]);
        assert_eq!(bench.exported(), wanted, "killed {when:?}");
    }
}

/// A run that was asked to stop finishes the flights in hand and says so.
#[cfg(unix)]
#[test]
fn an_interrupted_run_says_130_and_the_next_one_does_the_rest() {
    let bench = Bench::sample();
    let child = bench.command(&["run", "--jobs", "1"]).stdout(std::process::Stdio::piped()).spawn().unwrap();
    std::thread::sleep(Duration::from_millis(250));
    let pid = child.id().to_string();
    std::process::Command::new("kill").args(["-INT", &pid]).status().unwrap();
    let output = child.wait_with_output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    match output.status.code() {
        // A fast machine may be done before the signal comes.
        Some(0) => assert!(!text.contains("not reached"), "{text}"),
        code => {
            assert_eq!(code, Some(130), "{text}");
            assert!(text.contains("not reached") || text.is_empty(), "{text}");
        }
    }
    bench.well(&["run"]);
    assert_eq!(stored(&bench), 120);
}
