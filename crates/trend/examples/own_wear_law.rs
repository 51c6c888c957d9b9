//! A wear law of your own: whether forecasts hold for a fleet that follows it.
//!
//! ```text
//! cargo run -p trend --example own_wear_law
//! ```
//! Replace [`gap_m`] by your law. The bank of laws is fixed (`CONTRIBUTING.md` shows how to add one); this example
//! measures how well it serves a law that is not one of its curves, so that you know before you rely on it.

#![allow(clippy::print_stdout, reason = "an example prints")]

use trend::{Error, FleetPrior, Observation, Series, Settings, UsageDefaults, assess};

/// Removal limit, m.
const LIMIT_M: f64 = 150e-6;
/// Length of a flight, h.
const FLIGHT_HOURS: f64 = 2.0;
/// Units of the fleet, and those of them that are assessed.
const UNITS: i64 = 40;

const fn day_us(day: i64) -> i64 {
    day * 86_400_000_000
}

/// The law: run-in, then wear that accelerates with the gap itself. Life differs from unit to unit.
fn gap_m(unit: i64, hours: f64) -> f64 {
    let life_hours = 1500.0 + 40.0 * unit as f64;
    let run_in_m = 10e-6 * (1.0 - (-hours / 60.0).exp());
    30e-6 + run_in_m + 110e-6 * ((1.5 * hours / life_hours).exp_m1() / 1.5_f64.exp_m1())
}

fn series(unit: i64, flights: i64) -> Result<Series, Error> {
    let flight = |k: i64| Observation {
        departure_us: day_us(k),
        installation: 0,
        flight_hours: Some(FLIGHT_HOURS),
        tail_hours_end: None,
        load_reversals: None,
        gap_m: Some(gap_m(unit, FLIGHT_HOURS * k as f64) + 2e-6 * (2.3 * (k + 31 * unit) as f64).sin()),
        gap_se_m: Some(1.5e-6),
    };
    Series::new((0..flights).map(flight), &UsageDefaults::default())
}

/// How many of the fleet's 90 % intervals hold the true crossing, at two thirds of each unit's life, and of how many.
fn coverage() -> Result<(usize, usize), Error> {
    let day = 600;
    let fleet: Vec<Series> = (0..UNITS).map(|unit| series(unit, day)).collect::<Result<_, _>>()?;
    let prior = FleetPrior::learn(&fleet, day_us(day), LIMIT_M, None);
    let settings = Settings::for_limit(LIMIT_M);
    let (mut held, mut all) = (0, 0);
    for (unit, series) in (0..UNITS).zip(&fleet) {
        let now_hours = FLIGHT_HOURS * day as f64;
        let reaches = |hours: &f64| gap_m(unit, now_hours + hours) >= LIMIT_M;
        let truth_hours = (0..20_000).map(f64::from).find(reaches).unwrap_or(f64::INFINITY);
        let Some(crossing) = assess(series, day_us(day), &settings, Some(&prior), None)?.crossing else {
            continue;
        };
        let (low, high) = (crossing.p05_hours, crossing.p95_hours);
        let is_held =
            low.is_some_and(|low| low <= truth_hours) && high.is_none_or(|high| truth_hours <= high);
        held += usize::from(is_held);
        all += 1;
    }
    Ok((held, all))
}

fn main() -> Result<(), Error> {
    let (held, all) = coverage()?;
    println!("{held} of {all} intervals of 90 % hold the true crossing");
    Ok(())
}

#[cfg(test)]
mod tests {
    #[test]
    fn most_intervals_hold_for_a_law_outside_the_bank() -> Result<(), trend::Error> {
        let (held, all) = super::coverage()?;
        assert!(all >= 30 && held * 10 >= all * 7, "{held} of {all}");
        Ok(())
    }
}
