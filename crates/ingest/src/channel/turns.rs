//! Whole turns of a wrapped angle: from sample to sample by the shorter way, and after each hole by the actuator's other
//! position.
//!
//! A motor makes many turns while a recorder pauses, and its wrapped angle does not show how many. The screw position
//! does: motor and screw differ only by the gap and the wind-up under load, which are far less than a turn.

use std::ops::Range;

use crate::channel::stats::quantile;
use crate::time::clock::BREAK_STEPS;
use crate::time::zero_order_hold::median_sample_interval;

/// A step of more turns than this between two samples does not show which way the sensor turned.
const CLEAR_STEP: f64 = 0.35;
/// The other position decides where it lies within this share of a turn of a whole number of turns.
const CLEAR_SHARE: f64 = 0.25;
/// Samples on either side of a hole that are compared by their median.
const COMPARED: usize = 9;

/// Adds or takes turns so that no step exceeds half a turn; missing and infinite samples are passed over.
pub(crate) fn unwrap_turns(values: &mut [f64], turn: f64) {
    let (mut turns, mut before) = (0.0, f64::NAN);
    for value in values.iter_mut().filter(|v| v.is_finite()) {
        let raw = *value;
        if !f64::is_nan(before) {
            turns -= ((raw - before) / turn).round();
        }
        before = raw;
        *value = raw + turns * turn;
    }
}

/// Restores the turns that an unwrapped position lost in holes, breaks of the clock and steps of almost half a turn.
///
/// After each of them the position is moved by the whole number of turns that brings it closest to the other position.
/// Where no whole number does, the samples up to the next hole become missing (NaN). Returns how many became missing.
///
/// `turn_m` is one turn of the sensor, m at the screw; `load_n` winds the actuator up, and `segments` are the unbroken
/// stretches of the clock. NaN marks a missing sample.
pub(crate) fn restore_turns(
    position_m: &mut [f64],
    turn_m: f64,
    other_m: &[f64],
    load_n: &[f64],
    segments: &[Range<usize>],
) -> usize {
    let runs = continuous_runs(position_m, turn_m, other_m, segments);
    if runs.len() < 2 {
        return 0;
    }
    let load_n = held(load_n);
    let speed_m = speeds(other_m, segments);
    let [wind_up, delay] = lag_of_load_and_speed(position_m, other_m, [&load_n, &speed_m], &runs);
    let ahead = |position_m: &[f64], i: usize| {
        let load_n = if load_n[i].is_nan() { 0.0 } else { load_n[i] };
        let explained_m = wind_up * load_n + delay * speed_m[i];
        Some(position_m[i] - other_m[i] - explained_m).filter(|ahead| !ahead.is_nan())
    };
    let (mut recent, mut excluded) = (Vec::with_capacity(2 * COMPARED), 0);
    for run in runs {
        let mut first: Vec<f64> = run.clone().filter_map(|i| ahead(position_m, i)).take(COMPARED).collect();
        if let (Some(now), Some(before)) = (quantile(&mut first, 0.5), quantile(&mut recent.clone(), 0.5)) {
            let turns = (now - before) / turn_m;
            if (turns - turns.round()).abs() > CLEAR_SHARE {
                excluded += position_m[run.clone()].iter().filter(|v| !v.is_nan()).count();
                position_m[run].fill(f64::NAN);
                continue;
            }
            if turns.round() != 0.0 {
                position_m[run.clone()].iter_mut().for_each(|v| *v -= turns.round() * turn_m);
            }
        }
        let last: Vec<f64> = run.rev().filter_map(|i| ahead(position_m, i)).take(COMPARED).collect();
        recent.extend(last.into_iter().rev());
        recent.drain(..recent.len().saturating_sub(COMPARED));
    }
    excluded
}

/// Stretches without a hole or a break in which each step shows which way the sensor turned: it is short, and the other
/// position does not run away from it in two steps of one direction. (A single such step is an outlier of the other.)
fn continuous_runs(
    position_m: &[f64],
    turn_m: f64,
    other_m: &[f64],
    segments: &[Range<usize>],
) -> Vec<Range<usize>> {
    let longest = (BREAK_STEPS * median_sample_interval(position_m) as f64) as usize;
    let clear_m = CLEAR_STEP * turn_m;
    let mut runs: Vec<Range<usize>> = Vec::new();
    for segment in segments {
        let present: Vec<usize> = segment.clone().filter(|&i| !position_m[i].is_nan()).collect();
        let is_next = |k: usize| k > 0 && k < present.len() && present[k] - present[k - 1] <= longest;
        let ahead_m = |k: usize| position_m[present[k]] - other_m[present[k]];
        // From the sample before; NaN after a hole.
        let drift_m = |k: usize| if is_next(k) { ahead_m(k) - ahead_m(k - 1) } else { f64::NAN };
        let is_outlier = |here_m: f64, beside_m: f64| here_m * beside_m <= 0.0 || beside_m.abs() <= clear_m;
        let runs_away = |k: usize| {
            let (before_m, here_m, after_m) = (drift_m(k - 1), drift_m(k), drift_m(k + 1));
            here_m.abs() > clear_m && !(is_outlier(here_m, before_m) && is_outlier(here_m, after_m))
        };
        for (k, &i) in present.iter().enumerate() {
            let is_continuous =
                is_next(k) && (position_m[i] - position_m[present[k - 1]]).abs() <= clear_m && !runs_away(k);
            match runs.last_mut().filter(|_| is_continuous) {
                Some(run) => run.end = i + 1,
                None => runs.push(i..i + 1),
            }
        }
    }
    runs
}

