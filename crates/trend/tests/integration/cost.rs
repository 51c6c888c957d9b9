//! The cost of an assessment grows with the number of flights, and no faster.

use std::time::{Duration, Instant};

use trend::{Observation, Series, UsageDefaults, assess};

use crate::histories::{DAY_US, settings};
use crate::random::Random;

/// A unit whose neighbouring flights share most of their error, with a step every few hundred flights.
fn unit(seed: u64, flights: i64, rho: f64, step_um: f64) -> Series {
    let mut random = Random::new(seed);
    let mut error_um = 0.0;
    let row = |flight: i64| {
        error_um = rho * error_um + (1.0 - rho * rho).sqrt() * random.normal();
        let stepped_um = step_um * ((flight / 300) % 2) as f64;
        Observation {
            departure_us: flight * DAY_US / 2,
            flight_hours: Some(2.0),
            gap_m: Some((40.0 + 0.002 * flight as f64 + stepped_um + error_um) * 1e-6),
            gap_se_m: Some(1e-6),
            ..Observation::default()
        }
    };
    Series::new((0..flights).map(row), &UsageDefaults::default()).unwrap()
}

/// Shortest of several times to assess twenty units of each length, which take turns.
fn times(lengths: [i64; 2], rho: f64, step_um: f64) -> [Duration; 2] {
    let units =
        lengths.map(|flights| (0..20).map(|seed| unit(seed, flights, rho, step_um)).collect::<Vec<_>>());
    let once = |units: &[Series]| {
        let begin = Instant::now();
        for series in units {
            assess(series, i64::MAX / 2, &settings(), None).unwrap();
        }
        begin.elapsed()
    };
    let rounds: Vec<[Duration; 2]> = (0..6).map(|_| [once(&units[0]), once(&units[1])]).collect();
    [0, 1].map(|of| rounds.iter().map(|round| round[of]).min().unwrap_or_default())
}

/// Exponents of 1.0 to 1.1 on a machine of its own; a quadratic search has two.
#[test]
fn time_grows_in_proportion_to_flights() {
    for (name, rho, step_um) in [("calm", 0.0, 0.0), ("autocorrelated", 0.8, 0.0), ("steps", 0.0, 15.0)] {
        let [short, long] = times([1_500, 6_000], rho, step_um).map(|time| time.as_secs_f64());
        let exponent = (long / short).log(4.0);
        println!("{name}: {:.2} ms, {:.2} ms a unit, exponent {exponent:.2}", short * 50.0, long * 50.0);
        assert!(exponent <= 1.5, "{name}: {exponent}");
    }
}
