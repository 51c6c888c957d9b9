//! Time of each implementation of the filter for 16 384 samples in cache, with the lower bounds of the machine measured
//! in the same run: the shortest chain of dependent operations of a step, a sum in the order of the samples, and
//! memory.
//!
//! `batch_in_a_room` reuses its memory and the settled gain.
//!
//! `even_unsettled` restarts before the gain settles, `even` runs on long after: a step takes the same.

#![allow(clippy::unwrap_used, reason = "a benchmark that cannot go on has failed")]

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use estimator::SensorNoise;
use estimator::contact::{self, PartPrior};
use estimator::{
    ActuatorModel, Filter, FilterWorkspace, GainSchedule, NoiseModel, Samples, Stream, StreamingGap, gap,
    midrange,
};

/// Positions, loads and S of so many samples stay in the second cache.
const SAMPLES: usize = 16_384;
/// Columns of so many do not stay in any.
const OUT_OF_CACHE: usize = 2_097_152;
/// The gain settles in hundreds of steps.
const UNSETTLED: usize = 64;

fn main() {
    divan::main();
}

fn filter() -> Filter {
    let actuator = ActuatorModel::linear(5e7, 2000.0, 8.0).unwrap();
    let noise = NoiseModel::Sensors(SensorNoise {
        screw_rms_m: 3e-6,
        screw_resolution_m: 2.3e-6,
        motor_rms_m: 1e-6,
        motor_resolution_m: 3e-7,
        unknown_force_n: 200.0,
        bandwidth_hz: 10.0,
    });
    Filter::new(&actuator, 0.004, &noise).unwrap()
}

/// A load that swings and a gap of 100 µm that follows its side.
fn channels(count: usize) -> (Vec<f64>, Vec<f64>) {
    let load_n: Vec<f64> = (0..count).map(|k| 5e3 * (k as f64 * 0.004).sin()).collect();
    let dx_m = load_n.iter().map(|u| u / 5e7 + 50e-6 * u.signum()).collect();
    (dx_m, load_n)
}

fn track(bencher: Bencher, count: usize) {
    let ((dx_m, load_n), filter, whole) = (channels(count), filter(), 0..count);
    let segments = std::slice::from_ref(&whole);
    let samples = Samples { step_s: 0.004, motor_m: &dx_m, dx_m: &dx_m, load_n: &load_n, segments };
    bencher.counter(ItemsCount::new(count)).bench_local(|| filter.track(black_box(&samples), None).unwrap());
}

#[divan::bench]
fn schedule(bencher: Bencher) {
    let filter = filter();
    bencher.bench_local(|| GainSchedule::new(black_box(&filter)));
}

#[divan::bench]
fn batch(bencher: Bencher) {
    track(bencher, SAMPLES);
}

fn in_a_room(bencher: Bencher, count: usize) {
    let ((dx_m, load_n), schedule, whole) = (channels(count), GainSchedule::new(&filter()), 0..count);
    let segments = std::slice::from_ref(&whole);
    let samples = Samples { step_s: 0.004, motor_m: &dx_m, dx_m: &dx_m, load_n: &load_n, segments };
    let mut room = FilterWorkspace::default();
    bencher
        .counter(ItemsCount::new(count))
        .bench_local(|| schedule.filter_with(black_box(&samples), None, &mut room).unwrap());
}

#[divan::bench]
fn batch_in_a_room(bencher: Bencher) {
    in_a_room(bencher, SAMPLES);
}

#[divan::bench(sample_count = 30)]
fn batch_in_a_room_out_of_cache(bencher: Bencher) {
    in_a_room(bencher, OUT_OF_CACHE);
}

/// An eighth of the samples come before the gain has settled; the settled gain is found already.
#[divan::bench]
fn batch_in_a_room_short(bencher: Bencher) {
    in_a_room(bencher, 512);
}

/// As few, and the settled gain to be found.
#[divan::bench]
fn batch_short(bencher: Bencher) {
    track(bencher, 512);
}

fn published(bencher: Bencher, count: usize) {
    let ((dx_m, load_n), schedule, whole) = (channels(count), GainSchedule::new(&filter()), 0..count);
    let segments = std::slice::from_ref(&whole);
    let samples = Samples { step_s: 0.004, motor_m: &dx_m, dx_m: &dx_m, load_n: &load_n, segments };
    let mut room = FilterWorkspace::default();
    bencher
        .counter(ItemsCount::new(count))
        .bench_local(|| midrange::estimate_with(black_box(&samples), &schedule, &mut room).unwrap());
}

#[divan::bench]
fn published_estimate(bencher: Bencher) {
    published(bencher, SAMPLES);
}

#[divan::bench(sample_count = 30)]
fn published_estimate_out_of_cache(bencher: Bencher) {
    published(bencher, OUT_OF_CACHE);
}

