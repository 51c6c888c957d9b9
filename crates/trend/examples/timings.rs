//! Cost of an assessment: time per serial against the length of its history, on one and two threads.
//!
//! `timings [SERIALS]` makes wearing units of 100 to 10,000 flights and prints the time for the series, the
//! assessment and the prior: processor time, which other programs affect less, and wall time.
#![allow(clippy::print_stdout, clippy::unwrap_used, reason = "a developer's tool, which may fail loudly")]

mod random;

use std::time::Instant;

use random::Random;
use rayon::prelude::*;
use trend::{Executor, FleetPrior, Observation, Series, Settings, UsageDefaults, assess};

const LIMIT_M: f64 = 1e-4;
const FLIGHT_US: i64 = 30_000_000_000;

fn rows(seed: u64, flights: usize) -> Vec<Observation> {
    let mut random = Random::new(seed);
    let (life, exponent, worn) =
        (random.between(2500.0, 6500.0), random.between(0.6, 1.8), random.between(0.0, 0.4));
    (0..flights)
        .map(|flight| {
            let hours = 1.7 * (flight + 1) as f64;
            let age = hours / life + worn;
            let outlier = if random.uniform() < 0.02 { 30.0 } else { 0.0 };
            let gap_um = 20.0 + 80.0 * age.powf(exponent) + 3.0 * random.normal() + outlier;
            Observation {
                departure_us: flight as i64 * FLIGHT_US,
                installation: 0,
                flight_hours: Some(1.7),
                tail_hours_end: Some(hours),
                load_reversals: Some((100.0 + 100.0 * random.uniform()) as u64),
                gap_m: Some(gap_um * 1e-6),
                gap_se_m: Some(3e-6),
            }
        })
        .collect()
}

/// Processor time of this thread, or wall time where the system does not count it, seconds.
fn busy_s(began: Instant) -> f64 {
    let counted = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let ns = counted.and_then(|text| text.split(' ').next()?.parse::<f64>().ok());
    ns.map_or_else(|| began.elapsed().as_secs_f64(), |ns| ns * 1e-9)
}

/// Processor time of some work, seconds, and its result.
fn cost<T>(work: impl FnOnce() -> T) -> (f64, T) {
    let began = Instant::now();
    let before_s = busy_s(began);
    let made = work();
    (busy_s(began) - before_s, made)
}

/// Threads that share the work, as those of a run do.
struct Threads(rayon::ThreadPool);

impl Threads {
    fn new(count: usize) -> Self {
        Self(rayon::ThreadPoolBuilder::new().num_threads(count).build().unwrap())
    }
}

impl Executor for Threads {
    fn map<T: Sync, R: Send>(&self, things: &[T], work: impl Fn(&T) -> R + Send + Sync) -> Vec<R> {
        self.0.install(|| things.par_iter().map(work).collect())
    }
}

/// The prior of a fleet by some threads: wall seconds.
fn learned(fleet: &[Series], as_of_us: i64, threads: &Threads) -> f64 {
    let began = Instant::now();
    std::hint::black_box(FleetPrior::learn_with(fleet, as_of_us, LIMIT_M, None, threads));
    began.elapsed().as_secs_f64()
}

/// Assessments of a fleet on some threads: wall seconds.
fn assess_fleet(fleet: &[Series], as_of_us: i64, prior: &FleetPrior, threads: &Threads) -> f64 {
    let settings = Settings::for_limit(LIMIT_M);
    let state = |series: &Series| {
        std::hint::black_box(assess(series, as_of_us, &settings, Some(prior), None).unwrap());
    };
    let began = Instant::now();
    threads.0.install(|| fleet.par_iter().for_each(state));
    began.elapsed().as_secs_f64()
}

fn main() {
    let serials: u64 = std::env::args().nth(1).map_or(200, |n| n.parse().unwrap());
    let threads = [1, 2].map(Threads::new);
    println!("processor time of a serial, µs    by the clock, an assessment, µs, on    the prior, ms, on");
    println!("flights    series  assessment            1 thread  2 threads         1 thread  2 threads");
    for flights in [100, 300, 1000, 3000, 10_000] {
        let rows: Vec<Vec<Observation>> = (0..serials).map(|seed| rows(seed, flights)).collect();
        let us = 1e6 / serials as f64;
        let unit = |rows| Series::new(rows, &UsageDefaults::default()).unwrap();
        let (series_s, fleet) = cost(|| rows.into_iter().map(unit).collect::<Vec<Series>>());
        let as_of_us = flights as i64 * FLIGHT_US;
        let prior = FleetPrior::learn(&fleet, as_of_us, LIMIT_M, None);
        let settings = Settings::for_limit(LIMIT_M);
        let (statement_s, ()) = cost(|| {
            for series in &fleet {
                std::hint::black_box(assess(series, as_of_us, &settings, Some(&prior), None).unwrap());
            }
        });
        let stated_s = threads.each_ref().map(|threads| assess_fleet(&fleet, as_of_us, &prior, threads) * us);
        let learned_s = threads.each_ref().map(|threads| learned(&fleet, as_of_us, threads) * 1e3);
        println!(
            "{flights:7}  {:8.1}  {:9.1}  {:19.1}  {:9.1}  {:15.0}  {:9.0}",
            series_s * us,
            statement_s * us,
            stated_s[0],
            stated_s[1],
            learned_s[0],
            learned_s[1]
        );
    }
}
