//! The cost of an assessment grows with the number of flights, and no faster.

use std::time::Instant;

use trend::{Series, UnitOnTail, assess, tail_wide_steps};

use crate::histories::{self, DAY_US, settings};
use crate::random::Random;

/// A unit whose neighbouring flights share most of their error, with a step every few hundred flights.
fn unit(seed: u64, flights: i64, rho: f64, step_um: f64) -> Series {
    let mut random = Random::new(seed);
    let mut error_um = 0.0;
    let row = |flight: i64| {
        error_um = rho * error_um + (1.0 - rho * rho).sqrt() * random.normal();
        let stepped_um = step_um * ((flight / 300) % 2) as f64;
        let gap_um = 40.0 + 0.002 * flight as f64 + stepped_um + error_um;
        histories::row(flight, DAY_US / 2, 2.0, gap_um, 1.0)
    };
    histories::series((0..flights).map(row))
}

/// Asserts that two works, the second of which has four times the size of the first, take times in proportion: the exponent is
/// 1.0 to 1.1 on a machine of its own; a quadratic search has two.
fn assert_proportional(name: &str, mut work: impl FnMut(usize)) {
    let mut shortest_s = [f64::INFINITY; 2];
    for round in 0..12 {
        let begin = Instant::now();
        work(round % 2);
        shortest_s[round % 2] = shortest_s[round % 2].min(begin.elapsed().as_secs_f64());
    }
    let [short_s, long_s] = shortest_s;
    let exponent = (long_s / short_s).log(4.0);
    assert!(exponent <= 1.5, "{name}: {short_s} s and {long_s} s, exponent {exponent}");
}

#[test]
fn time_grows_in_proportion_to_flights() {
    for (name, rho, step_um) in [("calm", 0.0, 0.0), ("autocorrelated", 0.8, 0.0), ("steps", 0.0, 15.0)] {
        let units = |flights| (0..20).map(|seed| unit(seed, flights, rho, step_um)).collect::<Vec<_>>();
        let units = [1_500, 6_000].map(units);
        let assess = |series| assess(series, i64::MAX / 2, &settings(), None).unwrap();
        assert_proportional(name, |of| units[of].iter().for_each(|series| drop(assess(series))));
    }
}

/// One tail with a step of all of its four units every ten days.
#[test]
fn time_grows_in_proportion_to_the_steps_of_a_tail() {
    let tails = [32_000, 128_000].map(|steps: i64| {
        let steps: Vec<(i64, f64)> = (1..=steps).map(|k| (10 * k * DAY_US, 15e-6)).collect();
        vec![UnitOnTail { first_us: 0, last_us: i64::MAX, steps }; 4]
    });
    let mut found = [0, 0];
    assert_proportional("steps of a tail", |of| found[of] = tail_wide_steps(&tails[of]).len());
    assert_eq!(found, [32_000, 128_000]);
}
