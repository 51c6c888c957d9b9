//! Statements about units whose truth is known.

use trend::{Assessment, Observation, Reason, Series, Settings, State, WearStatus, assess};

use crate::histories::{self, DAY_US};
use crate::random::Random;

/// A unit that flies 2 h a day.
pub(crate) fn unit(days: i64, gap_um: impl Fn(f64) -> f64) -> Series {
    let measured_um = |day: i64| gap_um(2.0 * (day + 1) as f64) + Random::new(day as u64).normal();
    let rows = (0..days).map(|day| histories::row(day, DAY_US, 2.0, measured_um(day), 1.0));
    let mut series = Series::new(rows).unwrap();
    series.unit_hours_at_start = Some(0.0);
    series
}

fn state_of(series: &Series, day: i64) -> Assessment {
    assess(series, day * DAY_US, &Settings::for_limit(1e-4), None).unwrap()
}

#[test]
fn a_unit_wearing_along_a_line_is_known_by_level_rate_and_crossing() {
    // 20 µm new, 20 µm per 1,000 h: 36 µm after 800 h, and 3,200 h from the limit of 100 µm.
    let assessment = state_of(&unit(400, |h| 20.0 + 0.02 * h), 400);
    let (level, rate, crossing) =
        (assessment.level.unwrap(), assessment.rate.unwrap(), assessment.crossing.unwrap());
    assert!((level.gap_m - 36e-6).abs() < 1e-6, "{level:?}");
    assert!((rate.m_per_hour - 20e-9).abs() < 4e-9, "{rate:?}");
    assert!(rate.p05_m_per_hour < 20e-9 && 20e-9 < rate.p95_m_per_hour, "{rate:?}");
    assert!((crossing.p50_hours.unwrap() - 3200.0).abs() < 640.0, "{crossing:?}");
    assert!(crossing.p05_hours < Some(3200.0) && crossing.p95_hours > Some(3200.0), "{crossing:?}");
    assert_eq!(
        (assessment.wear, assessment.state, assessment.unit_hours),
        (WearStatus::Wearing, State::Normal, Some(800.0))
    );
}

#[test]
fn a_unit_that_does_not_wear_is_steady_and_its_late_crossing_beyond_the_horizon() {
    let assessment = state_of(&unit(400, |_| 20.0), 400);
    assert_eq!(
        (assessment.wear, assessment.state, assessment.reason),
        (WearStatus::Steady, State::Normal, Reason::Clear { records: 12 })
    );
    assert_eq!(assessment.crossing.unwrap().p95_hours, None);
}

/// A unit at its limit whose aircraft sends nothing is still at its limit.
#[test]
fn silence_clears_no_alarm() {
    for (series, state) in [
        (unit(400, |h| 20.0 + 0.15 * h), State::Act),
        (unit(400, |h| 30.0 + 0.06 * h), State::Plan),
        (unit(400, |h| 20.0 + 0.02 * h + if h > 770.0 { 12.0 } else { 0.0 }), State::Watch),
    ] {
        let (last, silent) = (state_of(&series, 399), state_of(&series, 500));
        assert_eq!((last.state, last.stale_days), (state, None), "{last:?}");
        assert_eq!(
            (silent.state, silent.stale_days),
            (state.max(State::Unassessed), Some(101.0)),
            "{silent:?}"
        );
    }
    // The last flight of a calm unit departs on day 399, and a record is stale after 30 days.
    let calm = unit(400, |h| 20.0 + 0.02 * h);
    assert_eq!((state_of(&calm, 429).state, state_of(&calm, 430).state), (State::Normal, State::Unassessed));
    let text = state_of(&calm, 430).reason.to_string();
    assert!(text.starts_with("no sound record for 31 days"), "{text}");
}