/// The load, held until the next one comes.
fn held(load_n: &[f64]) -> Vec<f64> {
    let hold = |last: &mut f64, now: &f64| {
        *last = if now.is_nan() { *last } else { *now };
        Some(*last)
    };
    load_n.iter().scan(f64::NAN, hold).collect()
}

/// Motion of a position at each sample, m to the next one; 0 where it is not known.
fn speeds(position_m: &[f64], segments: &[Range<usize>]) -> Vec<f64> {
    let mut speed_m = vec![0.0; position_m.len()];
    for segment in segments {
        let at = |i: usize| if segment.contains(&i) { position_m[i] } else { f64::NAN };
        for i in segment.clone() {
            let (before, here, after) = (at(i.wrapping_sub(1)), at(i), at(i + 1));
            let steps = [0.5 * (after - before), after - here, here - before];
            speed_m[i] = steps.into_iter().find(|step| !step.is_nan()).unwrap_or(0.0);
        }
    }
    speed_m
}

/// How far the position runs ahead of the other one for a newton of load (wind-up) and for a sample of delay of the other
/// one: the least-squares slopes within the runs, each of which has an offset of its own (as its turns are not known yet).
fn lag_of_load_and_speed(
    position_m: &[f64],
    other_m: &[f64],
    [load_n, speed_m]: [&[f64]; 2],
    runs: &[Range<usize>],
) -> [f64; 2] {
    // Sums of products within the runs, of load and speed with each other and with the lead.
    let (mut ff, mut fv, mut vv, mut fa, mut va) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for run in runs.iter().filter(|run| run.len() > 2) {
        let rows = || {
            let row = |i: usize| [load_n[i], speed_m[i], position_m[i] - other_m[i]];
            (run.start + 1..run.end - 1).map(row).filter(|row| row.iter().all(|v| !v.is_nan()))
        };
        let count = rows().count() as f64;
        let means: [f64; 3] = std::array::from_fn(|k| rows().map(|row| row[k]).sum::<f64>() / count);
        for row in rows() {
            let [f, v, a] = std::array::from_fn(|k| row[k] - means[k]);
            (ff, fv, vv, fa, va) = (ff + f * f, fv + f * v, vv + v * v, fa + f * a, va + v * a);
        }
    }
    let determinant = ff * vv - fv * fv;
    if determinant > 1e-3 * ff * vv {
        return [(vv * fa - fv * va) / determinant, (ff * va - fv * fa) / determinant];
    }
    match (ff > 0.0, vv > 0.0) {
        (true, _) => [fa / ff, 0.0],
        (false, true) => [0.0, va / vv],
        (false, false) => [0.0; 2],
    }
}

#[cfg(test)]
#[expect(clippy::single_range_in_vec_init, reason = "one stretch is a list of one")]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// Wrapping loses only whole turns, and a resolver never moves half a turn in a sample.
        #[test]
        fn an_unwrapped_resolver_differs_from_the_truth_by_whole_turns(
            steps in proptest::collection::vec(-170.0_f64..170.0, 1..200), start in 0.0_f64..360.0,
        ) {
            let truth: Vec<f64> = steps.iter().scan(start, |x, s| { *x += s; Some(*x) }).collect();
            let mut values: Vec<f64> = truth.iter().map(|x| x.rem_euclid(360.0)).collect();
            unwrap_turns(&mut values, 360.0);
            let offset = values[0] - truth[0];
            prop_assert!((offset / 360.0 - (offset / 360.0).round()).abs() < 1e-9);
            for (v, t) in values.iter().zip(&truth) {
                prop_assert!((v - t - offset).abs() < 1e-7);
            }
        }
    }

    /// The other position jumps by 2 mm in the hole, as a sensor that was exchanged or reset: 0.4 turns of 5 mm.
    #[test]
    fn a_turn_that_the_other_position_leaves_open_is_missing() {
        let mut position = vec![0.001; 300];
        position[100..120].fill(f64::NAN);
        let other: Vec<f64> = (0..300).map(|k| if k < 110 { 0.001 } else { 0.003 }).collect();
        assert_eq!(restore_turns(&mut position, 0.005, &other, &[0.0; 300], &[0..300]), 180);
        assert!(position[120..].iter().all(|v| v.is_nan()) && position[..100].iter().all(|v| !v.is_nan()));
    }
}
