//! Steps and resets: when they happened, how large they were.

use trend::{Observation, Series, Settings, assess};

use crate::histories::{self, DAY_US};
use crate::random::Random;

/// A sparsely logged unit: one log in eleven days, in which it wears by `growth_um`, with a fall before a flight.
fn series(seed: u64, flights: i64, growth_um: f64, (at, fall_um): (i64, f64)) -> Series {
    let mut random = Random::new(seed);
    let row = |flight: i64| {
        let gap_um = 30.0 + growth_um * flight as f64 - if flight < at { 0.0 } else { fall_um };
        // Flights without a log are in the meter alone.
        let row = histories::row(flight, 11 * DAY_US, 44.0, gap_um + random.normal(), 1.0);
        Observation { flight_hours: Some(2.0), ..row }
    };
    histories::series((0..flights).map(row))
}

/// Dates of at least 95 of 100 falls within one flight of where they happened, and sizes without the growth from one
/// flight to the next.
#[test]
fn falls_beyond_five_standard_errors_are_dated_at_their_flight_and_sized_without_growth() {
    for (fall_um, growth_um) in [(12.0, 0.25), (40.0, 2.0), (76.0, 2.0)] {
        let (mut found, mut near, mut sizes) = (0, 0, Vec::new());
        for seed in 0..100 {
            let flights = 24 + (seed % 3) as i64 * 12;
            let at = 8 + (seed * 7 % 9) as i64;
            let series = series(seed, flights, growth_um, (at, fall_um));
            let settings = Settings::for_limit(2e-4);
            let assessment = assess(&series, i64::MAX / 2, &settings, None).unwrap();
            let change = assessment.changes.iter().filter(|change| change.step_m < 0.0);
            let Some(change) = change.min_by(|a, b| a.step_m.total_cmp(&b.step_m)) else { continue };
            found += 1;
            near += usize::from((change.departure_us / (11 * DAY_US) - at).abs() <= 1);
            sizes.push((change.step_m * 1e6 + fall_um, change.se_m * 1e6));
        }
        let mean_um = sizes.iter().map(|s| s.0).sum::<f64>() / sizes.len() as f64;
        let within = sizes.iter().filter(|(off, se)| off.abs() <= 3.0 * se).count();
        println!(
            "{fall_um} µm: found {found}, within one flight {near}, off by {mean_um:.2} µm, {within} within 3 se"
        );
        assert!(found >= if fall_um > 15.0 { 95 } else { 50 }, "{fall_um}: {found}");
        assert!(near * 100 >= found * 95, "{fall_um}: {near} of {found}");
        assert!(mean_um.abs() < 0.5 && within * 100 >= found * 90, "{fall_um}: {mean_um} {within}");
    }
}
