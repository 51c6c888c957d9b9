//! A prior from your own fleet: what its older units show, a new unit is assessed with.
//!
//! ```text
//! cargo run -p trend --example own_prior
//! ```

#![allow(clippy::print_stdout, reason = "an example prints")]

use std::error::Error;

use trend::{Assessment, FleetPrior, Observation, Series, Settings, UsageDefaults, assess};

/// Removal limit, m.
const LIMIT_M: f64 = 100e-6;
/// Length of a flight, h.
const FLIGHT_HOURS: f64 = 1.5;

const fn day_us(day: i64) -> i64 {
    day * 86_400_000_000
}

/// Flights of a unit, one a day: a gap that grows from 20 µm, with a scatter of 1 µm.
fn unit(first_day: i64, flights: i64, growth_m_per_flight: f64) -> Result<Series, trend::Error> {
    let flight = |k: i64| Observation {
        departure_us: day_us(first_day + k),
        installation: 0,
        flight_hours: Some(FLIGHT_HOURS),
        tail_hours_end: None,
        load_reversals: None,
        gap_m: Some(20e-6 + growth_m_per_flight * k as f64 + 1e-6 * (1.7 * (first_day + k) as f64).sin()),
        gap_se_m: Some(1e-6),
    };
    Series::new((0..flights).map(flight), &UsageDefaults::default())
}

/// A unit of 60 flights, without and with the prior of forty older ones.
fn assess_young_unit() -> Result<[Assessment; 2], Box<dyn Error>> {
    let today = 1000;
    let fleet: Vec<Series> =
        (0..40).map(|k| unit(0, 600, 80e-9 + 2e-9 * f64::from(k))).collect::<Result<_, _>>()?;
    let prior = FleetPrior::learn(&fleet, day_us(today), LIMIT_M, None);
    let young = unit(today - 60, 60, 120e-9)?;
    let settings = Settings::for_limit(LIMIT_M);
    let alone = assess(&young, day_us(today), &settings, None, None)?;
    let with_fleet = assess(&young, day_us(today), &settings, Some(&prior), None)?;
    Ok([alone, with_fleet])
}

fn main() -> Result<(), Box<dyn Error>> {
    for (name, assessment) in ["alone", "with the fleet"].iter().zip(assess_young_unit()?) {
        let crossing = assessment.crossing.ok_or("no forecast")?;
        println!(
            "{name}: limit reached after {:?} to {:?} flight hours",
            crossing.p05_hours, crossing.p95_hours
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The unit grows linearly: 80 µm at 120 nm a flight, of which 60 flights are flown.
    #[test]
    fn the_fleet_narrows_the_forecast_of_a_young_unit_around_the_truth() -> Result<(), Box<dyn Error>> {
        let [alone, with_fleet] = assess_young_unit()?;
        let bounds = |assessment: Assessment| {
            let crossing = assessment.crossing.ok_or("no forecast")?;
            Ok::<_, Box<dyn Error>>((
                crossing.p05_hours.ok_or("no early bound")?,
                crossing.p95_hours.unwrap_or(f64::INFINITY),
            ))
        };
        let truth_hours = FLIGHT_HOURS * (80e-6 / 120e-9 - 60.0);
        let (alone, with_fleet) = (bounds(alone)?, bounds(with_fleet)?);
        assert!(
            with_fleet.0 < truth_hours && truth_hours < with_fleet.1,
            "{with_fleet:?}, true {truth_hours}"
        );
        assert!(with_fleet.1 / with_fleet.0 < alone.1 / alone.0, "{with_fleet:?}, alone {alone:?}");
        Ok(())
    }
}