#[divan::bench(sample_count = 30)]
fn load_band_out_of_cache(bencher: Bencher) {
    let ((_, load_n), whole) = (channels(OUT_OF_CACHE), 0..OUT_OF_CACHE);
    bencher
        .counter(ItemsCount::new(OUT_OF_CACHE))
        .bench_local(|| gap::load_band(black_box(&load_n), std::slice::from_ref(&whole)));
}

/// A screw of K = 5·10⁷ N/m with a gap of 100 µm, 200 N of friction while it moves, and the load of [`channels`].
#[divan::bench(sample_count = 10)]
fn contact_regression(bencher: Bencher) {
    let ((_, load_n), whole) = (channels(OUT_OF_CACHE), 0..OUT_OF_CACHE);
    let time_s = |k: usize| k as f64 * 0.004;
    let motor_m: Vec<f64> = (0..OUT_OF_CACHE).map(|k| 0.02 * (0.7 * time_s(k)).sin()).collect();
    let dx_m: Vec<f64> = (0..OUT_OF_CACHE)
        .map(|k| load_n[k] - 200.0 * (0.7 * time_s(k)).cos().signum())
        .map(|force_n| force_n / 5e7 + 50e-6 * force_n.signum())
        .collect();
    let segments = std::slice::from_ref(&whole);
    let samples = Samples { step_s: 0.004, motor_m: &motor_m, dx_m: &dx_m, load_n: &load_n, segments };
    let prior = PartPrior::of_stiffness(5e7);
    let mut room = contact::ContactWorkspace::default();
    bencher
        .counter(ItemsCount::new(OUT_OF_CACHE))
        .bench_local(|| contact::estimate_with(black_box(&samples), &prior, &mut room).unwrap());
}

#[divan::bench(sample_count = 30)]
fn batch_out_of_cache(bencher: Bencher) {
    track(bencher, OUT_OF_CACHE);
}

fn stream(bencher: Bencher, start: fn(&Filter) -> Stream, restart_each: usize) {
    let ((dx_m, load_n), fresh) = (channels(SAMPLES), start(&filter()));
    bencher.counter(ItemsCount::new(SAMPLES)).bench_local(|| {
        let mut stream = fresh;
        let mut sum_m = 0.0;
        for (dx_m, load_n) in dx_m.chunks(restart_each).zip(load_n.chunks(restart_each)) {
            stream.restart();
            for (y, u) in dx_m.iter().zip(load_n) {
                sum_m += stream.push(*y, *u).unwrap().s_m();
            }
        }
        sum_m
    });
}

#[divan::bench]
fn stream_even(bencher: Bencher) {
    stream(bencher, Stream::constant_time, SAMPLES);
}

#[divan::bench]
fn stream_even_unsettled(bencher: Bencher) {
    stream(bencher, Stream::constant_time, UNSETTLED);
}

#[divan::bench]
fn stream_as_batch(bencher: Bencher) {
    stream(bencher, Stream::steady_state, SAMPLES);
}

#[divan::bench]
fn gap_of_the_batch(bencher: Bencher) {
    let (s_m, _) = channels(SAMPLES);
    bencher.counter(ItemsCount::new(SAMPLES)).bench_local(|| gap::mid_range(black_box(&s_m)).unwrap());
}

#[divan::bench]
fn gap_running(bencher: Bencher) {
    let (s_m, _) = channels(SAMPLES);
    bencher.counter(ItemsCount::new(SAMPLES)).bench_local(|| {
        let mut gap = StreamingGap::<256>::new(2e-6).unwrap();
        black_box(&s_m).iter().for_each(|s| gap.push(*s));
        gap.read().unwrap()
    });
}

/// A product and two sums, each waiting for the one before: no recursion of this kind is shorter.
#[divan::bench]
fn floor_of_latency(bencher: Bencher) {
    let (dx_m, load_n) = channels(SAMPLES);
    bencher
        .counter(ItemsCount::new(SAMPLES))
        .bench_local(|| dx_m.iter().zip(&load_n).fold(black_box(0.5), |x: f64, (y, u)| (x * 0.5 + y) + u));
}

/// A sum in the order of the samples: each addition waits for the one before.
#[divan::bench]
fn floor_of_a_sum(bencher: Bencher) {
    let (dx_m, _) = channels(SAMPLES);
    bencher
        .counter(ItemsCount::new(SAMPLES))
        .bench_local(|| black_box(&dx_m).iter().fold(black_box(0.0), |sum: f64, y| sum + y));
}

/// Two columns read and one written, from memory.
#[divan::bench(sample_count = 30)]
fn floor_of_memory(bencher: Bencher) {
    let (dx_m, load_n) = channels(OUT_OF_CACHE);
    let mut s_m = vec![0.0; OUT_OF_CACHE];
    bencher.counter(ItemsCount::new(OUT_OF_CACHE)).bench_local(|| {
        for ((s, y), u) in black_box(&mut s_m).iter_mut().zip(&dx_m).zip(&load_n) {
            *s = y + u;
        }
    });
}
