//! A wear law of your own: whether forecasts hold for a fleet that follows it.
//!
//! ```text
//! cargo run -p trend --example own_wear_law
//! ```
//! Replace [`gap_m`] by your law. The bank of laws is fixed (`CONTRIBUTING.md` shows how to add one); this example
//! measures how well it serves a law that is not one of its curves, so that you know before you rely on it.
//! The intervals learn from units that wore out: in a fleet where none has reached the limit yet, forecasts under this
//! law are early, and 2 of 40 intervals hold.

#![allow(clippy::print_stdout, reason = "an example prints")]

use trend::{Error, FleetPrior, Observation, Series, Settings, UsageDefaults, assess};

/// Removal limit, m.
const LIMIT_M: f64 = 150e-6;
/// Length of a flight, h.
const FLIGHT_HOURS: f64 = 2.0;
/// Units that wore out already, and as many younger ones that are assessed.
const UNITS: i64 = 40;
/// Day of the assessment: later than the last removal.
const TODAY: i64 = 1800;

const fn day_us(day: i64) -> i64 {
    day * 86_400_000_000
}

/// Life of a unit until the limit, h.
fn life_hours(unit: i64) -> f64 {
    1500.0 + 40.0 * (unit % UNITS) as f64
}

/// The law: running in, then wear that accelerates.
fn gap_m(unit: i64, hours: f64) -> f64 {
    let run_in_m = 10e-6 * (1.0 - (-hours / 60.0).exp());
    30e-6 + run_in_m + 110e-6 * ((1.5 * hours / life_hours(unit)).exp_m1() / 1.5_f64.exp_m1())
}

/// The unit's flights from new, one a day: until a share of its life, of which the last is on a given day.
fn series(unit: i64, life_share: f64, last_day: i64) -> Result<Series, Error> {
    let flights = (life_share * life_hours(unit) / FLIGHT_HOURS) as i64;
    let flight = |k: i64| Observation {
        departure_us: day_us(last_day - flights + k),
        installation: 0,
        flight_hours: Some(FLIGHT_HOURS),
        tail_hours_end: None,
        load_reversals: None,
        gap_m: Some(gap_m(unit, FLIGHT_HOURS * k as f64) + 2e-6 * (2.3 * (k + 31 * unit) as f64).sin()),
        gap_se_m: Some(1.5e-6),
    };
    Series::new((1..=flights).map(flight), &UsageDefaults::default())
}

/// Of units at two thirds of their life: 90 % intervals that hold the true crossing, forecasts that are late (the true
/// crossing comes before the 5 % point), and units.
fn coverage() -> Result<[usize; 3], Error> {
    let past = (0..UNITS).map(|unit| series(unit, 1.0, TODAY - 10 * (unit % 20)));
    let young: Vec<Series> =
        (UNITS..2 * UNITS).map(|unit| series(unit, 2.0 / 3.0, TODAY)).collect::<Result<_, _>>()?;
    let fleet: Vec<Series> = past.chain(young.iter().cloned().map(Ok)).collect::<Result<_, _>>()?;
    let prior = FleetPrior::learn(&fleet, day_us(TODAY), LIMIT_M, None);
    let settings = Settings::for_limit(LIMIT_M);
    let (mut held, mut late, mut all) = (0, 0, 0);
    for (unit, series) in (UNITS..2 * UNITS).zip(&young) {
        let truth_hours = life_hours(unit) / 3.0;
        let assessment = assess(series, day_us(TODAY), &settings, Some(&prior), None)?;
        let Some(crossing) = assessment.crossing else { continue };
        let is_late = crossing.p05_hours.is_none_or(|low| truth_hours < low);
        let is_early = crossing.p95_hours.is_some_and(|high| high < truth_hours);
        held += usize::from(!is_late && !is_early);
        late += usize::from(is_late);
        all += 1;
    }
    Ok([held, late, all])
}

fn main() -> Result<(), Error> {
    let [held, late, all] = coverage()?;
    println!("{held} of {all} intervals of 90 % hold the true crossing; {late} forecasts are late");
    Ok(())
}

#[cfg(test)]
mod tests {
    /// Chance leaves 31 to 40 of 40 when nine in ten hold (binomial, 99 %), and at most 7 late (5 %).
    #[test]
    fn intervals_hold_for_a_law_outside_the_bank() -> Result<(), trend::Error> {
        let [held, late, all] = super::coverage()?;
        assert!(all == 40 && held >= 31 && late <= 7, "{held} hold and {late} are late of {all}");
        Ok(())
    }
}
