//! A log far wider than any fleet's: time stays in proportion to its size. Large tables and configurations are in
//! `tests/data/commands.md`.

use std::time::{Duration, Instant};

use crate::harness::{TestFleet, facts, write_log};

/// Thirty thousand columns of ten thousand positions, none of which is installed.
#[test]
fn a_log_of_ten_thousand_positions_costs_seconds() {
    let fleet = TestFleet::sample();
    let log = &fleet.logs()[0];
    let columns = (0..10_000).map(|k| (format!("p{k}_motor_deg"), vec![0.0, 1.0])).collect();
    write_log(log, columns, &facts(log));
    let begun = Instant::now();
    assert_eq!(fleet.freeplay(&["check", &log.display().to_string()]).code, Some(1));
    assert!(begun.elapsed() < Duration::from_secs(20), "{:?}", begun.elapsed());
}
