//! Followed quantities of a fleet with planted changes on units, tails and parts: each is found, dated, and named for
//! what it is; nothing else is.
//!
//! Six tails with four actuators of two part numbers fly three times a day for half a year. Friction follows a season
//! of ± 10 % that no temperature channel shows.

use jiff::{SignedDuration, Timestamp};
use job::Config;
use pipeline::assess::quantities::follow::FollowedQuantities;
use pipeline::assess::trends::{self, UnitSelection};
use records::{GapEstimate, GapRecord, Installations, QuantityChange, Status, TrendRow};
use store::LogResult;

use crate::fleet;

const TAILS: i32 = 6;
const POSITIONS: [&str; 4] = ["aileron_left", "aileron_right", "elevator_left", "elevator_right"];
const FLIGHTS: i32 = 500;
const LOAD_N: f64 = 5_000.0;

fn departure(flight: i32) -> Timestamp {
    "2025-01-01T05:00:00Z".parse::<Timestamp>().unwrap() + SignedDuration::from_hours(8) * flight
}

/// A unit by tail and position, and whether a flight is at or after another.
struct At {
    tail: i32,
    position: usize,
    flight: i32,
}

impl At {
    fn is(&self, tail: i32, position: usize) -> bool {
        (self.tail, self.position) == (tail, position)
    }

    fn drift(&self) -> f64 {
        f64::from(self.flight) / f64::from(FLIGHTS)
    }

    /// Scatter of mean zero and standard deviation one, different for each quantity.
    fn scatter(&self, quantity: i32) -> f64 {
        fleet::scatter((quantity, self.tail, self.position, self.flight))
    }
}

/// What is planted in a fleet.
type Plant = fn(&At, &mut GapEstimate);

fn nothing(_: &At, _: &mut GapEstimate) {}

fn scale(number: &mut Option<f64>, factor: f64) {
    *number = number.map(|n| n * factor);
}

fn add(number: &mut Option<f64>, offset: f64) {
    *number = number.map(|n| n + offset);
}

fn friction(estimate: &mut GapEstimate, factor: f64) {
    scale(&mut estimate.friction_n, factor);
    scale(&mut estimate.friction_dry_n, factor);
    scale(&mut estimate.friction_load_share, factor);
}

fn estimate(at: &At, plant: Plant) -> GapEstimate {
    let season = 0.10 * (std::f64::consts::TAU * f64::from(at.flight) / 1_095.0).sin();
    let load_n = LOAD_N * (1.0 + 0.15 * at.scatter(1));
    let dry_n = 100.0 * (1.0 + season) * (1.0 + 0.10 * at.scatter(2));
    let share = 0.02 * (1.0 + season) * (1.0 + 0.10 * at.scatter(3));
    let mut estimate = GapEstimate {
        status: Status::Estimated,
        gap_m: Some(60e-6 + 1e-6 * at.scatter(4)),
        gap_se_m: Some(1e-6),
        stiffness_n_per_m: Some(5e7 * (1.0 + 0.002 * at.scatter(5))),
        stiffness_se_n_per_m: Some(1e5),
        friction_n: Some(dry_n + share * load_n),
        friction_se_n: Some(15.0),
        friction_dry_n: Some(dry_n),
        friction_dry_se_n: Some(10.0),
        friction_load_share: Some(share),
        friction_load_share_se: Some(0.002),
        skew_s: Some(2e-5 * at.scatter(6)),
        skew_se_s: Some(2e-5),
        load_zero_n: Some(20.0 * at.scatter(7)),
        load_zero_se_n: Some(20.0),
        load_delay_s: Some(3e-4 * at.scatter(8)),
        load_delay_se_s: Some(3e-4),
        lost_motion_m: Some(160e-6 + 1e-6 * at.scatter(9)),
        lost_motion_se_m: Some(1e-6),
        nis: Some(1.0 + 0.1 * at.scatter(10)),
        load_p05_n: Some(-load_n),
        load_p95_n: Some(load_n),
        load_reversals: 20,
        ..GapEstimate::default()
    };
    plant(at, &mut estimate);
    estimate
}

