//! Steps and drift of followed quantities: power, false alarms and dates against simulated truth.

use trend::quantity::QuantityValue;
use trend::quantity::changes::{self, QuantityChanges};
use trend::quantity::common_curve::CommonCurve;
use trend::quantity::covariates::Slopes;

use crate::histories::DAY_US;
use crate::random::Random;

/// Flights at three a day, 2 h each, with a relative scatter and an autocorrelation between neighbours.
fn flights(random: &mut Random, count: usize, scatter: f64, rho: f64) -> Vec<QuantityValue> {
    let mut error = scatter * random.normal();
    (0..count)
        .map(|k| {
            error = rho * error + (1.0 - rho * rho).sqrt() * scatter * random.normal();
            QuantityValue {
                departure_us: k as i64 * DAY_US / 3,
                usage_hours: 2.0 * k as f64,
                value: 1.0 + error,
                se: 0.3 * scatter,
                ..QuantityValue::default()
            }
        })
        .collect()
}

fn changed(mut values: Vec<QuantityValue>, change: impl Fn(usize) -> f64) -> Vec<QuantityValue> {
    values.iter_mut().enumerate().for_each(|(k, v)| v.value += change(k));
    values
}

fn fit(values: &[QuantityValue]) -> QuantityChanges {
    changes::fit(values, 1e-6).unwrap()
}

#[test]
fn quantities_that_stay_are_left_alone_every_night_of_a_year() {
    // 100 units × 365 nights, half of them with neighbours that share most of their error.
    let mut alarms = 0;
    for unit in 0..100 {
        let mut random = Random::new(unit);
        let rho = if unit % 2 == 0 { 0.0 } else { 0.5 };
        let values = flights(&mut random, 1095, 0.15, rho);
        let is_alarm = |night: usize| {
            let found = fit(&values[..3 * night]);
            found.change.abs() > 0.10 + 0.5 * found.change_se
        };
        alarms += usize::from((10..365).step_by(7).any(is_alarm));
    }
    assert_eq!(alarms, 0, "of 100 unit-years");
}

#[test]
fn a_drift_over_five_hundred_flights_is_found() {
    for (size, limit, scatter, rho) in
        [(0.20, 0.10, 0.15, 0.3), (-0.10, 0.05, 0.03, 0.3), (-0.10, 0.05, 0.01, 0.0)]
    {
        let found = (0..200)
            .filter(|seed| {
                let values = flights(&mut Random::new(*seed), 500, scatter, rho);
                let found = fit(&changed(values, |k| size * k as f64 / 500.0));
                found.change.signum() == f64::signum(size)
                    && found.change.abs() > limit + 0.5 * found.change_se
            })
            .count();
        assert!(found >= 190, "{size}: {found} of 200");
    }
}

#[test]
fn the_interval_of_a_change_holds_the_truth() {
    let held = (0..300)
        .filter(|seed| {
            let values = flights(&mut Random::new(*seed), 300, 0.05, 0.3);
            let found = fit(&changed(values, |k| if k < 150 { 0.0 } else { 0.15 }));
            (found.change - 0.15).abs() <= 1.645 * found.change_se
        })
        .count();
    assert!((255..=300).contains(&held), "{held} of 300");
}

#[test]
fn a_clear_step_is_dated_at_its_flight_from_the_third_flight_on() {
    for seed in 0..200 {
        let at = 20 + seed as usize % 150;
        let values = changed(flights(&mut Random::new(seed), at + 3 + seed as usize % 40, 0.01, 0.0), |k| {
            if k < at { 0.0 } else { 0.12 }
        });
        let found = fit(&values);
        assert_eq!(found.steps.len(), 1, "seed {seed}: {found:?}");
        let off = (found.steps[0].departure_us - values[at].departure_us).abs();
        assert!(off <= DAY_US / 3, "seed {seed}: {} flights off", 3 * off / DAY_US);
    }
}

#[test]
fn single_wild_flights_are_outliers_and_no_step() {
    for seed in 0..100 {
        let wild = |k| if k % 31 == 17 { 3.0 } else { 0.0 };
        let found = fit(&changed(flights(&mut Random::new(seed), 120, 0.01, 0.0), wild));
        assert_eq!((found.steps.len(), found.is_drifting), (0, false), "seed {seed}: {found:?}");
        assert!(found.outliers >= 4);
    }
}

