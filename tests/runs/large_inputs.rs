//! Tables and configurations far larger than any fleet's: memory and time stay in proportion to their size.

use std::fmt::Write as _;
use std::time::{Duration, Instant};

use crate::harness::TestFleet;

/// 120,000 installations took 240 MB when each cell, and each position's list, had memory of its own.
#[cfg(target_os = "linux")]
#[test]
fn an_installations_table_of_many_rows_takes_memory_in_proportion_to_its_text() {
    let fleet = TestFleet::sample();
    let table = fleet.path("sample-data/installations.csv");
    let mut text = std::fs::read_to_string(&table).unwrap();
    for row in 0..120_000 {
        let (tail, position) = (row / 8, row % 8);
        writeln!(text, "T{tail:06},pos_{position},EMA-27-1040,SN{row:08},2026-01-01T00:00:00Z,,12.5,77.0")
            .unwrap();
    }
    std::fs::write(&table, text).unwrap();
    let found = fleet.limited("-d 150000", &format!("check {}", fleet.logs()[0].display()));
    assert_eq!(found.code, Some(0), "{found:?}");
}

/// Ten thousand parts took 14 s when each diagnostic counted the lines above it, and 18 s when each fixed output was
/// a pattern that each part was compared with.
#[test]
fn a_configuration_of_many_parts_is_checked_in_proportion_to_its_length() {
    let fleet = TestFleet::sample();
    let file = fleet.path("pipeline.toml");
    let plain = std::fs::read_to_string(&file).unwrap();
    let (mut bare, mut fixed) = (plain.clone(), plain);
    for part in 0..10_000 {
        writeln!(bare, "[part.\"P{part}\"]").unwrap();
        writeln!(
            fixed,
            "[part.\"P{part}\"]\noutput = \"locked\"\nstiffness_n_per_m = 5e7\ndamping_n_s_per_m = 2e3\nscrew_mass_kg = 8.0\n\
             noise = {{ screw_rms_m = 3e-6, motor_rms_m = 1e-6, unknown_force_n = 2e2, bandwidth_hz = 10.0 }}"
        )
        .unwrap();
    }
    let log = fleet.logs()[0].to_str().unwrap().to_owned();
    for (text, code) in [(bare, 2), (fixed, 0)] {
        std::fs::write(&file, text).unwrap();
        let begun = Instant::now();
        let found = fleet.freeplay(&["check", &log]);
        assert_eq!(found.code, Some(code), "{found:?}");
        assert!(begun.elapsed() < Duration::from_secs(8), "{:?}", begun.elapsed());
    }
}
