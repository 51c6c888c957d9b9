//! Power, false alarms and dates of followed quantities, simulated: the table of docs/other-quantities.md.
//!
//! ```sh
//! cargo run --release -p trend --example quantity_power
//! ```
//!
//! Units fly three times a day. Errors of neighbouring flights are correlated with the given coefficient.
#![allow(clippy::print_stdout, reason = "the table is the output")]

#[allow(dead_code, reason = "examples use some of it each")]
mod random;

use random::Random;
use trend::quantity::QuantityValue;
use trend::quantity::changes::{self, QuantityChanges};

const DAY_US: i64 = 86_400_000_000;
/// Simulated units of each row.
const UNITS: u64 = 400;

fn main() {
    println!(
        "| change over 500 flights | limit | scatter | correlation | found | false alarms per unit-year |"
    );
    println!("|---|---|---|---|---|---|");
    for (size, limit, scatter, rho) in [
        (0.20, 0.10, 0.10, 0.0),
        (0.20, 0.10, 0.15, 0.0),
        (0.20, 0.10, 0.15, 0.3),
        (-0.10, 0.05, 0.002, 0.0),
        (-0.10, 0.05, 0.02, 0.3),
        (-0.10, 0.05, 0.05, 0.3),
    ] {
        let drifts = |seed: u64| {
            let values = flights(seed, 500, scatter, rho, |k| size * k as f64 / 500.0);
            is_beyond(&values, limit)
        };
        let alarms = |seed: u64| {
            let year = flights(seed, 1095, scatter, rho, |_| 0.0);
            (10..=365).step_by(5).any(|day| is_beyond(&year[..3 * day], limit))
        };
        let share = |count: usize| 100.0 * count as f64 / UNITS as f64;
        println!(
            "| {:+.0} % | {:.0} % | {} % | {rho} | {:.1} % | {:.2} % |",
            100.0 * size,
            100.0 * limit,
            100.0 * scatter,
            share((0..UNITS).filter(|seed| drifts(*seed)).count()),
            share((0..UNITS).filter(|seed| alarms(*seed)).count()),
        );
    }
    let dated = (0..UNITS).filter(|seed| {
        let at = 20 + (*seed as usize * 7) % 400;
        let values =
            flights(*seed, at + 3 + *seed as usize % 60, 0.01, 0.0, |k| if k < at { 0.0 } else { 0.06 });
        let Some(found) = changes::fit(&values, 1e-6) else { return false };
        let error_us = |us: i64| (us - values[at].departure_us).abs();
        found.steps.len() == 1 && found.steps.iter().all(|step| error_us(step.departure_us) <= DAY_US / 3)
    });
    let dated = dated.count();
    println!("\nsteps of six standard deviations dated within one flight: {dated} of {UNITS}");
}

fn is_beyond(values: &[QuantityValue], limit: f64) -> bool {
    let beyond = |found: QuantityChanges| found.change.abs() > limit + 0.5 * found.change_se;
    changes::fit(values, 1e-6).is_some_and(beyond)
}

fn flights(
    seed: u64,
    count: usize,
    scatter: f64,
    rho: f64,
    change: impl Fn(usize) -> f64,
) -> Vec<QuantityValue> {
    let mut random = Random::new(seed + 1);
    let mut error = scatter * random.normal();
    let value = |k: usize| {
        error = rho * error + (1.0 - rho * rho).sqrt() * scatter * random.normal();
        QuantityValue {
            departure_us: k as i64 * DAY_US / 3,
            usage_hours: 2.0 * k as f64,
            value: 1.0 + error + change(k),
            se: 0.3 * scatter,
            temperature_c: None,
            ln_load: None,
        }
    };
    (0..count).map(value).collect()
}