#[test]
fn a_state_stands_from_the_first_record_on() {
    let series = unit(400, |h| 20.0 + 0.02 * h);
    let young = state_of(&series, 3);
    assert_eq!((young.state, young.reason), (State::Normal, Reason::Clear { records: 4 }));
    assert_eq!(state_of(&series, 0).reason.to_string(), "below all limits, by the last 1 record");
    assert_eq!(
        (state_of(&series, -1).state, state_of(&series, -1).reason),
        (State::Unassessed, Reason::NoRecord { flagged: 0 })
    );
}

/// 20 µm below a limit of 100 µm, where the stated error is 60 µm. Twelve records that agree better than that may share it.
#[test]
fn a_level_whose_error_reaches_the_limit_is_watched() {
    for count in [1, 12] {
        let rows = (0..count).map(|day| histories::row(day, DAY_US, 2.0, 20.0, 60.0));
        let found = state_of(&histories::series(rows), count);
        assert!(matches!(found.reason, Reason::Imprecise { .. }), "{count}: {found:?}");
        assert_eq!((found.state, found.reason.code()), (State::Watch, "imprecise"));
    }
}

#[test]
fn settings_nothing_can_be_judged_by_are_refused() {
    let settings = Settings { watch_m: 2e-4, ..Settings::for_limit(1e-4) };
    let text = assess(&unit(9, |_| 20.0), 0, &settings, None).unwrap_err().to_string();
    assert_eq!(text, "watch limit is 2e-4 m and act limit 1e-4 m: watch must come first");
}

#[test]
fn a_remembered_state_does_not_flap_around_its_limit_and_follows_from_the_flights_alone() {
    // 20 µm per 1,000 h from 20 µm: past the watch limit of 60 µm at 2,000 h, day 1,000; ± 1 µm of scatter.
    let series = unit(1100, |h| 20.0 + 0.02 * h);
    let settings = Settings { watch_m: 60e-6, planning_horizon_hours: 1.0, ..Settings::for_limit(1e-4) };
    let states: Vec<State> =
        (940..1060).map(|day| assess(&series, day * DAY_US, &settings, None).unwrap().state).collect();
    let changes = states.windows(2).filter(|pair| pair[0] != pair[1]).count();
    assert_eq!((states.first(), states.last(), changes), (Some(&State::Normal), Some(&State::Watch), 1));
}

/// The gap rises from 40 to 97 of 100 µm and falls by 57 µm with a lubrication, which cannot close a gap.
#[test]
fn a_forecast_begins_at_the_gap_after_a_large_fall() {
    let wear_um = |flight: i64| if flight < 300 { 40.0 + 0.19 * flight as f64 } else { 40.0 };
    let um = |flight: i64| wear_um(flight) + 0.3 * (1.7 * flight as f64).sin();
    let rows = (0..340).map(|flight| histories::row(flight, DAY_US, 2.0, um(flight), 0.3));
    let entry = trend::MaintenanceEvent { utc_us: 300 * DAY_US - 1, renews: false };
    let found = state_of(&histories::series(rows).with_maintenance(vec![entry]), 340);
    assert!(found.over_limit_probability.is_some_and(|over| over < 0.01), "{found:?}");
    assert!(found.crossing.and_then(|crossing| crossing.p05_hours).is_none_or(|hours| hours > 100.0));
}

