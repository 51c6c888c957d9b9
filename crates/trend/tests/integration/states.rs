//! States of drawn histories: none less urgent than due, and hardly a false alarm.

use trend::State::{self, Act, Normal, Plan, Unassessed, Watch};
use trend::{MaintenanceEvent, Observation, assess};

use crate::histories::{DAY_US, Drawn, LIMIT_UM, prior, settings};

/// A kind of history: its name, the state that is due at least (`Normal` where the records alone give it), and what happens
/// to the unit, in order, in the words of [`happen`].
pub(crate) struct Kind {
    name: &'static str,
    due: State,
    steps: &'static str,
}

const UNITS: u64 = 100;

/// The kinds of `states.txt` that must be acted on, or those that call for nothing.
pub(crate) fn kinds(is_urgent: bool) -> Vec<Kind> {
    let (urgent, calm) = include_str!("../data/states.txt").split_once("\n\n").unwrap();
    let kind = |line: &'static str| {
        let [due, name, steps] = line.split(" | ").collect::<Vec<_>>().try_into().unwrap();
        let states = [Normal, Unassessed, Watch, Plan, Act].into_iter();
        let due = states.into_iter().find(|state| format!("{state:?}") == due).unwrap();
        Kind { name, due, steps }
    };
    let lines = if is_urgent { urgent } else { calm }.lines();
    lines.filter(|line| !line.starts_with('#')).map(kind).collect()
}

fn happen(d: &mut Drawn, step: &str) {
    let mut words = step.split(' ');
    let word = words.next().unwrap();
    let n: Vec<f64> = words.map(|number| number.parse().unwrap()).collect();
    let count = || (n[0] as usize, n[1] as usize);
    match word {
        "life" => d.stay(if d.every > 1 { (6, 60) } else { (8, 300) }, (40.0, 90.0)),
        "every" => d.every = n[0] as i64,
        "error" => d.error_um = d.between(n[0], n[1]),
        "begin" => d.um = d.between(n[0], n[1]),
        "stay" => d.stay(count(), (n[2], n[3])),
        "above" => d.above(count(), (n[2], n[3])),
        "above_errors" => d.above(count(), (n[2] * d.error_um, n[3] * d.error_um)),
        "jump" => d.jump(count()),
        "rise" => d.rise(count(), (n[2], n[3]), (n[4], n[5])),
        "level" => d.logs(n[0] as usize, |_| n[1]),
        "back" => d.log(d.um),
        "off" => d.log(d.um + n[0] + n[1] * d.error_um.max(1.0)),
        "doubt" => d.doubt(d.rows.len().min(n[0] as usize)),
        "refused" => (0..d.count(n[0] as usize, n[1] as usize)).for_each(|_| d.flown(None)),
        "moved" => d.installation += 1,
        "reshimmed" => {
            let utc_us = d.now_us() + DAY_US / 4;
            d.maintenance.push(MaintenanceEvent { utc_us, renews: true });
        }
        "paused" => d.flight += 2 * n[0] as i64,
        "wild_among_last_three" => {
            let (back, off_um) = (d.count(1, 3), 30.0 * (d.between(0.0, 2.0).floor() - 0.5));
            let at = d.rows.len() - back;
            d.rows[at].gap_m = d.rows[at].gap_m.map(|gap_m| gap_m + 1e-6 * off_um);
        }
        "stairs" => {
            let (um, step_um, every) = (d.um, d.between(5.0, 12.0), d.count(2, 4));
            let steps = ((0.93 * LIMIT_UM - um) / step_um) as usize;
            (1..=steps).for_each(|step| d.logs(every, |_| um + step_um * step as f64));
        }
        "all_flagged" => {
            let count = d.count(1, 6);
            d.logs(count, |_| 70.0);
            d.doubt(count);
        }
        "jump_below_the_limit" => {
            let least_um = (0.15 * LIMIT_UM).max(6.0 * d.error_um) + 5.0 * d.error_um;
            d.above((1, 10), (least_um, least_um.max(0.93 * LIMIT_UM - d.um)));
        }
        "slow_wear" => d.rise((60, 300), (d.um / LIMIT_UM, (d.um + 10.0) / LIMIT_UM), (1.0, 1.0)),
        // Single records above the limit, each followed by records below it.
        "in_turn" => {
            let [least, most, least_below, most_below] = [0, 1, 2, 3].map(|k| n[k] as usize);
            for _ in 0..d.count(least, most) {
                d.jump((1, 1));
                d.above((least_below, most_below), (0.0, 0.0));
            }
        }
        other => panic!("{other} happens to no unit"),
    }
}

