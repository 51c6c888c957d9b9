//! The plotted forecast agrees with the assessment, and its level follows the true gap.

use trend::{Crossing, Forecast, Settings, assess, forecast};

use crate::assessment::unit;
use crate::histories::DAY_US;

const LIMIT_M: f64 = 60e-6;

/// 20 µm when new, 30 µm in 1,000 h.
fn true_um(hours: f64) -> f64 {
    20.0 + 0.03 * hours
}

fn drawn(days: i64, hours: &[f64]) -> (Crossing, Forecast) {
    let (series, settings, now) = (unit(days, true_um), Settings::for_limit(LIMIT_M), days * DAY_US);
    let crossing = assess(&series, now, &settings, None).unwrap().crossing.unwrap();
    (crossing, forecast(&series, now, &settings, None, hours.iter().copied()).unwrap())
}

/// A gap that only grows is over the limit by a time with the probability that it is over it at that
/// time: the fan's upper edge meets the limit at *not before*, its middle at *likely*, and its lower edge
/// at *not after*. That all but holds: the fan is widened along the gap and the statement along the
/// logarithm of the time, which differ where growth has gone far.
#[test]
fn the_forecast_meets_the_limit_at_the_assessed_crossing() {
    let (Crossing { p05_hours, p50_hours, p95_hours }, _) = drawn(500, &[]);
    let hours = [p05_hours, p50_hours, p95_hours].map(Option::unwrap);
    let (_, Forecast { ahead, .. }) = drawn(500, &hours);
    let met_m = [ahead[0].1.p95_m, ahead[1].1.m, ahead[2].1.p05_m];
    for (gap_m, near_m) in met_m.into_iter().zip([1e-6, 1e-6, 2.5e-6]) {
        assert!((gap_m - LIMIT_M).abs() < near_m, "{met_m:?} at {hours:?}");
    }
}

#[test]
fn the_fan_begins_at_the_level_and_widens() {
    let (_, Forecast { ahead, .. }) = drawn(400, &[0.0, 100.0, 300.0, 900.0]);
    assert!((ahead[0].1.m - true_um(800.0) * 1e-6).abs() < 2e-6, "{ahead:?}");
    assert!(ahead.windows(2).all(|w| w[1].1.p95_m - w[1].1.p05_m > w[0].1.p95_m - w[0].1.p05_m), "{ahead:?}");
}

#[test]
fn the_level_through_past_flights_holds_the_truth() {
    let (_, Forecast { past, .. }) = drawn(400, &[]);
    let held = past.iter().filter(|(at, band)| {
        let truth_m = true_um(2.0 * (*at as f64 / DAY_US as f64 + 1.0)) * 1e-6;
        (band.p05_m..=band.p95_m).contains(&truth_m)
    });
    assert!(past.len() >= 40 && held.count() * 10 >= past.len() * 8, "{past:?}");
    assert!(past.windows(2).all(|w| w[0].0 < w[1].0));
}

#[test]
fn too_few_flights_draw_nothing() {
    let (series, settings) = (unit(5, true_um), Settings::for_limit(LIMIT_M));
    let drawn = forecast(&series, 10 * DAY_US, &settings, None, [0.0, 100.0]).unwrap();
    assert_eq!(drawn, Forecast::default());
}
