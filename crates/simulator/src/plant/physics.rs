//! Two masses against closed forms and conservation laws.
#![expect(clippy::float_cmp, reason = "a motor that is braked stays at zero to the bit")]

use std::f64::consts::{PI, TAU};

use proptest::prelude::*;

use crate::plant::actuator_plant::Plant;
use crate::plant::backlash_contact::ContactLaw;
use crate::plant::friction::{Friction, FrictionLaw};
use crate::plant::two_mass::{Forces, State, advance};

const STEP_S: f64 = 1e-4;

/// Forces without vibration of the motor.
fn forces(drive_n: f64, load_n: f64) -> Forces {
    Forces { drive_n, load_n, ..Forces::default() }
}

/// Kinetic and elastic energy, J.
fn energy_j(state: &State, plant: &Plant) -> f64 {
    let kinetic = 0.5 * plant.motor_mass_kg * state.motor_m_per_s.powi(2)
        + 0.5 * plant.screw_mass_kg * state.screw_m_per_s.powi(2);
    kinetic + plant.contact.energy_j(state.screw_m - state.motor_m)
}

/// No friction and no damping anywhere.
fn slippery() -> Plant {
    let mut plant = Plant {
        motor_friction: Friction::default(),
        screw_friction: Friction::default(),
        ..Plant::default()
    };
    plant.contact.damping_n_s_per_m = 0.0;
    plant.contact.offset_m = 0.0;
    plant
}

/// The motor is held by friction that nothing overcomes.
fn braked(mut plant: Plant) -> Plant {
    plant.motor_friction.dry_n = 1e12;
    plant
}

fn run(plant: &Plant, mut state: State, forces: Forces, seconds: f64, step_s: f64) -> State {
    for _ in 0..(seconds / step_s).round() as usize {
        state = advance(plant, &state, forces, step_s);
    }
    state
}

fn delta_m(state: &State) -> f64 {
    state.screw_m - state.motor_m
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Hooke's law beyond the flank: `δX = δX₀ ± gap/2 + F/K`.
    #[test]
    fn a_loaded_screw_rests_half_a_gap_and_f_over_k_from_the_middle(
        stiffness in 1e7..1.5e8_f64, gap_m in 0.0..300e-6_f64, offset_m in -1e-3..1e-3_f64,
        load_n in 100.0..20e3_f64, side in prop::bool::ANY, screw_kg in 1.0..100.0_f64,
    ) {
        let mut plant = braked(Plant { screw_mass_kg: screw_kg, ..slippery() });
        plant.contact.stiffness_n_per_m = stiffness;
        plant.contact.gap_m = gap_m;
        plant.contact.offset_m = offset_m;
        plant.contact.damping_n_s_per_m = (stiffness * screw_kg).sqrt();
        let sign: f64 = if side { 1.0 } else { -1.0 };
        let from = State { screw_m: offset_m, ..State::default() };
        let rest = run(&plant, from, forces(0.0, sign * load_n), 2.0, STEP_S);
        let expected_m = sign * (0.5 * gap_m + load_n / stiffness);
        prop_assert!(((delta_m(&rest) - offset_m) / expected_m - 1.0).abs() < 1e-6);
        prop_assert_eq!(rest.motor_m, 0.0);
    }

    /// Without friction and damping the energy stays, in every contact law, at any step and stiffness.
    #[test]
    fn an_undamped_rattle_keeps_its_energy(
        stiffness in 1e7..1.5e8, gap_m in 0.0..300e-6, motor_kg in 1.0..100.0, screw_kg in 1.0..100.0,
        speed in 0.01..0.2, law in 0..4_usize, lower_factor in 0.5..2.0,
    ) {
        let laws = [
            ContactLaw::Linear,
            ContactLaw::Soft { share: 0.4, depth_m: 50e-6 },
            ContactLaw::Hertz { share: 0.5, reference_m: 100e-6 },
            ContactLaw::Toe { share: 0.3, depth_m: 30e-6 },
        ];
        let mut plant = Plant { motor_mass_kg: motor_kg, screw_mass_kg: screw_kg, ..slippery() };
        plant.contact.stiffness_n_per_m = stiffness;
        plant.contact.gap_m = gap_m;
        plant.contact.law = laws[law];
        plant.contact.lower_law = Some(laws[(law + 1) % 4]);
        plant.contact.lower_stiffness_factor = lower_factor;
        let start = State { screw_m_per_s: speed, ..State::default() };
        let end = run(&plant, start, Forces::default(), 1.0, STEP_S);
        prop_assert!((energy_j(&end, &plant) / energy_j(&start, &plant) - 1.0).abs() < 1e-8);
    }

    /// Friction and damping only ever take.
    #[test]
    fn energy_is_never_created(
        gap_m in 0.0..300e-6, motor_speed in -0.1..0.1, screw_speed in -0.1..0.1, stribeck in prop::bool::ANY,
    ) {
        let law = if stribeck {
            FrictionLaw::Stribeck { ratio: 1.6, speed_m_per_s: 2e-3 }
        } else {
            FrictionLaw::Coulomb
        };
        let plant = Plant { friction_law: law, ..Plant::default() }.with_gap_m(gap_m);
        let mut state = State {
            motor_m_per_s: motor_speed,
            screw_m_per_s: screw_speed,
            screw_m: plant.contact.offset_m,
            ..State::default()
        };
        let mut before_j = energy_j(&state, &plant);
        for _ in 0..5000 {
            state = advance(&plant, &state, Forces::default(), STEP_S);
            let now_j = energy_j(&state, &plant);
            prop_assert!(now_j <= before_j * (1.0 + 1e-9) + 1e-15, "{now_j:e} after {before_j:e} J");
            before_j = now_j;
        }
        prop_assert_eq!((state.motor_m_per_s, state.screw_m_per_s), (0.0, 0.0));
    }
}

