//! Cut short in the middle: what was finished is kept, and the next run ends where an uninterrupted one does.

use std::time::Duration;

use crate::bench::Bench;

/// Records seen in the store by a reader, or none while there is no store yet.
fn stored(bench: &Bench) -> usize {
    let ended = bench.freeplay(&["store", "export", "--format", "csv", "-q"]);
    if ended.code == Some(0) { ended.out.lines().count().saturating_sub(1) } else { 0 }
}

#[test]
fn a_killed_run_keeps_whole_flights_and_the_next_one_finishes() {
    let plain = Bench::sample();
    plain.well(&["run"]);
    let wanted = plain.exported();
    for pause_ms in [0, 60, 150, 300, 500, 700, 900] {
        let bench = Bench::sample();
        let mut child =
            bench.command(&["run", "--jobs", "1"]).stderr(std::process::Stdio::null()).spawn().unwrap();
        std::thread::sleep(Duration::from_millis(pause_ms));
        // On Unix this is SIGKILL: nothing in the process gets a last word.
        child.kill().unwrap();
        child.wait().unwrap();
        let kept = stored(&bench);
        assert_eq!(kept % 4, 0, "half a flight after {pause_ms} ms: {kept} records");
        println!("killed after {pause_ms} ms: {kept} of 120 records kept");
        bench.well(&["run"]);
        assert_eq!(bench.exported(), wanted, "after a kill at {pause_ms} ms");
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
