//! Lengths enter by the limit alone: a fleet of parts ten times as large gets the same results.

use trend::{Assessment, FleetPrior, Observation, SerialExecutor, Series, Settings, assess};

use crate::histories::{self, Drawn, LIMIT_M};
use crate::states::{drawn, kinds};

/// Some units of each kind of history, every third without stated errors, with every length multiplied by a factor.
fn assessments(factor: f64) -> Vec<Assessment> {
    let kinds = [kinds(true), kinds(false)].into_iter().flatten().zip(0..);
    let units: Vec<Drawn> = kinds
        .flat_map(|(kind, number)| drawn(&kind, number).into_iter().take(2))
        .map(|unit| unit.0)
        .collect();
    let series = |(unit, drawn): (usize, &Drawn)| {
        let scaled = |row: &Observation| Observation {
            gap_m: row.gap_m.map(|m| factor * m),
            gap_se_m: row.gap_se_m.map(|m| factor * m).filter(|_| unit % 3 > 0),
            ..*row
        };
        histories::series(drawn.rows.iter().map(scaled)).with_maintenance(drawn.maintenance.clone())
    };
    let fleet: Vec<Series> = units.iter().enumerate().map(series).collect();
    let settings = Settings::for_limit(factor * LIMIT_M);
    let prior = FleetPrior::learn(&fleet, i64::MAX, settings.limit_m, None, &SerialExecutor);
    // Every sixth unit without the fleet, as a part number without history.
    let assessment = |(unit, drawn): (usize, &Drawn)| {
        assess(&fleet[unit], drawn.now_us(), &settings, (unit % 6 != 5).then_some(&prior)).unwrap()
    };
    units.iter().enumerate().map(assessment).collect()
}

#[test]
fn gaps_errors_and_limits_times_one_factor_leave_hours_states_and_steps_alone() {
    let before = assessments(1.0);
    let shown = |of: fn(&Assessment) -> bool| before.iter().filter(|a| of(a)).count();
    let (changed, forecast) = (shown(|a| !a.changes.is_empty()), shown(|a| a.crossing.is_some()));
    assert!(
        changed >= 15 && forecast >= 40,
        "{changed} changed and {forecast} forecast units show too little"
    );
    // Thirty: a part with a limit of 3 mm.
    for factor in [0.1, 3.0, 10.0, 30.0] {
        for (unit, (here, there)) in before.iter().zip(assessments(factor)).enumerate() {
            let at = format!("unit {unit} times {factor}");
            let is_alike = |a: Option<f64>, b: Option<f64>| match (a, b) {
                (Some(a), Some(b)) => (a - b).abs() <= 0.01 * a.abs().max(b.abs()).max(1e-9),
                (a, b) => a.is_none() && b.is_none(),
            };
            let hours = |a: &Assessment| a.crossing.map(|c| [c.p05_hours, c.p50_hours, c.p95_hours]);
            let (ours, theirs) = (hours(here).unwrap_or_default(), hours(&there).unwrap_or_default());
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
