//! Fuzz target of clocks.

use self::edits::number;
use crate::mapping::ClockMapping;
use crate::time::clock::{LOST, TimeOrigin, Timestamps, build_time_base};

#[path = "../../../../tests/fuzz/edits.rs"]
mod edits;

/// Bytes of one change to the stamps.
const EDIT: usize = 12;

/// Stamps of 50 Hz after the changes that the bytes describe, and a clock.
fn stamps_of(bytes: &[u8]) -> (Timestamps, ClockMapping) {
    let rows = 8 * usize::from(bytes.first().copied().unwrap_or_default()) + 1;
    let mut seconds: Vec<f64> = (0..rows).map(|row| row as f64 * 0.02).collect();
    let (mut origin, mut clock) = (TimeOrigin::Counted(0.0), ClockMapping::default());
    for edit in bytes.get(1..).unwrap_or_default().chunks_exact(EDIT) {
        let value = number(edit[3], edit[4..].try_into().unwrap());
        let first = rows * usize::from(edit[1]) / 256;
        let range = first..(first + usize::from(edit[2])).min(rows);
        match edit[0] % 16 {
            0..=2 => seconds[range].fill(value),
            3 => seconds[range].reverse(),
            4..=6 => seconds[first..].iter_mut().for_each(|s| *s += value),
            7 => seconds[range].iter_mut().for_each(|s| *s *= value),
            8 => seconds[range].iter_mut().for_each(|s| *s = s.floor()),
            9 => clock.rate_hz = Some(value),
            10 => clock.tick_s = Some(value),
            11 => clock.max_back_s = Some(value),
            12 => clock.split_at_jumps = edit[3] % 2 == 0,
            13 => origin = TimeOrigin::Counted(value),
            14 => clock.wraps_at = Some(value),
            _ => origin = TimeOrigin::Start,
        }
    }
    // A configuration with settings outside their ranges is refused before a clock is built.
    let within =
        |value: Option<f64>, least: f64, most: f64| value.filter(|value| (least..=most).contains(value));
    clock.rate_hz = within(clock.rate_hz, 1e-6, 1e6);
    clock.tick_s = within(clock.tick_s, 1e-9, 1e4);
    clock.max_back_s = within(clock.max_back_s, 1e-9, 1e9);
    (Timestamps { column: "t".into(), seconds, origin }, clock)
}

/// A clock has a positive step, and its rows and segments lie within the log, in order.
fn clock_of_any(bytes: &[u8]) {
    let (mut stamps, clock) = stamps_of(bytes);
    let rows = stamps.seconds.len();
    let Ok(base) = build_time_base(&mut stamps, &clock) else { return };
    assert!(base.step_s.is_finite() && base.step_s > 0.0, "step {}", base.step_s);
    let kept = base.kept.as_ref().map_or(rows, Vec::len);
    let lost = base.kept.iter().flatten().filter(|row| **row == LOST).count();
    assert!(kept - lost <= rows && lost <= rows);
    assert!(base.kept.iter().flatten().all(|row| (*row as usize) < rows || *row == LOST), "rows");
    let mut end = 0;
    for segment in &base.segments {
        assert!(end <= segment.start && segment.start <= segment.end && segment.end <= kept, "{segment:?}");
        end = segment.end;
    }
    assert_eq!(base.keep(stamps.seconds).len(), kept);
}

#[test]
fn fuzz_clock() {
    bolero::check!().with_iterations(1000).with_max_len(1 + 20 * EDIT).for_each(clock_of_any);
}
