//! Time of each way through the filter for 16 384 samples, in cache, beside the two floors of the
//! machine measured on the spot: the shortest chain of operations a step must wait for, and memory.
//!
//! `even_unsettled` restarts before the gain settles, `even` runs on long after: a step takes the same.

#![allow(clippy::unwrap_used, reason = "a benchmark that cannot go on has failed")]

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use estimator::noise::Sensors;
use estimator::{Actuator, Filter, Noise, RunningGap, Samples, Stream, gap};

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
    let actuator = Actuator::linear(5e7, 2000.0, 8.0).unwrap();
    let noise = Noise::Sensors(Sensors {
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
fn batch(bencher: Bencher) {
    track(bencher, SAMPLES);
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
                sum_m += stream.push(*y, *u).unwrap();
            }
        }
        sum_m
    });
}

#[divan::bench]
fn stream_even(bencher: Bencher) {
    stream(bencher, Stream::even, SAMPLES);
}

#[divan::bench]
fn stream_even_unsettled(bencher: Bencher) {
    stream(bencher, Stream::even, UNSETTLED);
}

#[divan::bench]
fn stream_as_batch(bencher: Bencher) {
    stream(bencher, Stream::as_batch, SAMPLES);
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
        let mut gap = RunningGap::<256>::new(2e-6).unwrap();
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
