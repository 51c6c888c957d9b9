//! Lengths enter by the limit alone: a fleet of parts ten times as large gets the same results.

use trend::{Assessment, FleetPrior, Observation, SerialExecutor, Series, Settings, assess};

use crate::histories::{self, DAY_US};
use crate::random::Random;

const LIMIT_M: f64 = 1e-4;
const UNITS: u64 = 24;
const DAYS: i64 = 260;

/// A unit of two flights a day that wears by lumps, swaps its tail, and is re-rigged or reset in some seeds.
fn rows(seed: u64) -> Vec<Observation> {
    let mut random = Random::new(seed);
    let um_per_hour = 0.02 * (0.5 * random.normal()).exp();
    let (mut gap_um, states_errors) = (20.0 + 3.0 * random.normal(), !seed.is_multiple_of(5));
    (0..2 * DAYS)
        .filter_map(|flight| {
            let mean_um = 1.7 * um_per_hour;
            gap_um += if random.uniform() < mean_um / 0.2 { 0.2 } else { 0.0 };
            if seed % 4 == 1 && flight == 350 {
                gap_um = 21.0;
            }
            let rig_um = if seed % 4 == 2 && flight > 300 { 9.0 } else { 0.0 };
            let se_um = random.between(1.0, 3.0);
            let outlier_um = if random.uniform() < 0.02 { 40.0 } else { 0.0 };
            let measured_um = gap_um + rig_um + se_um * random.normal() + outlier_um;
            let installation = u32::from(seed.is_multiple_of(3) && flight > 200);
            let row = histories::row(flight, DAY_US / 2, 1.7, measured_um, se_um);
            (random.uniform() < 0.8).then_some(Observation {
                installation,
                tail_hours_end: row.tail_hours_end.map(|hours| hours + 5000.0 * f64::from(installation)),
                gap_se_m: row.gap_se_m.filter(|_| states_errors),
                ..row
            })
        })
        .collect()
}

/// The fleet with every length multiplied by a factor.
fn assessments(factor: f64) -> Vec<Assessment> {
    let scaled = |row: Observation| Observation {
        gap_m: row.gap_m.map(|m| factor * m),
        gap_se_m: row.gap_se_m.map(|m| factor * m),
        ..row
    };
    let series = |seed| histories::series(rows(seed).into_iter().map(scaled));
    let fleet: Vec<Series> = (0..UNITS).map(series).collect();
    let settings = Settings::for_limit(factor * LIMIT_M);
    let prior = FleetPrior::learn(&fleet, DAYS * DAY_US, settings.limit_m, None, &SerialExecutor);
    let assessment = |(unit, series): (usize, &Series)| {
        // Every sixth unit without the fleet, as a part number without history.
        let prior = (unit % 6 != 5).then_some(&prior);
        assess(series, DAYS * DAY_US, &settings, prior).unwrap()
    };
    fleet.iter().enumerate().map(assessment).collect()
}

#[test]
fn gaps_errors_and_limits_times_one_factor_leave_hours_states_and_steps_alone() {
    let before = assessments(1.0);
    assert!(before.iter().map(|a| a.changes.len()).sum::<usize>() >= 8, "the fleet shows too little");
    // Thirty: a part with a limit of 3 mm.
    for factor in [0.1, 3.0, 10.0, 30.0] {
        for (unit, (here, there)) in before.iter().zip(assessments(factor)).enumerate() {
            let at = format!("unit {unit} times {factor}");
            let is_alike = |a: Option<f64>, b: Option<f64>| match (a, b) {
                (Some(a), Some(b)) => (a - b).abs() <= 0.01 * a.abs().max(b.abs()).max(1e-9),
                (a, b) => a.is_none() && b.is_none(),
            };
            let hours = |a: &Assessment| a.crossing.map(|c| [c.p05_hours, c.p50_hours, c.p95_hours]);
            let (ours, theirs) = (hours(here).unwrap(), hours(&there).unwrap());
            assert!(ours.into_iter().zip(theirs).all(|(a, b)| is_alike(a, b)), "{at}: {ours:?} {theirs:?}");
            let gaps = |a: &Assessment| a.level.map(|l| [l.gap_m, l.se_m]).unwrap();
            let scaled = gaps(here).map(|m| Some(factor * m));
            assert!(scaled.into_iter().zip(gaps(&there)).all(|(a, b)| is_alike(a, Some(b))), "{at}");
            assert!(is_alike(here.growth_probability, there.growth_probability), "{at}");
            assert_eq!((here.state, here.wear), (there.state, there.wear), "{at}");
            assert_eq!(here.outliers_us, there.outliers_us, "{at}");
            let dated =
                |a: &Assessment| -> Vec<_> { a.changes.iter().map(|c| (c.departure_us, c.kind)).collect() };
            assert_eq!(dated(here), dated(&there), "{at}");
            for (a, b) in here.changes.iter().zip(&there.changes) {
                assert!(is_alike(Some(factor * a.step_m), Some(b.step_m)), "{at}: {a:?} {b:?}");
            }
        }
    }
}
