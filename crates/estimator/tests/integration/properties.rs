//! Properties for any input: offset, scale, sign, restarts, missing samples, the configured bandwidth.

use estimator::{ActuatorModel, Error, Filter, FilterStep, GainSchedule, gap};
use proptest::collection::vec;
use proptest::prelude::*;

use crate::{batch, filter, samples_of, sensor_noise, track};

/// Equations 24 to 28 taken one sample at a time, from the first measured position on.
fn single_steps<'a>(
    filter: &'a Filter,
    dx_m: &'a [f64],
    load_n: &'a [f64],
) -> impl Iterator<Item = FilterStep> + 'a {
    let first = dx_m.iter().position(|y| !y.is_nan()).unwrap();
    let mut prior = filter.initial_state(dx_m[first], load_n[first]);
    dx_m.iter().zip(load_n).map(move |(y_m, load_n)| {
        let step = filter.update(&prior, *y_m).unwrap();
        prior = filter.predict(&step.posterior, *load_n);
        step
    })
}

/// The slowest pole of the steady-state filter is within a tenth of the configured bandwidth at the rates of real logs.
#[test]
fn the_configured_bandwidth_is_reached() {
    for rate_hz in [100.0, 250.0, 1000.0] {
        let got = filter(rate_hz, 10.0).bandwidth_hz().unwrap();
        assert!((got / 10.0 - 1.0).abs() < 0.1, "{got} Hz at {rate_hz} Hz");
    }
}

/// By hand: S = 0 and 1 µm, thrice and once, so ΔS is their difference.
#[test]
fn the_statistic_is_the_difference_of_two_means() {
    let found = gap::mid_range(&[0.0, 1e-6, 0.0, f64::NAN, 0.0]).unwrap();
    assert!((found.gap_m - 1e-6).abs() < 1e-20);
    assert_eq!((found.upper, found.lower), (1, 3));
    assert_eq!(gap::mid_range(&[2.0; 3]), Err(Error::Constant { samples: 3, s_m: 2.0 }));
    assert_eq!(gap::mid_range(&[f64::NAN]), Err(Error::NothingMeasured));
}

/// Equations 11 and 12 by hand: K/m = 5·10⁷/8 = 6.25·10⁶ 1/s², f/m = 2000/8 = 250 1/s, 1/m = 0.125 1/kg.
#[test]
fn the_continuous_model_is_that_of_equations_11_and_12() {
    let actuator = ActuatorModel::linear(5e7, 2000.0, 8.0).unwrap();
    let expected = [[0.0, 1.0, 0.0], [-6.25e6, -250.0, 6.25e6], [0.0, 0.0, 0.0]];
    let (a, b) = (actuator.a(), actuator.b());
    for (row, expected) in expected.iter().enumerate() {
        for (column, expected) in expected.iter().enumerate() {
            assert!((a[(row, column)] - expected).abs() < 1e-6, "A[{row},{column}] = {}", a[(row, column)]);
        }
    }
    assert!(b[0] == 0.0 && (b[1] - 0.125).abs() < 1e-15 && b[2] == 0.0, "{b}");
}

/// A part that only turns is the linear one seen at its radius: 2·10⁴ N·m/rad at 0.1 m is 2·10⁶ N/m.
#[test]
fn a_rotary_part_is_a_linear_one_at_its_radius() {
    let (turning, pushing) = (
        ActuatorModel::rotary(2e4, 1.5, 0.02, 0.1).unwrap(),
        ActuatorModel::linear(2e6, 150.0, 2.0).unwrap(),
    );
    assert!((turning.a() - pushing.a()).amax() < 1e-9 * pushing.a().amax());
    assert!((turning.b() - pushing.b()).amax() < 1e-12);
    assert!((turning.stiffness_n_per_m() - 2e6).abs() < 1e-6);
    assert!(ActuatorModel::rotary(2e4, 1.5, 0.02, 0.0).is_err());
}

/// First stamps of −1e50 s, steps of 1e50 s, stiffnesses of 5e77 N/m and masses of 5e−324 kg once kept the eigenvalue
/// iteration from ending. Such settings are refused before; a filter must end on them all the same.
#[test]
fn no_settings_keep_a_filter_from_ending() {
    let (done, ended) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        for step_s in [0.004, 1e50, 1e-300] {
            for (stiffness, mass) in [(5e77, 8.0), (5e7, 5e-324), (5e77, 5e-324), (5e7, 8.0)] {
                let Ok(actuator) = ActuatorModel::linear(stiffness, 2000.0, mass) else { continue };
                let noise = sensor_noise(10.0);
                if let Ok(filter) = Filter::new(&actuator, step_s, &noise) {
                    let _ = GainSchedule::new(&filter).bandwidth_hz();
                }
            }
        }
        done.send(()).unwrap();
    });
    assert!(ended.recv_timeout(std::time::Duration::from_mins(2)).is_ok(), "a filter did not end");
}

