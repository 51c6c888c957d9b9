//! What a statement costs: time per serial against the length of its history, on one thread.
//!
//! `cost [SERIALS]` makes wearing units of 100 to 4,000 flights and prints microseconds for the series,
//! the statement and the prior.
#![allow(clippy::print_stdout, clippy::unwrap_used, reason = "a developer's tool, which may fail loudly")]

mod random;

use std::time::Instant;

use random::Random;
use trend::{FleetPrior, Observation, Series, Settings, Usage, trend};

const LIMIT_M: f64 = 1e-4;

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
                departure_us: flight as i64 * 30_000_000_000,
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

fn main() {
    let serials: u64 = std::env::args().nth(1).map_or(200, |n| n.parse().unwrap());
    println!("flights  series µs  statement µs  prior ms");
    for flights in [100, 300, 1000, 2000, 4000] {
        let rows: Vec<Vec<Observation>> = (0..serials).map(|seed| rows(seed, flights)).collect();
        let per_serial = |began: Instant| began.elapsed().as_secs_f64() * 1e6 / serials as f64;
        let began = Instant::now();
        let fleet: Vec<Series> =
            rows.into_iter().map(|rows| Series::new(rows, &Usage::default()).unwrap()).collect();
        let series_us = per_serial(began);
        let as_of_us = flights as i64 * 30_000_000_000;
        let began = Instant::now();
        let prior = FleetPrior::learn(&fleet, as_of_us, LIMIT_M, None);
        let prior_ms = began.elapsed().as_secs_f64() * 1e3;
        let began = Instant::now();
        for series in &fleet {
            std::hint::black_box(
                trend(series, as_of_us, &Settings::for_limit(LIMIT_M), Some(&prior), None).unwrap(),
            );
        }
        println!("{flights:7}  {series_us:9.1}  {:12.1}  {prior_ms:8.0}", per_serial(began));
    }
}
