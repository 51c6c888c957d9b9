//! The stated intervals against flights whose gap is known, over every class of simulated flights.

use crate::methods::{MethodResults, estimate_flight};
use crate::scenarios::{CLASSES, Class, Kind};
use rayon::prelude::*;

/// Flights of each class in a test, and in the gate; and the least share of intervals that hold.
const SIZES: [(u64, f64); 2] = [(1, 0.76), (3, 0.83)];
/// First flight, apart from those of the study.
const FIRST: u64 = 40_000;

/// Of 100 intervals 90 should hold. With some 200 flights chance alone leaves 83 to 96, with 70 flights 76 to 99 (binomial,
/// 99.9 %); a miss of more than six standard errors is no chance.
#[test]
fn nine_in_ten_intervals_hold_and_no_blind_flight_is_estimated() {
    let (of_class, least) = SIZES[usize::from(crate::gate::is_gate())];
    let flights: Vec<(&Class, u64)> =
        CLASSES.iter().flat_map(|class| (FIRST..FIRST + of_class).map(move |index| (class, index))).collect();
    assert!(flights.len() >= 68 * of_class as usize, "{} flights", flights.len());
    let results: Vec<(&Class, MethodResults)> =
        flights.par_iter().map(|(class, index)| (*class, estimate_flight(class, *index).unwrap())).collect();
    let (mut held, mut estimated, mut refused, mut far) = (0_usize, 0_usize, 0_usize, Vec::new());
    for (class, result) in &results {
        let is_blind = matches!(class.kind, Kind::Blind(_));
        let Some((gap_m, low_m, high_m)) = result.contact else {
            refused += usize::from(!is_blind);
            continue;
        };
        assert!(!is_blind, "{}, flight {}: {} µm", class.name, result.index, 1e6 * gap_m);
        estimated += 1;
        held += usize::from((low_m..=high_m).contains(&result.truth_m));
        let errors = (gap_m - result.truth_m).abs() / ((high_m - low_m) / (2.0 * 1.645));
        if errors > 6.0 {
            far.push(format!("{} {}: {errors:.1} standard errors", class.name, result.index));
        }
    }
    let share = held as f64 / estimated as f64;
    assert!((least..=0.99).contains(&share), "{held} of {estimated} intervals hold; far off: {far:?}");
    assert!(far.len() * 100 <= estimated, "{far:?}");
    assert!(refused * 25 <= estimated, "{refused} of {estimated} sound flights were refused");
}