/// A hardly damped part whose own frequency is near a multiple of the sample rate: each sample shows it at the same
/// phase. P repeats to the last bit after a while, so what holds until then holds for any number of steps.
#[test]
fn a_part_that_rings_at_a_multiple_of_the_rate_keeps_a_covariance() {
    const STEPS: usize = 60_000;
    let (step_s, mass) = (0.004, 8.0);
    for multiple in [0.5, 1.0, 2.0, 3.0] {
        for off in [0.0, 1e-9, 1e-6, 1e-3] {
            for damping in [0.0, 1e-8, 1e-5, 1e-2] {
                let omega = std::f64::consts::TAU * multiple / step_s * (1.0 + off);
                let actuator =
                    ActuatorModel::linear(mass * omega * omega, 2.0 * damping * mass * omega, mass);
                let Ok(actuator) = actuator else { continue };
                let Ok(filter) = Filter::new(&actuator, step_s, &sensor_noise(10.0)) else { continue };
                let case = format!("{multiple} of the rate, off by {off}, damping ratio {damping}");
                let mut state = filter.initial_state(0.0, 0.0);
                for k in 0..STEPS {
                    let step = filter.update(&state, 1e-5 * f64::from(k as u32 % 7)).unwrap();
                    for p in [step.prior.p, step.posterior.p] {
                        assert!((0..3).all(|i| p[(i, i)] >= 0.0), "{case}: P is {p} in step {k}");
                    }
                    let next = filter.predict(&step.posterior, 0.0);
                    assert!(next.x.amax() < 1e3, "{case}: x is {} in step {k}", next.x);
                    let is_settled = next.p == state.p;
                    state = next;
                    if is_settled {
                        break;
                    }
                }
            }
        }
    }
}

