//! The filter as the samples come, against the batch that has them all.

use estimator::Stream;
use proptest::collection::vec;
use proptest::prelude::*;
use simulator::{Flight, Plant, Profile, Sensors, simulate};

use crate::{batch, filter};

fn streamed(mut stream: Stream, dx_m: &[f64], load_n: &[f64]) -> Vec<f64> {
    dx_m.iter().zip(load_n).map(|(y, u)| stream.push(*y, *u).unwrap().s_m()).collect()
}

/// Largest difference, held against the peak.
fn difference(found: &[f64], wanted: &[f64]) -> f64 {
    let peak = wanted.iter().fold(0.0, |p: f64, v| p.max(v.abs()));
    found.iter().zip(wanted).fold(0.0, |d: f64, (f, w)| d.max((f - w).abs())) / peak
}

fn channels(flight: &Flight) -> (Vec<f64>, &[f64]) {
    (flight.screw_m.iter().zip(&flight.motor_m).map(|(s, m)| s - m).collect(), &flight.load_n)
}

fn fly(seed: u64, gap_m: f64, friction: f64, rate_hz: f64) -> Flight {
    let profile = Profile { duration_s: 40.0, sample_rate_hz: rate_hz, ..Profile::default() };
    let plant = Plant::default().with_gap_m(gap_m).with_friction_factor(friction);
    simulate(&plant, &profile, &Sensors::default(), seed).unwrap()
}

/// 1e-12 of the peak where the whole recursion goes on beyond settling; no bit where it does not.
#[test]
fn a_stream_is_the_batch_over_whole_flights() {
    for (seed, rate_hz) in [(1, 100.0), (2, 250.0), (3, 1000.0)] {
        let (flight, filter) = (fly(seed, 100e-6, 1.0, rate_hz), filter(rate_hz, 10.0));
        let (dx_m, load_n) = channels(&flight);
        let wanted = batch(&filter, &dx_m, load_n);
        let even = difference(&streamed(Stream::constant_time(&filter), &dx_m, load_n), &wanted);
        assert!(even < 1e-12, "{rate_hz} Hz: off by {even:e} of the peak");
        assert_eq!(streamed(Stream::steady_state(&filter), &dx_m, load_n), wanted);
    }
}

proptest! {
    /// After a restart, with any missing samples and loads after the first sample: bitwise identical.
    #[test]
    fn a_stream_gives_the_bits_of_the_batch(
        dx in vec(prop_oneof![9 => (-1e-4..1e-4).boxed(), 1 => Just(f64::NAN).boxed()], 300..900),
        load in vec(prop_oneof![30 => (-8e3..8e3).boxed(), 1 => Just(f64::NAN).boxed()], 900),
    ) {
        let load = &load[..dx.len()];
        prop_assume!(!dx[0].is_nan());
        let f = filter(250.0, 40.0);
        let wanted = batch(&f, &dx, load);
        let [steady, even] = [Stream::steady_state(&f), Stream::constant_time(&f)].map(|mut stream| {
            stream.push(1e-3, -5e3).unwrap();
            stream.restart();
            assert!(stream.push(f64::NAN, 0.0).unwrap().s_m().is_nan());
            streamed(stream, &dx, load)
        });
        prop_assert_eq!(&steady, &wanted);
        let even = difference(&even, &wanted);
        prop_assert!(even < 1e-12, "off by {even:e} of the peak");
    }
}
