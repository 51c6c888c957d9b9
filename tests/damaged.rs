//! Logs that cannot be used become a reason; everything else is stored.

use crate::bench::Bench;

/// Cut short, empty, no Parquet, a flipped byte in a page, a stranger's tail: five logs, five codes.
fn spoil(bench: &Bench) {
    let logs = bench.logs();
    let bytes = std::fs::read(&logs[0]).unwrap();
    std::fs::write(&logs[0], &bytes[..bytes.len() / 2]).unwrap();
    std::fs::write(&logs[1], b"").unwrap();
    std::fs::write(&logs[2], b"tail,flight\nN412FP,1\n").unwrap();
    let table = bench.path("sample-data/installations.csv");
    let text = std::fs::read_to_string(&table).unwrap();
    let kept: Vec<&str> = text.lines().filter(|line| !line.starts_with("N414FP,elevator_left")).collect();
    std::fs::write(&table, kept.join("\n")).unwrap();
}

#[test]
fn broken_logs_are_named_and_the_others_stored() {
    let bench = Bench::sample();
    spoil(&bench);
    let ended = bench.freeplay(&["run"]);
    assert_eq!(ended.code, Some(1), "{ended:?}");
    for code in ["not_parquet", "empty_log", "unit_unknown"] {
        assert!(ended.err.contains(&format!("error[{code}]")), "{code} is not in {}", ended.err);
    }
    assert!(ended.out.contains("98 records of 27 flights"), "{}", ended.out);
    assert!(ended.out.contains("13 logs; everything else is stored"), "{}", ended.out);
    assert!(ended.out.contains("freeplay run --retry"), "{}", ended.out);
}

#[test]
fn an_error_is_not_tried_again_until_asked_or_mended() {
    let bench = Bench::sample();
    spoil(&bench);
    bench.freeplay(&["run"]);
    let again = bench.freeplay(&["run"]);
    assert_eq!(again.code, Some(0), "nothing new, nothing wrong: {again:?}");
    let retried = bench.freeplay(&["run", "--retry"]);
    assert_eq!(retried.code, Some(1), "{retried:?}");
    let sound = Bench::sample();
    for (mended, whole) in bench.logs().iter().zip(sound.logs()).take(3) {
        std::fs::copy(whole, mended).unwrap();
    }
    std::fs::copy(sound.path("sample-data/installations.csv"), bench.path("sample-data/installations.csv"))
        .unwrap();
    assert_eq!(bench.freeplay(&["run"]).code, Some(0));
    sound.well(&["run"]);
    assert_eq!(bench.exported(), sound.exported());
}

#[test]
fn check_and_estimate_say_what_is_wrong_with_code_1() {
    let bench = Bench::sample();
    spoil(&bench);
    let log = bench.logs()[0].display().to_string();
    for command in ["check", "estimate"] {
        let ended = bench.freeplay(&[command, &log]);
        assert_eq!(ended.code, Some(1), "{ended:?}");
        assert!(ended.err.contains("error[not_parquet]"), "{}", ended.err);
        assert!(ended.err.contains("hint:"), "{}", ended.err);
    }
}

#[test]
fn a_log_that_lacks_a_mapped_column_names_it() {
    let bench = Bench::sample();
    bench.configure("column = \"time_s\"", "column = \"time\"");
    let log = bench.logs()[0].display().to_string();
    let ended = bench.freeplay(&["check", &log]);
    assert_eq!(ended.code, Some(1));
    assert!(ended.err.contains("error[column_missing]"), "{}", ended.err);
    assert!(ended.err.contains("`time_s`?"), "{}", ended.err);
}