proptest! {
    /// A log is filtered with the settled gain: each innovation, its variance and S are those of equations 24 to 28
    /// taken one sample at a time, in segments, and after samples that are missing.
    #[test]
    fn the_innovations_are_those_of_single_steps(
        dx in vec(-1e-4..1e-4, 4000), load in vec(-8e3..8e3, 4000),
        (cut, missing) in (1500..2500_usize, vec(0..4000_usize, 0..4)),
    ) {
        let f = filter(250.0, 10.0);
        let mut dx = dx;
        missing.iter().filter(|&&k| k != 0 && k != cut).for_each(|&k| dx[k] = f64::NAN);
        let segments = [0..cut, cut..dx.len()];
        let mut found = Vec::new();
        let samples = samples_of(&dx, &load, &segments);
        GainSchedule::new(&f).for_each_step(&samples, |k, step| found.push((k, *step))).unwrap();
        let mut found = found.into_iter();
        for segment in segments {
            let steps = single_steps(&f, &dx[segment.clone()], &load[segment.clone()]);
            for (k, step) in segment.zip(steps) {
                let (at, found) = found.next().unwrap();
                prop_assert_eq!(at, k);
                prop_assert!((found.s_m() - step.posterior.x[2]).abs() < 1e-11, "S in row {}", k);
                prop_assert_eq!(found.innovation_m.is_nan(), dx[k].is_nan(), "row {}", k);
                let off_m = (found.innovation_m - step.innovation_m).abs();
                prop_assert!(dx[k].is_nan() || off_m < 1e-11, "innovation in row {}: {:e}", k, off_m);
                let ratio = found.innovation_variance_m2 / step.innovation_variance_m2;
                prop_assert!((ratio - 1.0).abs() < 1e-6, "variance in row {}: {}", k, ratio);
            }
        }
    }

    /// Superposition: the track of two sums is the sum of two tracks.
    #[test]
    fn the_track_is_linear_in_position_and_load_together(
        one in vec((-1e-4..1e-4, -8e3..8e3), 200), other in vec((-1e-4..1e-4, -8e3..8e3), 200), scale in -3.0..3.0,
    ) {
        let f = filter(250.0, 10.0);
        let track_of = |pairs: &[(f64, f64)]| {
            let (dx, load): (Vec<f64>, Vec<f64>) = pairs.iter().copied().unzip();
            batch(&f, &dx, &load)
        };
        let sum: Vec<(f64, f64)> =
            one.iter().zip(&other).map(|(a, b): (&(f64, f64), &(f64, f64))| (a.0 + scale * b.0, a.1 + scale * b.1)).collect();
        let (one, other, sum) = (track_of(&one), track_of(&other), track_of(&sum));
        for k in 0..sum.len() {
            prop_assert!(f64::abs(one[k] + scale * other[k] - sum[k]) < 1e-12, "row {}", k);
        }
    }

    /// δX₀ (eq 3) and the origin of time are unknown: an offset of the position moves S by itself, and samples before
    /// a break move nothing.
    #[test]
    fn the_track_is_invariant_to_shifts_of_position_and_time(
        dx in vec(-1e-4..1e-4, 50..200), load in vec(-8e3..8e3, 200), offset_m in -1e-3..1e-3, later in 1..500_usize,
    ) {
        let f = filter(250.0, 10.0);
        let load = &load[..dx.len()];
        let plain = batch(&f, &dx, load);
        let moved: Vec<f64> = dx.iter().map(|x| x + offset_m).collect();
        for (moved, plain) in batch(&f, &moved, load).iter().zip(&plain) {
            prop_assert!(f64::abs(moved - plain - offset_m) < 1e-12);
        }
        let padded = [vec![1e-5; later], dx.clone()].concat();
        let padded_load = [vec![300.0; later], load.to_vec()].concat();
        let found = track(&f, &padded, &padded_load, &[0..later, later..padded.len()]);
        prop_assert_eq!(&found[later..], &plain[..]);
    }

    /// ΔS is a difference of means of sets: the order of the samples is no part of it, nor where a list is cut. δX₀ (eq 3),
    /// unknown in service, enters S as a constant, which a difference of means must not see.
    #[test]
    fn the_gap_is_invariant_to_order_and_offset(
        upper_m in vec(40e-6..60e-6, 1..200), lower_m in vec(-60e-6..-40e-6, 1..200),
        turn in 0..400_usize, offset_m in -1e-3..1e-3,
    ) {
        let s_m = [upper_m, lower_m].concat();
        let mut turned = s_m.clone();
        turned.rotate_left(turn % s_m.len());
        let reversed: Vec<f64> = s_m.iter().rev().copied().collect();
        let moved: Vec<f64> = s_m.iter().map(|s| s + offset_m).collect();
        let wanted_m = gap::mid_range(&s_m).unwrap().gap_m;
        for (other, within_m) in [(turned, 1e-17), (reversed, 1e-17), (moved, 1e-15)] {
            let change_m = gap::mid_range(&other).unwrap().gap_m - wanted_m;
            prop_assert!(change_m.abs() < within_m, "changed by {change_m:e} m");
        }
    }

    /// P is a covariance: whatever plausible part, rate and bandwidth, no variance falls below zero and no correlation
    /// passes one, while the start is forgotten and long after.
    #[test]
    fn the_covariance_stays_one_over_the_plausible_box(
        (stiffness, damping, mass) in (3.0..12.0_f64, -1.0..9.0_f64, -4.0..6.0_f64),
        (rate_hz, bandwidth_hz) in (1.3..4.0_f64, -4.0..4.0_f64),
    ) {
        let ten = |power: f64| 10_f64.powf(power);
        let actuator = ActuatorModel::linear(ten(stiffness), ten(damping), ten(mass)).unwrap();
        let noise = sensor_noise(ten(bandwidth_hz));
        // A step or bandwidth that a model refuses has no covariance.
        let Ok(f) = Filter::new(&actuator, ten(-rate_hz), &noise) else { return Ok(()) };
        let mut state = f.initial_state(0.0, 0.0);
        for k in 0..3000 {
            // Every seventh sample is missing.
            let Ok(step) = f.update(&state, if k % 7 == 3 { f64::NAN } else { 0.0 }) else {
                prop_assert!(false, "the innovation has no variance in step {}", k);
                return Ok(());
            };
            for p in [step.prior.p, step.posterior.p] {
                for i in 0..3 {
                    prop_assert!(p[(i, i)] >= 0.0, "variance {} is {:e} in step {}", i, p[(i, i)], k);
                    for j in 0..i {
                        let bound = (p[(i, i)] * p[(j, j)]).sqrt();
                        prop_assert!(p[(i, j)].abs() <= bound * (1.0 + 1e-6), "correlation {}, {} in step {}", i, j, k);
                    }
                }
            }
            state = f.predict(&step.posterior, 0.0);
        }
    }

    /// Soft or stiff, slow or fast compared with the step, weakly damped or not: the steady-state filter agrees with
    /// the plain recursion to 1e-12 of the largest input or output.
    ///
    /// Excluded is a weakly damped part whose mode is at a multiple of the sample rate: it appears constant, so its
    /// motion and the backlash are not separable, and rounding errors of the plain covariance do not decay.
    #[test]
    fn the_shortcut_agrees_with_the_plain_recursion_for_any_actuator(
        (stiffness, damping, mass) in (6.5..9.0_f64, 1.0..4.5_f64, 0.0..2.5_f64),
        (rate_hz, bandwidth_hz) in (1.7..3.0_f64, 0.3..1.5_f64),
        jumps in vec(-1e-5..1e-5, 4000),
    ) {
        let ten = |power: f64| 10_f64.powf(power);
        // Its motion turns as √(K/m) and dies as exp(−f t/2m).
        let turns = (ten(stiffness) / ten(mass)).sqrt() / std::f64::consts::TAU / ten(rate_hz);
        let ringing_samples = 2.0 * ten(mass) / ten(damping) * ten(rate_hz);
        let hides = turns > 0.5 && (turns - turns.round()).abs() < 0.01 && ringing_samples > 100.0;
        prop_assume!(!hides);
        let actuator = ActuatorModel::linear(ten(stiffness), ten(damping), ten(mass)).unwrap();
        let f = Filter::new(&actuator, ten(-rate_hz), &sensor_noise(ten(bandwidth_hz))).unwrap();
        let load: Vec<f64> = (0..jumps.len()).map(|k| 5e3 * (0.01 * k as f64).sin()).collect();
        let dx: Vec<f64> =
            load.iter().zip(&jumps).map(|(u, jump)| u / ten(stiffness) + 50e-6 * u.signum() + jump).collect();
        let fast = batch(&f, &dx, &load);
        let peak_m = dx.iter().chain(&fast).fold(0.0, |peak: f64, v| peak.max(v.abs()));
        for (k, (step, fast_m)) in single_steps(&f, &dx, &load).zip(&fast).enumerate() {
            let off_m = (step.posterior.x[2] - fast_m).abs();
            prop_assert!(off_m < 1e-12 * peak_m, "row {k}: off by {:e} of the peak", off_m / peak_m);
        }
    }

    /// A missing load is held; S stays a number.
    #[test]
    fn missing_loads_never_poison_the_track(load in vec(prop_oneof![5 => (-8e3..8e3).boxed(), 1 => Just(f64::NAN).boxed()], 300..900)) {
        let dx: Vec<f64> = load.iter().scan(0.0, |last, f| { *last = if f.is_nan() { *last } else { *f }; Some(*last / 5e7) }).collect();
        let held: Vec<f64> = dx.iter().map(|y| y * 5e7).collect();
        let f = filter(250.0, 20.0);
        let (found, wanted) = (batch(&f, &dx, &load), batch(&f, &dx, &held));
        for (a, b) in found.iter().zip(&wanted) {
            prop_assert!((a - b).abs() < 1e-15, "{a} is not {b}");
        }
    }
}