/// One flight in ten has a record. The re-shim was entered five records before its fall shows, with fifty flights between.
#[test]
fn a_repair_is_on_record_whatever_the_number_of_flights_without_a_log() {
    const HOUR_US: i64 = 3_600_000_000;
    let row = |flight: i64| {
        let um = if flight < 300 { 90.0 } else { 20.0 } + 0.2 * (1.7 * flight as f64).sin();
        let row = histories::row(flight, 8 * HOUR_US, 2.0, um, 0.3);
        Observation { gap_m: row.gap_m.filter(|_| flight % 10 == 0), ..row }
    };
    let series = histories::series((0..600).map(row));
    let entered = |renews: Option<bool>| {
        let entry = renews.map(|renews| trend::MaintenanceEvent { utc_us: 8 * HOUR_US * 285, renews });
        let series = series.clone().with_maintenance(entry.into_iter().collect());
        let found = assess(&series, 8 * HOUR_US * 600, &Settings::for_limit(150e-6), None).unwrap();
        let level = found.level.map(|level| (level.gap_m, level.se_m, level.records));
        (found.changes.iter().map(|change| change.kind).collect::<Vec<_>>(), level)
    };
    assert_eq!(entered(None).0, [trend::ChangePointKind::Reset]);
    assert_eq!(entered(Some(true)).0, [trend::ChangePointKind::Recorded]);
    // The level is measured either way.
    assert_eq!(entered(Some(false)), entered(Some(true)));
}

/// One record between two above the limit: neither is confirmed by the next one.
#[test]
fn records_above_the_limit_that_are_not_in_a_row_confirm_nothing() {
    let ends = [[60.0, 120.0, 60.0, 121.0], [120.0, 60.0, 121.0, 60.0]];
    for end in ends {
        let found = state_of(&unit(40, |h| if h > 72.0 { end[(h / 2.0) as usize - 37] } else { 60.0 }), 40);
        assert!(matches!(found.reason, Reason::Unconfirmed { records: 1, .. }), "{found:?}");
        assert_eq!((found.state, found.crossing.unwrap().p05_hours), (State::Plan, Some(0.0)));
    }
}

/// The worn gap is that of the former life: no chance, rate or date follows from it.
#[test]
fn a_renewal_after_the_last_record_ends_the_forecast() {
    let series = unit(400, |h| 20.0 + 0.09 * h);
    assert!(state_of(&series, 400).crossing.is_some());
    let renewal = trend::MaintenanceEvent { utc_us: 400 * DAY_US, renews: true };
    let found = state_of(&series.with_maintenance(vec![renewal]), 401);
    assert!(matches!(found.reason, Reason::Renewed { .. }), "{found:?}");
    assert_eq!((found.crossing, found.over_limit_probability, found.rate), (None, None, None));
}

/// Rounding of the arithmetic is no scatter.
#[test]
fn values_without_scatter_have_their_stated_errors() {
    let rows = (0..40).map(|day| histories::row(day, DAY_US, 2.0, 60.0 + 0.01 * day as f64, 1.0));
    let found = state_of(&Series::new(rows).unwrap(), 40);
    assert!(found.level.unwrap().se_m < 2e-6, "{found:?}");
}

/// 50 µm per 1,000 h, read in steps of 5 µm.
#[test]
fn a_gap_that_is_read_in_steps_is_seen_to_wear() {
    let gap_um = |day: i64| 25.0 + 0.1 * day as f64 + Random::new(day as u64).normal();
    let rows = (0..600).map(|day| histories::row(day, DAY_US, 2.0, 5.0 * (gap_um(day) / 5.0).round(), 1.4));
    let found = state_of(&Series::new(rows).unwrap(), 600);
    assert!(found.wear == WearStatus::Wearing && found.changes.len() < 2, "{:?}", found.changes);
    let crossing = found.crossing.unwrap();
    assert!(crossing.p05_hours < Some(300.0) && crossing.p95_hours > Some(300.0), "{crossing:?}");
}

/// 20 µm of running in, then 20 µm per 1,000 h.
#[test]
fn wear_that_slowed_is_forecast_no_later_than_its_rate_of_late() {
    for flights in [400, 800] {
        let gap_um = |h: f64| 50.0 - 20.0 * (-h / 40.0).exp() + 0.02 * h;
        let found = state_of(&unit(flights, gap_um), flights);
        let left_hours = (100.0 - gap_um(2.0 * flights as f64)) / 0.02;
        assert!(found.crossing.unwrap().p05_hours.is_some_and(|hours| hours < left_hours), "{found:?}");
    }
}