/// Histories of a kind, with the due state of each.
pub(crate) fn drawn(kind: &Kind, number: u64) -> Vec<(Drawn, State)> {
    let one = |seed: u64| {
        let mut drawn = Drawn::new(1000 * number + seed, 1);
        kind.steps.split("; ").for_each(|step| happen(&mut drawn, step));
        let due = drawn.due().max(kind.due);
        (drawn, due)
    };
    (0..UNITS).map(one).collect()
}

/// Units of some kinds whose state is off the due one, each other unit without a fleet.
fn off(first: u64, kinds: &[Kind], is_off: fn(State, State) -> bool) -> Vec<String> {
    let calm: Vec<Drawn> =
        drawn(&self::kinds(false)[6], 99).into_iter().take(40).map(|(drawn, _)| drawn).collect();
    let (fleet, settings, mut all) = (prior(&calm), settings(), Vec::new());
    for (number, kind) in (first..).zip(kinds) {
        for (k, (drawn, due)) in drawn(kind, number).into_iter().enumerate() {
            let prior = k.is_multiple_of(2).then_some(&fleet);
            let found = assess(&drawn.series(), drawn.now_us(), &settings, prior).unwrap();
            let shown_um = found.level.map_or(f64::NAN, |level| level.gap_m * 1e6);
            if is_off(found.state, due) {
                let (state, reason) = (found.state, found.reason);
                all.push(format!(
                    "{}, unit {k}: {state:?} for {due:?}, {shown_um:.1} µm: {reason}",
                    kind.name
                ));
            }
        }
    }
    all
}

#[test]
fn no_unit_that_must_be_acted_on_is_given_less() {
    let missed = off(1, &kinds(true), |found, due| found < due);
    assert!(missed.is_empty(), "{} missed: {missed:#?}", missed.len());
}

#[test]
fn calm_units_raise_no_alarm() {
    let calm = kinds(false);
    let alarms = off(51, &calm, |found, due| found > due);
    assert!(alarms.len() * 1000 <= 3 * calm.len() * UNITS as usize, "{} alarms: {alarms:#?}", alarms.len());
}

/// Units with large errors, assessed after each of a hundred flights.
#[test]
fn healthy_units_are_seldom_planned_in_a_hundred_flights() {
    let is_planned = |seed: &u64| {
        let mut d = Drawn::new(7000 + seed, 1);
        d.error_um = d.between(2.5, 8.0);
        d.stay((100, 100), (30.0, 60.0));
        let series = d.series();
        let state = |row: &Observation| assess(&series, row.departure_us, &settings(), None).unwrap().state;
        d.rows.iter().any(|row| state(row) >= Plan)
    };
    let planned = (0..50).filter(is_planned).count();
    assert!(planned <= 3, "{planned} of 50");
}

/// The level shown is that of the last records, and its interval holds the truth.
#[test]
fn the_level_is_that_of_the_last_records() {
    let mut held = 0;
    for seed in 0..300 {
        let mut d = Drawn::new(seed + 5000, 1);
        happen(&mut d, "life");
        let um = d.um;
        let (to_um, logs) = (um + d.between(0.0, 50.0), d.count(1, 60));
        d.logs(logs, |t| um + (to_um - um) * t);
        let level = assess(&d.series(), d.now_us(), &settings(), None).unwrap().level.unwrap();
        held += usize::from((level.gap_m * 1e6 - to_um).abs() <= 1.645 * level.se_m * 1e6);
        let reach_um = 7.0 * d.error_um;
        assert!((level.gap_m * 1e6 - to_um).abs() < reach_um, "{seed}: {level:?}, truth {to_um}");
    }
    println!("90 % intervals of the level hold {held} of 300");
    assert!(held >= 246, "{held} of 300");
}