/// With no gap the pair is one spring: `δX(t) = A cos ωt`, `ω² = K (1/m_m + 1/m_s)`.
#[test]
fn without_a_gap_the_coupling_is_a_linear_spring_and_the_error_falls_with_the_square_of_the_step() {
    let plant = slippery().with_gap_m(0.0);
    let omega = (5e7_f64 * (1.0 / 80.0 + 1.0 / 8.0)).sqrt();
    let seconds = 5.1 * TAU / omega;
    let start = State { screw_m: 1e-4, ..State::default() };
    let error = |steps: f64| {
        let end = run(&plant, start, Forces::default(), seconds, seconds / steps);
        (delta_m(&end) - 1e-4 * (omega * seconds).cos()).abs() / 1e-4
    };
    let (coarse, fine) = (error(2000.0), error(4000.0));
    assert!(coarse < 2e-3, "{coarse:e}");
    assert!((coarse / fine - 4.0).abs() < 0.1, "ratio {}", coarse / fine);
}

/// A screw between braked flanks: half a spring period in each, `gap / v` across, twice.
#[test]
fn a_rattling_screw_takes_two_half_periods_and_two_crossings() {
    let mut plant = braked(slippery()).with_gap_m(200e-6);
    plant.motor_friction.load_share = 0.0;
    let (speed, omega) = (0.05, (5e7_f64 / 8.0).sqrt());
    let period_s = 2.0 * PI / omega + 2.0 * 200e-6 / speed;
    let start = State { screw_m_per_s: speed, ..State::default() };
    let miss = |steps: f64| {
        let end = run(&plant, start, Forces::default(), 3.0 * period_s, period_s / steps);
        (end.screw_m.abs() / 200e-6).max((end.screw_m_per_s / speed - 1.0).abs())
    };
    assert!(miss(4000.0) < 1e-3, "{}", miss(4000.0));
    assert!(miss(8000.0) < 0.5 * miss(4000.0));
}

/// The friction of a slow screw is a play operator: the coupling carries the load less what friction
/// holds, and keeps it until the load has moved by twice the level. Viscous friction lets it land softly
/// after crossing the gap; the landing itself is left out.
#[test]
fn a_slow_load_cycle_leaves_the_loop_of_a_stuck_screw() {
    let mut plant = braked(slippery());
    plant.contact.damping_n_s_per_m = 4e4;
    plant.screw_friction = Friction::new(300.0, 0.05, 2e4);
    let mut state = State::default();
    let mut coupling_n: f64 = 0.0;
    for k in 0..100_000 {
        let load_n = 6000.0 * (TAU * f64::from(k) / 50_000.0).sin();
        state = advance(&plant, &state, forces(0.0, load_n), STEP_S);
        let level_n = 300.0 + 0.05 * load_n.abs();
        coupling_n = coupling_n.clamp(load_n - level_n, load_n + level_n);
        if coupling_n.abs() > 400.0 {
            let expected_m = coupling_n / 5e7 + 50e-6_f64.copysign(coupling_n);
            let measured_m = delta_m(&state);
            assert!(
                (measured_m - expected_m).abs() < 0.3e-6,
                "{measured_m:e} for {expected_m:e} at {load_n} N"
            );
        }
    }
}

