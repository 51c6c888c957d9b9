//! Noise and quality flags of simulated flights, whose noise, resolution and outliers are known.

use ingest::ActuatorChannels;
use ingest::channel::noise_floor::white_noise;
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
            let mut found: Vec<f64> = all.iter().map(of).collect();
            found.sort_by(f64::total_cmp);
            let median = found[found.len() / 2];
            let tolerance = if rate_hz < 125.0 { 0.4 } else { 0.15 };
            assert!((median - 1.0).abs() < tolerance, "{rate_hz} Hz, channel {channel}: {found:?}");
        }
    }
}

/// Two outliers of 2 mm in a flight of 100 s, and outliers of ten times the noise of a load cell, are spikes. The noise
/// itself is none, and neither is a break in time of three rows that are not there.
#[test]
fn outliers_are_spikes_and_neither_noise_nor_missing_rows_are() {
    let (mut flagged, mut missed) = (0, 0);
    for (rate_hz, seed) in RATES_HZ.into_iter().flat_map(|rate_hz| (1..=4).map(move |seed| (rate_hz, seed))) {
        let mut flight = flight(rate_hz, seed);
        flagged += read(&flight).flags.iter().filter(|flag| flag.ends_with("_spikes")).count();
        let rows = flight.motor_m.len();
        let mut shorter = flight.clone();
        for at in [3000, 1700, 900] {
            let Flight { time_s, motor_m, screw_m, load_n, .. } = &mut shorter;
            for channel in [time_s, motor_m, screw_m, load_n] {
                channel.remove(at);
            }
        }
        let spikes = read(&shorter).quality.map(|q| q.spikes);
        assert!(seed != 2 || spikes == [0; 3], "{rate_hz} Hz: {spikes:?}");
        for at in [rows / 3, 2 * rows / 3 + 7] {
            flight.motor_m[at] += 2e-3;
            flight.screw_m[at + 50] -= 2e-3;
            flight.load_n[at + 99] += 400.0;
        }
        let channels = read(&flight);
        assert_eq!(channels.quality.map(|q| q.spikes)[..2], [2, 2], "{rate_hz} Hz, {seed}");
        missed += usize::from(!channels.flags.contains(&"load_spikes".to_owned()));
    }
    // 2 % of 24 flights with three channels each, and a quarter of the flights.
    assert!(flagged <= 1 && missed <= 6, "{flagged} flagged, {missed} missed");
}
