//! The classic statistics against scipy 1.17.1 and pymannkendall 1.4.3.

use std::collections::BTreeMap;

use proptest::prelude::*;
use serde::Deserialize;
use trend::classic;

#[derive(Deserialize)]
struct Oracle {
    cases: Vec<Case>,
    vectors: Vec<Vector>,
}

#[derive(Deserialize)]
struct Case {
    serial: String,
    n_used: usize,
    ties_rounded_1um: bool,
    theil_sen_index: ExpectedTheilSen,
    theil_sen_fh: ExpectedTheilSen,
    mann_kendall: ExpectedTest,
    hamed_rao: ExpectedTest,
}

#[derive(Deserialize)]
struct ExpectedTheilSen {
    slope: f64,
    intercept: f64,
    lo: f64,
    hi: f64,
}

#[derive(Deserialize)]
struct ExpectedTest {
    #[serde(rename = "S")]
    s: f64,
    var_s: Option<f64>,
    #[serde(rename = "Z")]
    z: f64,
    p: f64,
    tau: Option<f64>,
}

#[derive(Deserialize)]
struct Vector {
    y: Vec<f64>,
    #[serde(flatten)]
    test: ExpectedTest,
    sen_slope: f64,
    intercept: f64,
    ts_lo: f64,
    ts_hi: f64,
}

#[derive(Deserialize)]
struct Stored {
    gap_nm: Vec<f64>,
    flight_hours: Vec<f64>,
}

fn oracle() -> Oracle {
    serde_json::from_str(include_str!("../data/expected_statistics.json")).unwrap()
}

/// Hours and gaps of a reference case.
fn observations(case: &Case) -> (Vec<f64>, Vec<f64>) {
    let all: BTreeMap<String, Stored> =
        serde_json::from_str(include_str!("../data/observations.json")).unwrap();
    let stored = &all[&case.serial];
    let gap = |nm: &f64| if case.ties_rounded_1um { (nm / 1e3).round_ties_even() / 1e6 } else { nm / 1e9 };
    let mut hours = 0.0;
    let ages = stored.flight_hours[..case.n_used].iter().map(|h| {
        hours += h;
        hours
    });
    (ages.collect(), stored.gap_nm[..case.n_used].iter().map(gap).collect())
}

fn close(what: &str, ours: f64, theirs: f64) {
    let tolerance = if theirs == 0.0 { 1e-12 } else { 1e-9 * theirs.abs() };
    assert!((ours - theirs).abs() <= tolerance, "{what}: {ours:e} against {theirs:e}");
}

/// Their p-values come from 1 − Φ, so only an absolute comparison is fair.
fn close_p(what: &str, ours: f64, theirs: f64) {
    assert!((ours - theirs).abs() <= 1e-15 + 1e-9 * theirs, "{what}: {ours:e} against {theirs:e}");
}

fn same_test(what: &str, ours: classic::MannKendall, theirs: &ExpectedTest) {
    close(what, ours.s, theirs.s);
    close(what, ours.z, theirs.z);
    close_p(what, ours.p_value, theirs.p);
    theirs.var_s.iter().for_each(|v| close(what, ours.variance, *v));
    theirs.tau.iter().for_each(|v| close(what, ours.tau, *v));
}

fn same_theil_sen(what: &str, ours: classic::TheilSen, theirs: &ExpectedTheilSen) {
    close(what, ours.slope, theirs.slope);
    close(what, ours.intercept, theirs.intercept);
    close(what, ours.slope_low, theirs.lo);
    close(what, ours.slope_high, theirs.hi);
}

fn index(y: &[f64]) -> Vec<f64> {
    (0..y.len()).map(|i| i as f64).collect()
}

#[test]
fn theil_sen_agrees_with_scipy_to_nine_digits() {
    for case in oracle().cases {
        let (hours, y) = observations(&case);
        same_theil_sen(
            &case.serial,
            classic::theil_sen(&index(&y), &y, 0.95).unwrap(),
            &case.theil_sen_index,
        );
        same_theil_sen(&case.serial, classic::theil_sen(&hours, &y, 0.95).unwrap(), &case.theil_sen_fh);
    }
}

#[test]
fn mann_kendall_and_hamed_rao_agree_with_pymannkendall_to_nine_digits() {
    for case in oracle().cases {
        let (_, y) = observations(&case);
        same_test("original", classic::mann_kendall(&y).unwrap(), &case.mann_kendall);
        same_test("Hamed-Rao", classic::hamed_rao(&y).unwrap(), &case.hamed_rao);
    }
}

#[test]
fn short_vectors_rising_falling_tied_and_flat_agree_too() {
    for Vector { y, test, sen_slope, intercept, ts_lo, ts_hi } in oracle().vectors {
        same_test("vector", classic::mann_kendall(&y).unwrap(), &test);
        let theirs = ExpectedTheilSen { slope: sen_slope, intercept, lo: ts_lo, hi: ts_hi };
        same_theil_sen("vector", classic::theil_sen(&index(&y), &y, 0.95).unwrap(), &theirs);
    }
}

proptest! {
    /// The bracketed selection must give what sorting every slope gives.
    #[test]
    fn a_bracketed_median_of_slopes_is_the_sorted_one(y in prop::collection::vec(-4_i8..4, 2..60)) {
        let y: Vec<f64> = y.into_iter().map(f64::from).collect();
        let x = index(&y);
        let mut slopes: Vec<f64> = (0..y.len()).flat_map(|j| (0..j).map(move |i| (i, j)))
            .map(|(i, j)| (y[j] - y[i]) / (x[j] - x[i])).collect();
        slopes.sort_by(f64::total_cmp);
        let n = slopes.len();
        let expected = 0.5 * (slopes[(n - 1) / 2] + slopes[n / 2]);
        prop_assert_eq!(classic::theil_sen(&x, &y, 0.95).unwrap().slope, expected);
    }

    /// S has a definition in one line.
    #[test]
    fn the_merge_sort_counts_what_the_definition_counts(y in prop::collection::vec(-9_i8..9, 2..80)) {
        let sum: i32 = (0..y.len()).flat_map(|j| (0..j).map(move |i| (i, j)))
            .map(|(i, j)| i32::from((y[j] - y[i]).signum())).sum();
        let y: Vec<f64> = y.into_iter().map(f64::from).collect();
        prop_assert_eq!(classic::mann_kendall(&y).unwrap().s, f64::from(sum));
    }
}

#[test]
fn values_no_statistic_can_use_are_refused_with_a_reason() {
    let y = [1.0, f64::NAN, 3.0];
    assert!(classic::mann_kendall(&y).unwrap_err().to_string().contains("not all of them are finite"));
    assert!(
        classic::theil_sen(&[1.0; 3], &[1.0, 2.0, 3.0], 0.95)
            .unwrap_err()
            .to_string()
            .contains("every x is the same")
    );
    assert!(classic::hamed_rao(&y[..2]).unwrap_err().to_string().contains("needs at least 3"));
    assert!(classic::theil_sen(&y, &y[..2], 0.95).unwrap_err().to_string().contains("belong in pairs"));
}
