//! One simulated flight: repeatable, loaded as specified, and sampled at its timestamps.

use simulator::{Channel, Friction, Plant, Profile, Sensors, Vibration, simulate};

fn short() -> Profile {
    Profile { duration_s: 30.0, sample_rate_hz: 100.0, ..Profile::default() }
}

#[test]
fn a_change_of_one_sensor_leaves_the_others_alone() {
    let fly = |sensors: &Sensors| simulate(&Plant::default(), &short(), sensors, 5).unwrap();
    let plain = fly(&Sensors::default());
    let mut worse = Sensors::default();
    worse.motor = Channel { noise_rms: 1e-5, dropout_share: 0.1, ..worse.motor };
    let noisy = fly(&worse);
    assert_eq!((plain.screw_m, plain.load_n), (noisy.screw_m, noisy.load_n));
    assert!(noisy.motor_m.iter().any(|x| x.is_nan()));
}

#[test]
fn the_load_reverses_many_times_and_exceeds_its_scale_in_a_twentieth_of_the_cruise() {
    let profile = Profile { duration_s: 600.0, sample_rate_hz: 50.0, hinge_share: 0.0, ..Profile::default() };
    let flight = simulate(&Plant::default(), &profile, &Sensors::perfect(), 3).unwrap();
    let cruise = &flight.load_n[(0.3 * 30_000.0) as usize..(0.68 * 30_000.0) as usize];
    let mut sizes: Vec<f64> = cruise.iter().map(|f| f.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let p95_n = sizes[sizes.len() * 95 / 100];
    assert!((0.8..1.2).contains(&(p95_n / profile.load_n)), "{p95_n}");
    let reversals = flight.load_n.windows(2).filter(|pair| pair[0] * pair[1] < 0.0).count();
    assert!(reversals > 50, "{reversals}");
}

#[test]
fn a_flight_without_reversal_keeps_the_sign_of_its_load() {
    assert!(!Profile { reversals: Some(1), ..short() }.is_one_sided());
    for seed in 0..5 {
        let reversals = (seed > 2).then_some(0);
        let profile = Profile { no_reversal: seed < 3, reversals, ..short() };
        let flight = simulate(&Plant::default(), &profile, &Sensors::default(), seed).unwrap();
        assert!(flight.load_n.iter().all(|f| *f * flight.load_n[0] > 0.0));
        assert!(profile.is_one_sided());
    }
}

#[test]
fn the_motor_follows_its_commands_through_the_preflight_checks() {
    let profile = short();
    let flight =
        simulate(&Plant::default(), &Profile { duration_s: 100.0, ..profile }, &Sensors::perfect(), 8)
            .unwrap();
    let farthest = flight.motor_m[..800].iter().fold(0.0_f64, |far, x| far.max(x.abs()));
    assert!((farthest / (0.8 * profile.stroke_m) - 1.0).abs() < 0.1, "{farthest}");
    assert!(flight.motor_m.iter().all(|x| x.abs() < 1.1 * profile.stroke_m));
}

/// A channel one millisecond late shows at 250 Hz what a prompt one showed a millisecond before.
#[test]
fn a_delay_is_a_delay_to_a_fraction_of_a_sample() {
    let fly = |sample_rate_hz, delay_s| {
        let mut sensors = Sensors::perfect();
        sensors.screw.delay_s = delay_s;
        simulate(&Plant::default(), &Profile { sample_rate_hz, ..short() }, &sensors, 4).unwrap()
    };
    let (prompt, late) = (fly(1000.0, 0.0), fly(250.0, 1e-3));
    for k in 1..late.screw_m.len() {
        assert!((late.screw_m[k] - prompt.screw_m[4 * k - 1]).abs() < 1e-12);
        assert!((late.motor_m[k] - prompt.motor_m[4 * k]).abs() < 1e-12);
    }
}

/// The load cell sees buffet of the rms asked for: with and without it the loads differ by just that.
#[test]
fn buffet_adds_its_rms_to_the_load_and_vibration_to_the_motor() {
    let fly = |change: fn(&mut Profile)| {
        let mut profile = Profile { hinge_share: 0.0, sample_rate_hz: 500.0, ..short() };
        change(&mut profile);
        simulate(&Plant::default(), &profile, &Sensors::perfect(), 9).unwrap()
    };
    let rms = |a: &[f64], b: &[f64]| {
        (a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / a.len() as f64).sqrt()
    };
    let (calm, buffeted) = (fly(|_| ()), fly(|p| p.buffet = Vibration::band(10.0, 60.0, 0.1)));
    assert!((rms(&calm.load_n, &buffeted.load_n) / 800.0 - 1.0).abs() < 0.05);
    // A motor that friction holds moves by the vibration alone.
    let mut held = Plant::default();
    held.motor_friction.dry_n = 1e9;
    let profile = Profile { motor_vibration: Vibration::band(20.0, 60.0, 10e-6), ..short() };
    let motor_m = simulate(&held, &profile, &Sensors::perfect(), 9).unwrap().motor_m;
    assert!((rms(&motor_m, &vec![0.0; motor_m.len()]) / 10e-6 - 1.0).abs() < 0.05);
}

/// While the load is large the coupling is closed, and all that stands between δX − F/K and half a gap
/// is the screw's friction and inertia: with neither friction nor noise, the inertia alone.
#[test]
fn a_flight_without_friction_shows_its_gap_between_the_flanks() {
    let mut plant = Plant::default().with_gap_m(120e-6);
    plant.screw_friction = Friction::default();
    let flight = simulate(&plant, &short(), &Sensors::perfect(), 6).unwrap();
    let slack = |side: f64| {
        let loaded = flight.load_n.iter().enumerate().filter(|(_, f)| *f * side > 1500.0);
        let mut free: Vec<f64> = loaded
            .map(|(k, f)| flight.screw_m[k] - flight.motor_m[k] - plant.contact.offset_m - f / 5e7)
            .collect();
        free.sort_by(f64::total_cmp);
        free[free.len() / 2]
    };
    assert!((slack(1.0) - 60e-6).abs() < 0.3e-6 && (slack(-1.0) + 60e-6).abs() < 0.3e-6);
}

#[test]
fn what_cannot_be_is_refused_with_key_value_and_range() {
    let plant = Plant { screw_mass_kg: 0.0, ..Plant::default() };
    let error = simulate(&plant, &short(), &Sensors::default(), 1).unwrap_err();
    assert_eq!(error.to_string(), "`screw_mass_kg` is 0, which must be greater than zero and finite");
    let profile = Profile { sample_rate_hz: f64::NAN, ..short() };
    assert!(simulate(&Plant::default(), &profile, &Sensors::default(), 1).is_err());
}