/// A screw pressed against a shaken motor follows it: `δX − shake` stays what the load makes it.
#[test]
fn a_pressed_screw_follows_a_shaken_motor() {
    let mut plant = braked(slippery());
    plant.contact.damping_n_s_per_m = 2e4;
    let shake_m = |k: i32| 20e-6 * (TAU * 10.0 * f64::from(k) * STEP_S).sin();
    let mut state = State { screw_m: 50e-6 + 5000.0 / 5e7, ..State::default() };
    for k in 0..20_000 {
        let shake_m_per_s = (shake_m(k + 1) - shake_m(k)) / STEP_S;
        let shaken = Forces { shake_m: shake_m(k), shake_m_per_s, ..forces(0.0, 5000.0) };
        state = advance(&plant, &state, shaken, STEP_S);
        if k > 2000 {
            // The inertia of 8 kg: 8·(2π·10)²·20 µm is 0.6 N.
            let expected_m = 50e-6 + 5000.0 / 5e7;
            assert!((delta_m(&state) - shake_m(k + 1) - expected_m).abs() < 5e-8);
        }
    }
    assert_eq!(state.motor_m, 0.0);
}

/// Bristles carry a small push elastically: a push of half the sliding level bends them by `−ln(1 − 1/2)` of their travel,
/// Dahl's equation integrated; those of `LuGre` by `−ln(1 − ½/ratio)·ratio`, less since g is higher at rest.
#[test]
fn bristles_bend_before_they_slide() {
    let travel_m = 5e-6;
    let lu_gre = FrictionLaw::LuGre { travel_m, ratio: 1.5, speed_m_per_s: 0.1, damping_n_s_per_m: 2e3 };
    for (friction_law, ratio) in [(FrictionLaw::Presliding { travel_m }, 1.0), (lu_gre, 1.5)] {
        let screw_friction = Friction::new(400.0, 0.0, 1e5);
        let plant = Plant { screw_friction, friction_law, ..braked(slippery()) };
        let mut state = State::default();
        for k in 0..40_000 {
            let load_n = 200.0 * (f64::from(k) / 30_000.0).min(1.0);
            state = advance(&plant, &state, forces(0.0, load_n), STEP_S);
        }
        let expected_m = -travel_m * ratio * (1.0_f64 - 0.5 / ratio).ln();
        assert!((state.screw_m / expected_m - 1.0).abs() < 0.01, "{:e} for {expected_m:e}", state.screw_m);
    }
}

#[test]
fn a_screw_held_by_friction_does_not_creep() {
    let plant = braked(Plant::default());
    let start = State { screw_m: plant.contact.offset_m, ..State::default() };
    let held = run(&plant, start, forces(0.0, 150.0), 10.0, STEP_S);
    assert_eq!(held, start);
    let moved = run(&plant, start, forces(0.0, 160.0), 10.0, STEP_S);
    assert!(moved.screw_m > start.screw_m + 40e-6);
}

/// The lightest masses on the stiffest coupling: the step is longer than an explicit method would bear.
#[test]
fn the_stiffest_and_lightest_actuator_is_stable() {
    let mut plant = Plant { motor_mass_kg: 1.0, screw_mass_kg: 1.0, ..Plant::default() };
    plant.contact.stiffness_n_per_m = 1.5e8;
    let mut state = State { screw_m: plant.contact.offset_m, ..State::default() };
    for k in 0..100_000 {
        let load_n = 8000.0 * (TAU * f64::from(k) * 5e-5).sin();
        let drive_n = -2e4 * state.motor_m_per_s - 1e7 * state.motor_m;
        state = advance(&plant, &state, forces(drive_n, load_n), STEP_S);
        assert!((delta_m(&state) - plant.contact.offset_m).abs() < 200e-6);
    }
}

/// A driven, loaded, sticking, rattling second converges to one motion as the step is refined. The
/// relative position, which the gap is read from, does so with the square of the step; where both
/// masses have got to keeps a memory of when exactly each stop began.
#[test]
fn a_finer_step_converges_to_one_motion() {
    let plant = Plant::default();
    let end = |step_s: f64| {
        let mut state = State { screw_m: plant.contact.offset_m, ..State::default() };
        for k in 0..(1.0 / step_s).round() as usize {
            let middle_s = (k as f64 + 0.5) * step_s;
            let load_n = 5000.0 * (TAU * 2.0 * middle_s).sin();
            let drive_n = 9000.0 * (TAU * 1.3 * middle_s).cos();
            state = advance(&plant, &state, forces(drive_n, load_n), step_s);
        }
        state
    };
    let truth = end(STEP_S / 256.0);
    let miss_m = |state: State| (delta_m(&state) - delta_m(&truth)).abs();
    let (coarse, fine) = (end(STEP_S), end(STEP_S / 8.0));
    assert!(miss_m(coarse) < 1e-6, "{:e}", miss_m(coarse));
    assert!(miss_m(fine) < miss_m(coarse) / 20.0, "{:e}", miss_m(fine));
    assert!((coarse.motor_m / truth.motor_m - 1.0).abs() < 5e-5, "{}", coarse.motor_m);
}
