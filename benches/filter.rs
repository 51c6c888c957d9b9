//! Time of each implementation of the filter for 16 384 samples in cache, with the lower bounds of the machine measured
//! in the same run: the shortest chain of dependent operations of a step, a sum in the order of the samples, and
//! memory.
//!
//! `batch_in_a_room` reuses its memory and the settled gain.
//!
//! `stream_even` restarts before the gain settles, or runs on long after: a step takes the same.

#![allow(clippy::unwrap_used, reason = "a benchmark that cannot go on has failed")]

mod made_flight;

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use estimator::contact::{self, PartPrior};
use estimator::{Filter, GainSchedule, Samples, Stream, gap, midrange};
use made_flight::{STEP_S, channels};

/// Number of samples whose positions, loads and S fit into the second-level cache.
const SAMPLES: usize = 16_384;
/// Number of samples whose columns fit into no cache.
const OUT_OF_CACHE: usize = 2_097_152;
const COUNTS: [usize; 3] = [512, SAMPLES, OUT_OF_CACHE];
/// The gain settles in hundreds of steps.
const UNSETTLED: usize = 64;

fn main() {
    divan::main();
}

fn filter() -> Filter {
    made_flight::filter().unwrap()
}

#[divan::bench]
fn schedule(bencher: Bencher) {
    let filter = filter();
    bencher.bench_local(|| GainSchedule::new(black_box(&filter)));
}

/// Calls `run` with as many samples.
fn over<T>(bencher: Bencher, count: usize, mut run: impl FnMut(&Samples<'_>) -> T) {
    let ([motor_m, dx_m, load_n], whole) = (channels(count), 0..count);
    let segments = std::slice::from_ref(&whole);
    let samples = Samples { step_s: STEP_S, motor_m: &motor_m, dx_m: &dx_m, load_n: &load_n, segments };
    bencher.counter(ItemsCount::new(count)).bench_local(|| run(black_box(&samples)));
}

/// The settled gain is to be found. Of the fewest samples an eighth comes before the gain has settled.
#[divan::bench(args = COUNTS, sample_count = 30)]
fn batch(bencher: Bencher, count: usize) {
    let filter = filter();
    over(bencher, count, |samples| GainSchedule::new(&filter).track(samples, &mut Vec::new()).unwrap());
}

#[divan::bench(args = COUNTS, sample_count = 30)]
fn batch_in_a_room(bencher: Bencher, count: usize) {
    let (schedule, mut room) = (GainSchedule::new(&filter()), Vec::new());
    over(bencher, count, |samples| schedule.track(samples, &mut room).unwrap());
}

#[divan::bench(args = COUNTS, sample_count = 30)]
fn published_estimate(bencher: Bencher, count: usize) {
    let (schedule, mut room) = (GainSchedule::new(&filter()), Vec::new());
    over(bencher, count, |samples| midrange::estimate_with(samples, &schedule, &mut room).unwrap());
}

#[divan::bench(args = COUNTS, sample_count = 30)]
fn load_band(bencher: Bencher, count: usize) {
    over(bencher, count, |samples| gap::load_band(samples.load_n, samples.segments));
}

#[divan::bench(sample_count = 10)]
fn contact_regression(bencher: Bencher) {
    let (prior, mut room) = (PartPrior::of_stiffness(5e7), contact::ContactWorkspace::default());
    over(bencher, OUT_OF_CACHE, |samples| contact::estimate(samples, &prior, &mut room).unwrap());
}

fn stream(bencher: Bencher, start: fn(&Filter) -> Stream, restart_each: usize) {
    let ([_, dx_m, load_n], fresh) = (channels(SAMPLES), start(&filter()));
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

#[divan::bench(args = [SAMPLES, UNSETTLED])]
fn stream_even(bencher: Bencher, restart_each: usize) {
    stream(bencher, Stream::constant_time, restart_each);
}

#[divan::bench]
fn stream_as_batch(bencher: Bencher) {
    stream(bencher, Stream::steady_state, SAMPLES);
}

#[divan::bench]
fn gap_of_the_batch(bencher: Bencher) {
    let [_, s_m, _] = channels(SAMPLES);
    bencher.counter(ItemsCount::new(SAMPLES)).bench_local(|| gap::mid_range(black_box(&s_m)).unwrap());
}

/// A product and two sums, each waiting for the one before: no recursion of this kind is shorter.
#[divan::bench]
fn floor_of_latency(bencher: Bencher) {
    let [_, dx_m, load_n] = channels(SAMPLES);
    bencher
        .counter(ItemsCount::new(SAMPLES))
        .bench_local(|| dx_m.iter().zip(&load_n).fold(black_box(0.5), |x: f64, (y, u)| (x * 0.5 + y) + u));
}

/// A sum in the order of the samples: each addition waits for the one before.
#[divan::bench]
fn floor_of_a_sum(bencher: Bencher) {
    let [_, dx_m, _] = channels(SAMPLES);
    bencher
        .counter(ItemsCount::new(SAMPLES))
        .bench_local(|| black_box(&dx_m).iter().fold(black_box(0.0), |sum: f64, y| sum + y));
}

/// Two columns read and one written, from memory.
#[divan::bench(sample_count = 30)]
fn floor_of_memory(bencher: Bencher) {
    let [_, dx_m, load_n] = channels(OUT_OF_CACHE);
    let mut s_m = vec![0.0; OUT_OF_CACHE];
    bencher.counter(ItemsCount::new(OUT_OF_CACHE)).bench_local(|| {
        for ((s, y), u) in black_box(&mut s_m).iter_mut().zip(&dx_m).zip(&load_n) {
            *s = y + u;
        }
    });
}