/// Friction with a slope on temperature and load, under a season; the slopes come from one flight to the next.
#[test]
fn temperature_and_load_are_taken_off_by_slopes_that_a_part_shares() {
    let mut random = Random::new(5);
    let mut units: Vec<Vec<QuantityValue>> = Vec::new();
    for _ in 0..8 {
        let mut values = flights(&mut random, 200, 0.05, 0.0);
        for (k, value) in values.iter_mut().enumerate() {
            let season = 15.0 * (k as f64 / 200.0 * 1.5).sin();
            let temperature_c = 5.0 + season + 8.0 * random.normal();
            let ln_load = 8.5 + 0.2 * random.normal();
            value.temperature_c = temperature_c;
            value.ln_load = ln_load;
            value.value += -0.01 * (temperature_c - 5.0) + 0.5 * (ln_load - 8.5);
        }
        units.push(values);
    }
    let slopes = Slopes::fit(units.iter().map(Vec::as_slice));
    assert!((slopes.per_celsius + 0.01).abs() < 0.001, "{slopes:?}");
    assert!((slopes.per_ln_load - 0.5).abs() < 0.05, "{slopes:?}");
    let seasonal = units.iter().filter(|values| fit(values).change.abs() > 0.05).count();
    assert!(seasonal >= 4, "without adjustment the season is a change: {seasonal} of 8");
    for values in &mut units {
        values.iter_mut().for_each(|v| v.value = slopes.adjusted(v));
        assert!(fit(values).change.abs() < 0.02, "{:?}", fit(values));
    }
}

#[test]
fn a_season_that_a_part_shares_is_its_common_curve_and_a_unit_that_drifts_is_not() {
    let mut random = Random::new(9);
    let season = |k: usize| 0.15 * (std::f64::consts::TAU * k as f64 / 1095.0).sin();
    let units: Vec<Vec<QuantityValue>> = (0..10)
        .map(|unit| {
            let drift = if unit == 3 { 0.2 } else { 0.0 };
            changed(flights(&mut random, 500, 0.05, 0.0), |k| season(k) + drift * k as f64 / 500.0)
        })
        .collect();
    let curve = CommonCurve::fit(units.iter().enumerate().map(|(tail, values)| (tail, values.as_slice())));
    let middle = curve.at(units[0][250].departure_us) - season(250);
    for k in (10..490).step_by(20) {
        let off = curve.at(units[0][k].departure_us) - season(k) - middle;
        assert!(off.abs() < 0.05, "flight {k}: {off}");
    }
    for (unit, values) in units.iter().enumerate() {
        let mut left = values.clone();
        left.iter_mut().for_each(|v| v.value -= curve.at(v.departure_us));
        let found = fit(&left);
        if unit == 3 {
            assert!((found.change - 0.2).abs() < 0.06, "{found:?}");
        } else {
            assert!(found.change.abs() < 0.08, "unit {unit}: {found:?}");
        }
    }
}

#[test]
fn too_few_or_constant_values_change_nothing() {
    assert_eq!(changes::fit(&[], 1e-6), None);
    let constant = changed(flights(&mut Random::new(1), 40, 0.0, 0.0), |_| 0.0);
    let found = fit(&constant);
    assert_eq!((found.change, found.steps.len()), (0.0, 0));
    assert!((found.level - 1.0).abs() < 1e-12);
    let short = changed(flights(&mut Random::new(1), 5, 0.01, 0.0), |k| k as f64);
    assert_eq!(fit(&short).change, 0.0);
}

/// A staircase looks like a drift until its steps are known: no drift remains.
#[test]
fn equal_steps_up_are_steps_and_no_drift() {
    let mut right = 0;
    for seed in 0..20 {
        let values = flights(&mut Random::new(seed), 400, 0.02, 0.0);
        let found = fit(&changed(values, |k| 0.2 * (k / 100) as f64));
        let dates: Vec<i64> = found.steps.iter().map(|step| step.departure_us * 3 / DAY_US).collect();
        let are_dated = dates.iter().zip([100, 200, 300]).all(|(date, truth)| (date - truth).abs() <= 1);
        right += usize::from(dates.len() == 3 && are_dated && !found.is_drifting);
        assert!((found.change - 0.6).abs() < 4.0 * found.change_se.max(0.005), "{found:?}");
    }
    assert!(right >= 18, "{right} of 20");
}
