//! Usage and order of a unit's flights.

use proptest::prelude::*;
use trend::{Observation, Series};

use crate::histories::{self, DAY_US};

fn row(day: i64, installation: u32, hours: Option<f64>, meter: Option<f64>) -> Observation {
    Observation {
        installation,
        flight_hours: hours,
        tail_hours_end: meter,
        load_reversals: Some(100),
        ..histories::row(day, DAY_US, 2.0, 10.0, 1.0)
    }
}

fn hours(rows: &[Observation]) -> Vec<f64> {
    histories::series(rows.iter().copied()).flights().iter().map(|f| f.hours).collect()
}

#[test]
fn flights_without_a_row_count_through_the_hour_meter() {
    let rows = [row(0, 1, Some(2.0), Some(102.0)), row(9, 1, Some(2.0), Some(112.0))];
    let series = histories::series(rows);
    let last = series.flights()[1];
    // 2 h, then 8 h unseen and 2 h more: four flights of 2 h, hence four times 100 reversals, went unseen.
    assert_eq!((last.hours, last.flights, last.reversals), (12.0, 6.0, 600.0));
}

/// The meter of another tail is never compared with that of the last one; a meter that is missing or runs backwards leaves the
/// flight's own hours; and a refused flight is usage.
#[test]
fn hours_follow_the_meter_of_one_installation_and_else_the_flights() {
    let flown = |day, installation, meter| row(day, installation, Some(2.0), meter);
    let refused = Observation { gap_m: None, gap_se_m: None, ..flown(1, 1, None) };
    let unstated = row(4, 1, None, None);
    let (first, unmetered) = (flown(0, 1, Some(102.0)), flown(1, 1, None));
    let (back, late) = (flown(3, 1, Some(3.0)), flown(2, 1, Some(106.5)));
    for (rows, expected) in [
        (vec![first, flown(1, 2, Some(9000.0)), flown(2, 2, Some(9004.0))], vec![2.0, 4.0, 8.0]),
        (vec![first, unmetered, late, back, unstated], vec![2.0, 4.0, 6.5, 8.5, 10.0]),
        (vec![flown(0, 1, None), refused, flown(2, 1, None)], vec![2.0, 4.0, 6.0]),
    ] {
        assert_eq!(hours(&rows), expected);
    }
}

#[test]
fn numbers_that_cannot_be_are_refused_by_name() {
    let bad = Observation { gap_se_m: Some(0.0), ..row(1, 1, None, None) };
    let text = Series::new([bad]).unwrap_err().to_string();
    assert!(text.starts_with("gap_se_m of the flight departing at 86400000000 µs is 0"), "{text}");
}

prop_compose! {
    fn any_row()(
        day in 0_i64..30, installation in 0_u32..3, hours in prop::option::of(0.5..4.0), meter in prop::option::of(0.0..500.0),
        load_reversals in prop::option::of(0_u64..300), gap_m in prop::option::of(0.0..1e-4), gap_se_m in prop::option::of(1e-7..1e-5),
    ) -> Observation {
        Observation { load_reversals, gap_m, gap_se_m, ..row(day, installation, hours, meter) }
    }
}

proptest! {
    /// Late logs, and logs processed twice, must give the series that on-time ones gave. Usage never falls.
    #[test]
    fn the_order_of_arrival_changes_no_bit(
        (rows, shuffled) in prop::collection::vec(any_row(), 0..40)
            .prop_flat_map(|rows| (Just(rows.clone()), Just(rows).prop_shuffle()))
    ) {
        let (series, late) = (histories::series(rows), histories::series(shuffled));
        prop_assert_eq!(format!("{series:?}"), format!("{late:?}"));
        prop_assert!(series.flights().is_sorted_by(|a, b| a.hours <= b.hours && a.flights < b.flights && a.reversals <= b.reversals));
    }

    /// A backtest cuts a series; what is left must be what was known then.
    #[test]
    fn a_series_cut_at_a_day_is_the_series_of_that_day(rows in prop::collection::vec(any_row(), 0..40), day in 0_i64..30) {
        let as_of_us = day * DAY_US;
        let known = rows.iter().copied().filter(|r| r.departure_us <= as_of_us);
        let then = histories::series(known);
        let now = histories::series(rows.iter().copied());
        prop_assert_eq!(format!("{:?}", now.flights_until(as_of_us)), format!("{:?}", then.flights()));
    }
}
