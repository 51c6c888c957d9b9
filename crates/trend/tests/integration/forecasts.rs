//! Forecasts of young, fast and accelerating wear: seldom late, and their intervals hold.

use trend::{State, assess};

use crate::histories::{Drawn, HOURS, LIMIT_UM, prior, settings};

/// A class of wear g₀ + a·tᵖ: name, exponents, logs at the date of the forecast, calm logs before.
struct Class {
    name: &'static str,
    power: (f64, f64),
    logs: (usize, usize),
    calm: (usize, usize),
    error: f64,
}

const fn class(name: &'static str, power: (f64, f64), logs: (usize, usize), calm: (usize, usize)) -> Class {
    Class { name, power, logs, calm, error: 0.25 }
}

const CLASSES: [Class; 8] = [
    class("straight, 8-20 logs", (1.0, 1.0), (8, 20), (0, 0)),
    class("calm, then straight for 6-15 logs", (1.0, 1.0), (6, 15), (10, 200)),
    class("straight, 40-150 logs", (1.0, 1.0), (40, 150), (0, 0)),
    class("accelerating (1.5-2), 10-25 logs", (1.5, 2.0), (10, 25), (0, 0)),
    class("accelerating (2-3), 40-150 logs", (2.0, 3.0), (40, 150), (0, 0)),
    // Its end is far beyond any line: the earliest date is safe, the median is not good.
    Class { error: 1.0, ..class("accelerating (3-5), 10-60 logs", (3.0, 5.0), (10, 60), (0, 0)) },
    class("slowing (.5-.7), 40-150 logs", (0.5, 0.7), (40, 150), (0, 0)),
    class("accelerating (1.5-2.5), 20-50 logs", (1.5, 2.5), (20, 50), (0, 0)),
];

/// A unit cut below its limit, and its true hours left.
fn unit(class: &Class, seed: u64) -> (Drawn, f64) {
    let mut d = Drawn::new(seed, 1);
    let (power, share) = (d.between(class.power.0, class.power.1), d.between(0.35, 0.92));
    let (calm, logs) = (d.count(class.calm.0, class.calm.1), d.count(class.logs.0, class.logs.1));
    d.stay((calm, calm), (40.0, 90.0));
    let from_um = d.um;
    let to_um = from_um + share * (LIMIT_UM - from_um);
    d.logs(logs, |t| from_um + (to_um - from_um) * t.powf(power));
    let life = share.powf(-power.recip());
    (d, HOURS * logs as f64 * (life - 1.0))
}

/// Shares of late forecasts and of intervals that hold, median error, and the number of units without a forecast.
fn score(class: &Class) -> (f64, f64, f64, usize) {
    let (mut late, mut held, mut errors, mut none, mut count) = (0, 0, Vec::new(), 0, 0_usize);
    for (fleet, units) in [12, 40, 92].into_iter().enumerate() {
        let units: Vec<(Drawn, f64)> = (0..units).map(|k| unit(class, 10_000 * fleet as u64 + k)).collect();
        let prior = prior(units.iter().map(|(d, _)| d));
        for (drawn, left) in units {
            let found = assess(&drawn.series(), drawn.now_us(), &settings(), Some(&prior)).unwrap();
            count += 1;
            let Some(crossing) = found.crossing else {
                none += 1;
                continue;
            };
            let hours = |h: Option<f64>| h.unwrap_or(f64::INFINITY);
            let is_late = hours(crossing.p05_hours) > left;
            late += usize::from(is_late);
            held += usize::from(!is_late && left <= hours(crossing.p95_hours));
            errors.push((hours(crossing.p50_hours) - left).abs() / left);
            assert!(
                found.state >= State::Plan || left > 375.0,
                "{}: {} with {left} h left",
                class.name,
                found.reason
            );
        }
    }
    errors.sort_by(f64::total_cmp);
    let share = |n: usize| n as f64 / count as f64;
    (share(late), share(held), errors[errors.len() / 2], none)
}

#[test]
fn fast_wear_is_seldom_forecast_late() {
    let mut missed = Vec::new();
    for class in &CLASSES {
        let (late, held, error, none) = score(class);
        println!(
            "{}: late {late:.3}, held {held:.3}, median error {error:.3}, without forecast {none}",
            class.name
        );
        if late > 0.07 || held < 0.86 || error > class.error {
            missed.push(class.name);
        }
    }
    assert!(missed.is_empty(), "{missed:?}");
}