fn record(at: &At, plant: Plant, swaps: bool) -> GapRecord {
    let (tail, position) = (format!("T{}", at.tail), POSITIONS[at.position]);
    // Two units change places after half of the flights, if `swaps`.
    let unit = match (swaps && at.position == 0 && at.flight >= FLIGHTS / 2, at.tail) {
        (true, 0) => 1,
        (true, 1) => 0,
        _ => at.tail,
    };
    let [serial, flight] = [format!("T{unit}-{position}"), format!("{tail}-{:04}", at.flight)];
    let part = if at.position < 2 { "EMA-27-1040" } else { "EMA-27-1060" };
    fleet::record([&tail, position, part, &serial, &flight], departure(at.flight), 2.0, estimate(at, plant))
}

fn result(tail: i32, flight: i32, plant: Plant, swaps: bool) -> LogResult {
    let positions = 0..POSITIONS.len();
    fleet::result(positions.map(|position| record(&At { tail, position, flight }, plant, swaps)).collect())
}

/// Assessments of a fleet in which something is planted.
fn followed(plant: Plant) -> (Vec<TrendRow>, FollowedQuantities) {
    assessed(&fleet::config(), plant, false)
}

fn assessed(config: &Config, plant: Plant, swaps: bool) -> (Vec<TrendRow>, FollowedQuantities) {
    let folder = tempfile::tempdir().unwrap();
    let results: Vec<LogResult> = (0..TAILS)
        .flat_map(|tail| (0..FLIGHTS).map(move |flight| result(tail, flight, plant, swaps)))
        .collect();
    let store = fleet::store(folder.path(), &results);
    let ask = UnitSelection::default();
    let found = trends::assess_store(config, &Installations::default(), &store, &ask).unwrap();
    (found.now, found.followed)
}

/// Quantity, scope, kind, and name of tail, unit or part.
fn heads(changes: &[QuantityChange]) -> Vec<(&str, &str, &str, String)> {
    let head = |c: &'_ QuantityChange| {
        let name = c.serial_number.clone().or(c.tail_number.clone()).or(c.part_number.clone());
        (c.quantity, c.scope, c.kind, name.unwrap())
    };
    let mut heads: Vec<_> = changes.iter().map(head).collect();
    heads.sort();
    heads
}

#[test]
fn a_fleet_that_stays_has_no_change_under_a_season() {
    let (rows, found) = followed(nothing);
    assert_eq!(found.changes, [], "{:#?}", found.changes);
    assert_eq!(found.rows.len(), 10 * rows.len());
    assert!(found.rows.iter().all(|row| row.state.is_none()));
    assert!(rows.iter().all(|row| row.conditions.is_empty()));
}

#[test]
fn changes_of_single_units_are_theirs() {
    let (rows, found) = followed(|at, e| {
        if at.is(0, 0) {
            scale(&mut e.stiffness_n_per_m, 1.0 - 0.10 * at.drift());
        }
        if at.is(1, 2) {
            friction(e, 1.0 + 0.20 * at.drift());
        }
        if at.is(2, 1) && at.flight >= 470 {
            add(&mut e.load_zero_n, 0.05 * LOAD_N);
        }
        if at.is(3, 3) && at.flight >= 300 {
            add(&mut e.skew_s, 1e-3);
        }
    });
    let expected = [
        ("friction_n", "unit", "drift", "T1-elevator_left".to_owned()),
        ("load_zero_n", "unit", "step", "T2-aileron_right".to_owned()),
        ("skew_s", "unit", "step", "T3-elevator_right".to_owned()),
        ("stiffness_n_per_m", "unit", "drift", "T0-aileron_left".to_owned()),
    ];
    assert_eq!(heads(&found.changes), expected, "{:#?}", found.changes);
    let state = |serial: &str| rows.iter().find(|r| r.serial_number == serial).unwrap().conditions.clone();
    assert_eq!(state("T0-aileron_left"), ["softening"]);
    assert_eq!(state("T1-elevator_left"), ["friction_rising"]);
    assert_eq!(state("T2-aileron_right"), ["load_zero_moved"]);
    assert_eq!(state("T3-elevator_right"), ["delay_moved"]);
    let of = |quantity: &str| found.changes.iter().find(|c| c.quantity == quantity).unwrap();
    assert_eq!(of("skew_s").since_utc, departure(300));
    assert_eq!(of("load_zero_n").since_utc, departure(470));
    assert!((of("skew_s").to - of("skew_s").from - 1e-3).abs() < 2e-5);
    let softer = of("stiffness_n_per_m");
    assert!((softer.to / softer.from - 0.90).abs() < 0.01, "{softer:?}");
    assert!(softer.evidence.contains("stiffness drifted by -"), "{}", softer.evidence);
}

