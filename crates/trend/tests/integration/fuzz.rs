//! Fuzz target of the assessment: any numbers and dates in the rows of a unit, any settings.

use trend::{FleetPrior, Observation, SerialExecutor, Series, Settings, assess, forecast};

use self::edits::number;
use crate::histories::{self, DAY_US, series};

#[path = "../../../../tests/fuzz/edits.rs"]
mod edits;

/// Bytes of one change to a row.
const EDIT: usize = 12;

fn wearing(flights: i64) -> Vec<Observation> {
    let gap_um = |day: i64| 30.0 + 0.2 * day as f64 + (day as f64).sin();
    (0..flights).map(|day| histories::row(day, DAY_US, 1.5, gap_um(day), 1.0)).collect()
}

/// Rows, settings and date after the changes that the bytes describe.
fn changed(bytes: &[u8]) -> (Vec<Observation>, Settings, Option<f64>, i64) {
    let flights = 20 + usize::from(bytes.first().copied().unwrap_or_default());
    let mut rows = wearing(flights as i64);
    let (mut settings, mut unit_hours_at_start) = (Settings::for_limit(1e-4), None);
    let mut as_of_us = flights as i64 * DAY_US;
    for edit in bytes.get(1..).unwrap_or_default().chunks_exact(EDIT) {
        let bits: [u8; 8] = edit[4..].try_into().unwrap();
        let (value, whole) = (number(edit[3], bits), i64::from_le_bytes(bits));
        let first = usize::from(edit[1]) % flights;
        for row in rows.iter_mut().skip(first).take(1 + usize::from(edit[2])) {
            match edit[0] % 16 {
                0..=3 => row.gap_m = Some(value),
                4 => row.gap_m = None,
                5 | 6 => row.gap_se_m = Some(value),
                7 => row.gap_se_m = None,
                8 => row.flight_hours = Some(value),
                9 => row.flight_hours = None,
                10 => row.tail_hours_end = Some(value),
                11 => row.load_reversals = Some(whole as u64),
                12 => row.departure_us = whole,
                13 => row.installation = u32::from(edit[3]),
                14 => row.gap_m = row.gap_m.map(|gap_m| gap_m + value),
                _ => row.departure_us = row.departure_us.saturating_add(value as i64),
            }
        }
        match edit[0] {
            200 => settings.limit_m = value,
            201 => settings.watch_m = value,
            202 => settings.horizon_hours = value,
            203 => settings.planning_horizon_hours = value,
            204 => settings.check_interval_hours = value,
            206 => unit_hours_at_start = Some(value),
            207 => as_of_us = whole,
            208 => settings.stale_after_days = value,
            _ => {}
        }
    }
    (rows, settings, unit_hours_at_start, as_of_us)
}

/// Assesses and forecasts. What is stated must be numbers in order, and probabilities between zero and one.
fn assess_any(bytes: &[u8]) {
    let (rows, settings, unit_hours_at_start, as_of_us) = changed(bytes);
    let Ok(mut series) = Series::new(rows) else { return };
    series.unit_hours_at_start = unit_hours_at_start;
    let fleet = [40, 90].map(|n| histories::series(wearing(n)));
    let prior = bytes.len().is_multiple_of(2).then(|| {
        FleetPrior::learn(fleet.iter().chain([&series]), as_of_us, settings.limit_m, None, &SerialExecutor)
    });
    let Ok(found) = assess(&series, as_of_us, &settings, prior.as_ref()) else { return };
    if let Some(level) = found.level {
        assert!(level.gap_m.is_finite() && level.se_m >= 0.0, "level {level:?}");
    }
    if let Some(rate) = found.rate {
        assert!(rate.p05_m_per_hour <= rate.m_per_hour && rate.m_per_hour <= rate.p95_m_per_hour, "{rate:?}");
    }
    for probability in [found.growth_probability, found.check_probability].into_iter().flatten() {
        assert!((0.0..=1.0).contains(&probability), "probability {probability}");
    }
    let ahead = forecast(&series, as_of_us, &settings, prior.as_ref(), [0.0, 100.0, 1000.0]).unwrap();
    for (_, gap) in &ahead.ahead {
        assert!(gap.p05_m <= gap.m && gap.m <= gap.p95_m, "{gap:?}");
    }
}

/// Dates at the ends of their type overflowed, and a horizon below an hour gave a probability of −5.
#[test]
fn extreme_dates_and_horizons_leave_numbers() {
    let mut rows = wearing(100);
    rows[0].departure_us = i64::MIN;
    rows[99].departure_us = i64::MAX;
    let series = series(rows);
    let plain = Settings::for_limit(1e-4);
    for (as_of_us, horizon_hours) in [(i64::MAX, 20_000.0), (99 * DAY_US, 0.5), (99 * DAY_US, 1.0), (0, 1e-3)]
    {
        let settings = Settings { horizon_hours, ..plain };
        let found = assess(&series, as_of_us, &settings, None).unwrap();
        assert!(found.check_probability.is_none_or(|p| (0.0..=1.0).contains(&p)), "{found:?}");
    }
}

#[test]
fn fuzz_trend() {
    bolero::check!().with_iterations(60).with_max_len(1 + 40 * EDIT).for_each(assess_any);
}
