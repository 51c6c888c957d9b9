//! The report of a partly logged fleet: each of its numbers is that of the assessments.
//!
//! The fleet flies 6 h a day, as its hour meters show; one flight in five leaves a log. Wear is a line: 20 µm when new,
//! limit 150 µm.

use std::collections::BTreeMap;
use std::path::Path;

use jiff::{SignedDuration, Timestamp};
use pipeline::assess::trends::{self, UnitSelection};
use pipeline::report::compose::compose;
use records::{GapRecord, Installations, TrendRow};
use report::{Report, UnitView};
use store::{LogResult, Store};

use crate::fleet::{self, config, day};

const DAY: SignedDuration = SignedDuration::from_hours(24);
const HOURS_A_DAY: f64 = 6.0;
const DAYS_A_LOG: i32 = 5;
const UNITS: i32 = 10;
const DAYS: i32 = 400;
const LIMIT_M: f64 = 150e-6;

/// The nth unit wears by 20 + 2 n µm in 1,000 h.
fn record(unit: i32, at: i32) -> GapRecord {
    fleet::worn(unit, at, "aileron_left", [20.0 + 2.0 * f64::from(unit), HOURS_A_DAY, 1.5])
}

fn assessed(store: &Store, as_of: Timestamp) -> BTreeMap<String, TrendRow> {
    let ask = UnitSelection { as_of_utc: Some(as_of), ..UnitSelection::default() };
    let rows = trends::assess_store(&config(), &Installations::default(), store, &ask).unwrap().now;
    rows.into_iter().map(|row| (row.serial_number.clone(), row)).collect()
}

fn close(a: f64, b: f64, share: f64) -> bool {
    (a - b).abs() <= share * b.abs()
}

fn store(folder: &Path) -> Store {
    let flown =
        (0..UNITS).flat_map(|unit| (0..DAYS).step_by(DAYS_A_LOG as usize).map(move |at| record(unit, at)));
    let results: Vec<LogResult> = flown.map(|record| fleet::result(vec![record])).collect();
    fleet::store(folder, &results)
}

#[test]
fn every_number_of_the_report_is_that_of_the_assessments() {
    let folder = tempfile::tempdir().unwrap();
    let store = store(folder.path());
    let as_of = day(DAYS - 1);
    let rows = assessed(&store, as_of);
    let ask = UnitSelection { as_of_utc: Some(as_of), ..UnitSelection::default() };
    let report = compose(&config(), &Installations::default(), &store, &ask, as_of, "test").unwrap();
    assert_eq!((report.units.len(), report.as_of_utc), (UNITS as usize, Some(as_of)));
    for unit in &report.units {
        let row = &rows[&unit.row.serial_number];
        assert_eq!(&unit.row, row);
        // The meter counts 6 h a day; the logged flights alone would give 0.3 h.
        assert!(close(row.hours_per_day.unwrap(), HOURS_A_DAY, 1e-9), "{row:?}");
        chart_is_that_of_the_row(unit, row, as_of);
    }
    past_forecasts_are_those_of_their_day(&report, &store, as_of);
    removals_are_those_of_the_rows(&report, &rows, as_of);
}

/// The drawn median meets the limit on the likely date, the upper bound on the earliest date, the lower on the latest.
fn chart_is_that_of_the_row(unit: &UnitView, row: &TrendRow, as_of: Timestamp) {
    let days = |at: Timestamp| at.duration_since(as_of).as_secs_f64() / 86_400.0;
    let meets = |gap_m: fn(&trend::Interval) -> f64| {
        let crossing = unit.forecast.windows(2).find(|pair| gap_m(&pair[1].1) >= LIMIT_M).unwrap();
        let [(from_utc, from), (to_utc, to)] = [&crossing[0], &crossing[1]];
        let share = (LIMIT_M - gap_m(from)) / (gap_m(to) - gap_m(from));
        days(*from_utc) + share * (days(*to_utc) - days(*from_utc))
    };
    for (drawn, stated) in [
        (meets(|band| band.p95_m), row.not_before_utc),
        (meets(|band| band.m), row.likely_utc),
        (meets(|band| band.p05_m), row.not_after_utc),
    ] {
        let stated = days(stated.unwrap());
        assert!(close(drawn, stated, 0.1), "{}: {drawn} days drawn, {stated} stated", row.serial_number);
    }
    // The smoothed level ends at the level that is stated.
    let (_, last) = unit.level.last().unwrap();
    assert!((last.m - row.gap_m.unwrap()).abs() < 2e-6, "{last:?}, {row:?}");
}

/// A past forecast starts from the assessment of its day and grows at its rate over the metered hours.
fn past_forecasts_are_those_of_their_day(report: &Report, store: &Store, as_of: Timestamp) {
    for days_ago in [30, 90, 180] {
        let then = assessed(store, as_of - DAY * days_ago);
        for unit in &report.units {
            let row = &then[&unit.row.serial_number];
            let past = unit.past_forecasts.iter().find(|past| past.days_ago == i64::from(days_ago)).unwrap();
            assert_eq!((past.state.as_deref(), past.gap_m), (row.state, row.gap_m.unwrap()));
            assert_eq!(Some(past.found_m), unit.row.gap_m);
            let grown_m = past.predicted_m - past.gap_m;
            let expected_m = row.rate_m_per_hour.unwrap() * HOURS_A_DAY * f64::from(days_ago);
            assert!(close(grown_m, expected_m, 0.25), "{past:?}: {expected_m} by {row:?}");
            assert!(past.predicted_p05_m < past.predicted_m && past.predicted_m < past.predicted_p95_m);
        }
    }
}

/// Expected removals of a month: the units' probabilities, from straight lines through their three quantiles.
fn removals_are_those_of_the_rows(report: &Report, rows: &BTreeMap<String, TrendRow>, as_of: Timestamp) {
    let shown: Vec<(String, f64)> =
        report::removal_forecast(report).into_iter().map(|row| (row.month, row.expected)).collect();
    assert_eq!((shown.len(), shown[0].0.as_str()), (12, "2025-02"));
    let probability = |row: &TrendRow, hours: f64| {
        let quantiles =
            [row.crossing_hours_p05, row.crossing_hours_p50, row.crossing_hours_p95].map(Option::unwrap);
        let points = [(0.0, 0.0), (quantiles[0], 0.05), (quantiles[1], 0.5), (quantiles[2], 0.95)];
        points.windows(2).find(|pair| hours < pair[1].0).map_or(0.95, |pair| {
            pair[0].1 + (pair[1].1 - pair[0].1) * (hours - pair[0].0) / (pair[1].0 - pair[0].0)
        })
    };
    let until = |date: &str| {
        let days = date.parse::<Timestamp>().unwrap().duration_since(as_of).as_secs_f64() / 86_400.0;
        rows.values().map(|row| probability(row, days.max(0.0) * row.hours_per_day.unwrap())).sum::<f64>()
    };
    for pair in shown.windows(2) {
        let [(month, expected), (next, _)] = pair else { unreachable!() };
        let calculated = until(&format!("{next}-01T00:00:00Z")) - until(&format!("{month}-01T00:00:00Z"));
        assert!((expected - calculated).abs() <= 0.0501, "{month}: {expected} on the page, {calculated}");
    }
    assert!(shown.iter().map(|(_, expected)| expected).sum::<f64>() > 3.0, "{shown:?}");
}
