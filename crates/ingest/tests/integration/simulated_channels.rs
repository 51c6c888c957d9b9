//! Noise and quality flags of simulated flights, whose noise, resolution and outliers are known.

use ingest::ActuatorChannels;
use ingest::channel::noise_floor::white_noise;
use ingest::channel::position_ratio::position_ratio;
use ingest::log::in_memory::ChannelArrays;
use records::Position;
use simulator::{Flight, Plant, Profile, Sensors, Vibration, simulate};

const RATES_HZ: [f64; 6] = [62.5, 100.0, 125.0, 250.0, 500.0, 1000.0];

/// Half of the flights vibrate, half have three times the friction and stick.
fn flight(rate_hz: f64, seed: u64) -> Flight {
    let vibration = Vibration { low_hz: 4.0, high_hz: 8.0, rms: 5e-6, ..Vibration::default() };
    let motor_vibration = if seed.is_multiple_of(2) { vibration } else { Vibration::default() };
    let plant = Plant::default().with_friction_factor(if seed.is_multiple_of(2) { 1.0 } else { 3.0 });
    let profile =
        Profile { duration_s: 100.0, sample_rate_hz: rate_hz, motor_vibration, ..Profile::default() };
    simulate(&plant, &profile, &Sensors::default(), seed).unwrap()
}

fn read(flight: &Flight) -> ActuatorChannels {
    let arrays = ChannelArrays {
        time_s: &flight.time_s,
        motor_m: &flight.motor_m,
        screw_m: &flight.screw_m,
        load_n: &flight.load_n,
    };
    arrays.to_channels(Position::new("rudder").unwrap()).unwrap()
}

fn flights() -> impl Iterator<Item = (f64, u64)> {
    RATES_HZ.into_iter().flat_map(|rate_hz| (1..=4).map(move |seed| (rate_hz, seed)))
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Of the sensors: 1 µm, 3 µm and 40 N, in steps of 0.3 µm, 2.3 µm and 10 N. Below 125 Hz some motion remains in the
/// highest difference.
#[test]
fn the_noise_of_each_sensor_is_found_within_fifteen_percent() {
    let truth = [(1e-6, 3e-7), (3e-6, 2.3e-6), (40.0, 10.0)];
    for rate_hz in RATES_HZ {
        let all: Vec<Flight> = (1..=4).map(|seed| flight(rate_hz, seed)).collect();
        for (channel, (rms, resolution)) in truth.into_iter().enumerate() {
            let of = |f: &Flight| {
                let values = [&f.motor_m, &f.screw_m, &f.load_n][channel];
                white_noise(values, Some(resolution)).unwrap().rms / rms
            };
            let found: Vec<f64> = all.iter().map(of).collect();
            let tolerance = if rate_hz < 125.0 { 0.4 } else { 0.15 };
            assert!(
                (median(found.clone()) - 1.0).abs() < tolerance,
                "{rate_hz} Hz, channel {channel}: {found:?}"
            );
        }
    }
}

#[test]
fn flights_without_outliers_have_no_spikes() {
    let with_spikes = |(rate_hz, seed)| {
        let flags = read(&flight(rate_hz, seed)).flags;
        flags
            .into_iter()
            .filter(|f| f.ends_with("_spikes"))
            .map(move |flag| format!("{flag} at {rate_hz} Hz, {seed}"))
    };
    let flagged: Vec<String> = flights().flat_map(with_spikes).collect();
    // 2 % of 24 flights with three channels each.
    assert!(flagged.len() <= 1, "{flagged:?}");
}

/// Two outliers of 2 mm in a flight of 100 s, and outliers of ten times the noise of a load cell.
#[test]
fn outliers_are_spikes() {
    let mut missed = Vec::new();
    for (rate_hz, seed) in flights().step_by(2) {
        let mut flight = flight(rate_hz, seed);
        let rows = flight.motor_m.len();
        for at in [rows / 3, 2 * rows / 3 + 7] {
            flight.motor_m[at] += 2e-3;
            flight.screw_m[at + 50] -= 2e-3;
            flight.load_n[at + 99] += 400.0;
        }
        let channels = read(&flight);
        let spikes = channels.quality.map(|q| q.spikes);
        assert_eq!(spikes[..2], [2, 2], "{rate_hz} Hz, {seed}");
        if !channels.flags.contains(&"load_spikes".to_owned()) {
            missed.push((rate_hz, seed));
        }
    }
    assert!(missed.len() <= 3, "{missed:?}");
}

/// Three rows that are not there are a break in time, and no spike.
#[test]
fn missing_rows_are_no_spikes() {
    for rate_hz in RATES_HZ {
        let mut flight = flight(rate_hz, 2);
        for at in [3000, 1700, 900] {
            for channel in [&mut flight.time_s, &mut flight.motor_m, &mut flight.screw_m, &mut flight.load_n]
            {
                channel.remove(at);
            }
        }
        assert_eq!(read(&flight).quality.map(|q| q.spikes), [0, 0, 0], "{rate_hz} Hz");
    }
}

/// Soft rotary actuators wind up by a twentieth of their motion, and a sensor of theirs has outliers: the ratio of the
/// positions is still that of the simulator, 1.
#[test]
fn the_ratio_of_the_positions_is_one_under_wind_up_and_outliers() {
    for (stiffness_n_per_m, hinge_share) in [(1e7, 0.3), (1e7, 0.4), (5e6, 0.3), (1e8, 0.3)] {
        for seed in 1..=3 {
            let mut plant = Plant::default();
            plant.contact.stiffness_n_per_m = stiffness_n_per_m;
            let profile = Profile { duration_s: 100.0, hinge_share, ..Profile::default() };
            let mut flight = simulate(&plant, &profile, &Sensors::default(), seed).unwrap();
            let rows = flight.motor_m.len();
            for at in [rows / 3, rows / 2, rows - 100] {
                flight.motor_m[at] += 0.5;
                flight.screw_m[at + 9] -= 2.0;
            }
            let a = read(&flight);
            let ratio = position_ratio(&a.motor_m, &a.dx_m, &a.load_n).unwrap();
            assert!((ratio - 1.0).abs() < 0.01, "{stiffness_n_per_m} N/m, {hinge_share}, {seed}: {ratio}");
        }
    }
}
