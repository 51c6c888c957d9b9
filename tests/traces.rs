//! Numbers in traces of the program. Its texts are in `tests/data/commands.md` and `tests/data/logs.md`.

use crate::harness::{Table, TestFleet, rewrite};

/// Rows 3000 to 3399 are missing: the next sample of the trace has the time of the log, not that of its number.
#[test]
fn a_trace_has_the_log_s_own_times_after_a_break() {
    let fleet = TestFleet::sample();
    let log = &fleet.logs()[0];
    let own_s = Table::read(log).numbers("time_s");
    let broken = fleet.path("broken.parquet");
    let keep = |row: usize| !(3000..3400).contains(&row);
    rewrite(log, &broken, &crate::harness::facts(log), keep);
    let part = ["--part", "EMA-27-1040", "--trace", "trace.parquet"];
    fleet.run_ok(&[&["estimate", "broken.parquet"][..], &part].concat());
    let times_s = Table::read(&fleet.path("trace.parquet")).numbers("time_s");
    for (sample, row) in [(0, 0), (2999, 2999), (3000, 3400), (4000, 4400)] {
        let expected_s = own_s[row] - own_s[0];
        assert!(
            (times_s[sample] - expected_s).abs() < 1e-3,
            "{sample}: {} is not {expected_s}",
            times_s[sample]
        );
    }
}

#[test]
fn a_trace_holds_every_sample_the_filter_saw() {
    let fleet = TestFleet::of("flights");
    fleet.run_ok(&["estimate", "A_nominal.parquet", "--part", "A", "--trace", "trace.parquet"]);
    let trace = Table::read(&fleet.path("trace.parquet"));
    assert_eq!(trace.rows(), 37_495);
    assert!(trace.numbers("s_m").iter().all(|s| s.is_finite()));
    // The estimated position follows the measured one within its noise; the motor's speed adds up to its travel.
    let (dx_m, estimated_m) = (trace.numbers("dx_m"), trace.numbers("dx_estimated_m"));
    let squares = dx_m.iter().zip(&estimated_m).map(|(y, x)| (y - x).powi(2)).sum::<f64>();
    assert!((squares / 37_495.0).sqrt() < 5e-6, "{squares}");
    assert!(trace.numbers("dx_speed_estimated_m_per_s").iter().all(|v| v.abs() < 0.1));
    let (time_s, motor_m) = (trace.numbers("time_s"), trace.numbers("motor_m"));
    let speed = trace.numbers("motor_speed_m_per_s");
    let travel_m: f64 = (2..2000).map(|k| speed[k] * (time_s[k] - time_s[k - 1])).sum();
    assert!((travel_m - (motor_m[2000] - motor_m[1])).abs() < 2e-4, "{travel_m}");
    let flank = trace.numbers("flank");
    let pressed = |side: f64| flank.iter().filter(|f| **f * side > 0.0).count();
    assert!(pressed(1.0) > 10_000 && pressed(-1.0) > 10_000 && pressed(1.0) + pressed(-1.0) < flank.len());
}