/// P₀ moves the first seconds and nothing later: after 1 s two filters of different P₀ agree to 10⁻⁹ of the gap.
#[test]
fn the_initial_variances_are_forgotten() {
    let filter = filter(1000.0, 10.0);
    let start =
        estimator::InitialVariances { position_m2: Some(1e-6), speed_m2_per_s2: 1.0, backlash_m2: 1e-14 };
    let other = filter.with_initial_variances(start).unwrap();
    assert!((other.initial_state(0.0, 0.0).p[(2, 2)] - 1e-14).abs() < 1e-28);
    let [mut usual, mut unusual] = [filter, other].map(|filter| estimator::Stream::constant_time(&filter));
    let (mut first_m, mut last_m) = (0.0_f64, 0.0_f64);
    for k in 0..1000 {
        let y_m = if k < 5 { 0.0 } else { 100e-6 };
        let apart_m = (usual.push(y_m, 0.0).unwrap().s_m() - unusual.push(y_m, 0.0).unwrap().s_m()).abs();
        first_m = if k < 100 { first_m.max(apart_m) } else { first_m };
        last_m = apart_m;
    }
    assert!(first_m > 1e-6 && last_m < 1e-13, "{first_m} m, then {last_m} m");
    let wrong = estimator::InitialVariances { backlash_m2: -1.0, ..start };
    assert!(filter.with_initial_variances(wrong).is_err());
}