#[test]
fn a_part_has_limits_of_its_own() {
    let limits = "[part.\"EMA-27-1040\".quantity_limits]\nstiffness_share = 0.5\n\n[logs]";
    let (rows, _) = assessed(
        &fleet::config_with("[logs]", limits),
        |at, e| {
            if at.is(0, 0) || at.is(1, 2) {
                scale(&mut e.stiffness_n_per_m, 1.0 - 0.10 * at.drift());
            }
        },
        false,
    );
    let soft = rows.iter().filter(|row| row.conditions.iter().any(|c| c == "softening"));
    assert_eq!(soft.map(|row| row.serial_number.as_str()).collect::<Vec<_>>(), ["T1-elevator_left"]);
}

#[test]
fn changes_of_all_units_of_a_tail_are_the_tails_and_give_no_unit_a_state() {
    let (rows, found) = followed(|at, e| {
        if at.tail == 1 && at.flight >= 300 {
            // A load cell that reads 5 % too much.
            scale(&mut e.stiffness_n_per_m, 1.05);
        }
        if at.tail == 3 && at.flight >= 480 {
            add(&mut e.skew_s, 1e-3);
        }
    });
    let expected =
        [("skew_s", "tail", "step", "T3".to_owned()), ("stiffness_n_per_m", "tail", "step", "T1".to_owned())];
    assert_eq!(heads(&found.changes), expected, "{:#?}", found.changes);
    assert!(rows.iter().all(|row| row.conditions.is_empty()));
    let gain = found.changes.iter().find(|c| c.quantity == "stiffness_n_per_m").unwrap();
    assert_eq!((gain.since_utc, gain.units, gain.units_able), (departure(300), 4, 4));
    assert!((gain.to / gain.from - 1.05).abs() < 0.002, "{gain:?}");
    assert!(
        gain.evidence.contains("4 of 4 units of T1") && gain.evidence.contains("sensor, recorder or wiring")
    );
}

#[test]
fn a_change_of_all_units_of_a_part_is_the_parts() {
    let (rows, found) = followed(|at, e| {
        if at.position >= 2 && at.flight >= 250 {
            friction(e, 1.5);
            add(&mut e.skew_s, 0.4e-3);
        }
    });
    let of_part =
        |c: &&QuantityChange| c.part_number.as_deref() == Some("EMA-27-1060") && c.serial_number.is_none();
    let named: Vec<&str> = found.changes.iter().filter(of_part).map(|c| c.quantity).collect();
    assert!(named.contains(&"skew_s") && named.contains(&"friction_n"), "{:#?}", found.changes);
    assert!(found.changes.iter().all(|c| c.scope == "part"), "{:#?}", found.changes);
    assert!(found.changes.iter().all(|c| c.since_utc == departure(250)), "{:#?}", found.changes);
    assert!(rows.iter().all(|row| row.conditions.is_empty()));
}

#[test]
fn a_unit_that_moves_to_a_tail_with_another_load_cell_has_not_softened() {
    // Units of tails 0 and 1 at one position change places in the logs: the cell of tail 1 reads 8 %
    // more than that of tail 0.
    let plant: Plant = |at, e| {
        if at.tail == 1 {
            scale(&mut e.stiffness_n_per_m, 1.08);
        }
    };
    let (_, found) = assessed(&fleet::config(), plant, true);
    assert_eq!(found.changes, [], "{:#?}", found.changes);
    let moved =
        found.rows.iter().find(|r| r.serial_number == "T0-aileron_left" && r.quantity == "stiffness_n_per_m");
    let step = &moved.unwrap().steps[0];
    assert_eq!((step.departure_utc, step.scope), (departure(FLIGHTS / 2), "tail"));
    assert!((step.size / 5e7 - 0.08).abs() < 0.002, "{moved:#?}");
}
