//! The filter and the statistic as the samples come, against the batch that has them all.

use estimator::{BoundedGap, Error, Stream, StreamingGap, gap};
use proptest::collection::vec;
use proptest::prelude::*;
use simulator::{Flight, Plant, Profile, Sensors, simulate};

use crate::vectors::{SETS, Set};
use crate::{batch, filter};

/// 256 bins of 2 µm: 4 KiB, for gaps from 30 to 300 µm.
type Histogram = StreamingGap<256>;
const BIN_M: f64 = 2e-6;

fn streamed(mut stream: Stream, dx_m: &[f64], load_n: &[f64]) -> Vec<f64> {
    dx_m.iter().zip(load_n).map(|(y, u)| stream.push(*y, *u).unwrap().s_m()).collect()
}

fn running(s_m: &[f64]) -> Result<BoundedGap, Error> {
    let mut gap = Histogram::new(BIN_M).unwrap();
    s_m.iter().for_each(|s| gap.push(*s));
    gap.read()
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

/// Before a position is measured there is no S; from there the stream is the batch of what follows.
#[test]
fn a_stream_starts_at_the_first_measurement() {
    let (flight, filter) = (fly(5, 100e-6, 1.0, 100.0), filter(100.0, 10.0));
    let (mut dx_m, load_n) = channels(&flight);
    dx_m[..40].fill(f64::NAN);
    let found = streamed(Stream::steady_state(&filter), &dx_m, load_n);
    assert!(found[..40].iter().all(|s| s.is_nan()));
    assert_eq!(found[40..], batch(&filter, &dx_m[40..], &load_n[40..]));
}

/// Thirty-two flights, four gaps, three frictions, two rates: the error that `StreamingGap` states.
#[test]
fn a_running_gap_keeps_near_the_batch_over_many_flights() {
    for seed in 0..32 {
        let gap_m = [30e-6, 60e-6, 100e-6, 300e-6][seed as usize % 4];
        let (friction, rate_hz) = ([0.5, 1.0, 3.0][seed as usize % 3], [50.0, 125.0][seed as usize % 2]);
        let flight = fly(seed, gap_m, friction, rate_hz);
        let (dx_m, load_n) = channels(&flight);
        let s_m = batch(&filter(rate_hz, 10.0), &dx_m, load_n);
        let (found, wanted) = (running(&s_m).unwrap(), gap::mid_range(&s_m).unwrap());
        assert!(holds(&found, wanted.gap_m), "seed {seed}: {found:?} is not about {wanted:?}");
        assert_eq!(found.samples, (wanted.upper + wanted.lower) as u64);
        let error = (found.gap_m / wanted.gap_m - 1.0).abs();
        assert!(error < 2e-3, "seed {seed}: off by {error:.2e} of the batch's gap");
    }
}

/// The batch's gap lies within the bounds, but for the rounding of sums taken in another order.
fn holds(found: &BoundedGap, wanted_m: f64) -> bool {
    let (least_m, greatest_m) = (found.least_m - 1e-15, found.greatest_m + 1e-15);
    [wanted_m, found.gap_m].iter().all(|gap_m| (least_m..=greatest_m).contains(gap_m))
}

/// S moves through the mid-range of these between two samples: nothing is in its bin, nothing is lost.
#[test]
fn a_running_gap_agrees_with_the_fifty_digits() {
    for name in &SETS[..3] {
        let set = Set::load(name);
        let found = running(&set.columns["x_filt_2"]).unwrap();
        let error = found.gap_m / set.number("gap") - 1.0;
        assert!(error.abs() < 1e-12, "{name}: off by {error:e} of the gap");
    }
}

#[test]
fn a_streaming_gap_without_motion_reports_the_reason() {
    assert_eq!(running(&[f64::NAN]), Err(Error::NothingMeasured));
    assert_eq!(running(&[2.0; 3]), Err(Error::Constant { samples: 3, s_m: 2.0 }));
    assert!(matches!(Histogram::new(0.0), Err(Error::Parameter { name: "bin_m", .. })));
}

/// By hand: two samples about 0 and one at 100 µm, no bin shared with the mid-range, so nothing is hidden.
#[test]
fn a_gap_wide_of_the_bins_is_exact() {
    let found = running(&[0.0, 1e-6, 100e-6]).unwrap();
    for gap_m in [found.gap_m, found.least_m, found.greatest_m] {
        assert!((gap_m - 99.5e-6).abs() < 1e-18, "{found:?}");
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

    /// Whatever S does, within the bins or beyond them: the batch lies within the bounds.
    #[test]
    fn the_bounds_of_a_running_gap_hold(s_m in vec(-1e-3..1e-3, 2..300), offset_m in -1e-2..1e-2, share in 1e-3..1.0) {
        let s_m: Vec<f64> = s_m.iter().map(|s: &f64| s * share + offset_m).collect();
        let (found, wanted) = (running(&s_m).unwrap(), gap::mid_range(&s_m).unwrap());
        prop_assert!(holds(&found, wanted.gap_m), "{found:?} is not about {wanted:?}");
    }
}
