//! States of drawn histories: none less urgent than due, and hardly a false alarm.

use trend::State::{self, Act, Normal, Plan, Unassessed, Watch};
use trend::assess;

use crate::histories::{Drawn, LIMIT_UM, prior, settings};

/// Name, the state that is due at least (`Normal` where the records alone give it), and what happens to the unit, in order.
type Kind = (&'static str, State, &'static [fn(&mut Drawn)]);

const UNITS: u64 = 100;

/// The power of an even rise.
const LINE: (f64, f64) = (1.0, 1.0);

fn young_or_old(d: &mut Drawn) {
    d.stay(if d.every > 1 { (6, 60) } else { (8, 300) }, (40.0, 90.0));
}

fn one_of_the_last_three_is_wild(d: &mut Drawn) {
    let (back, off_um) = (d.count(1, 3), 30.0 * (d.between(0.0, 2.0).floor() - 0.5));
    let at = d.rows.len() - back;
    d.rows[at].gap_m = d.rows[at].gap_m.map(|gap_m| gap_m + 1e-6 * off_um);
}

fn rise_in_stairs(d: &mut Drawn) {
    let (um, step_um, every) = (d.um, d.between(5.0, 12.0), d.count(2, 4));
    let steps = ((0.93 * LIMIT_UM - um) / step_um) as usize;
    (1..=steps).for_each(|step| d.logs(every, |_| um + step_um * step as f64));
}

fn all_flagged(d: &mut Drawn) {
    let count = d.count(1, 6);
    d.logs(count, |_| 70.0);
    d.doubt(count);
}

fn jump_below_the_limit(d: &mut Drawn) {
    let least_um = (0.15 * LIMIT_UM).max(6.0 * d.error_um) + 5.0 * d.error_um;
    d.above((1, 10), (least_um, least_um.max(0.93 * LIMIT_UM - d.um)));
}

fn wild_records(d: &mut Drawn) {
    for _ in 0..d.count(1, 3) {
        d.jump(1, 1);
        d.above((2, 60), (0.0, 0.0));
    }
}

/// The kinds that must be acted on.
pub(crate) const URGENT: [Kind; 31] = [
    ("one above the limit", Normal, &[young_or_old, |d| d.jump(1, 1)]),
    ("jump above the limit", Normal, &[young_or_old, |d| d.jump(2, 8)]),
    ("linear rise, now above", Normal, &[young_or_old, |d| d.rise((2, 40), (1.02, 1.3), LINE)]),
    ("accelerating rise, now above", Normal, &[young_or_old, |d| d.rise((10, 80), (1.02, 1.3), (1.5, 3.0))]),
    ("all records above", Normal, &[|d| d.jump(2, 7)]),
    ("one record in all, above", Normal, &[|d| d.jump(1, 1)]),
    ("sparse logs, jump", Normal, &[|d| d.every = 24, young_or_old, |d| d.jump(2, 5)]),
    ("sparse logs, rise", Normal, &[|d| d.every = 24, young_or_old, |d| d.rise((3, 8), (1.02, 1.3), LINE)]),
    (
        "large errors, above",
        Normal,
        &[|d| d.error_um = d.between(4.0, 9.0), young_or_old, |d| d.stay((3, 8), (170.0, 260.0))],
    ),
    ("hours from the limit", Plan, &[young_or_old, |d| d.rise((4, 20), (0.88, 0.985), LINE)]),
    ("accelerating, near the limit", Plan, &[young_or_old, |d| d.rise((6, 20), (0.88, 0.985), (2.0, 2.0))]),
    (
        "hours from the limit, one of the last three records wild",
        Plan,
        &[young_or_old, |d| d.rise((10, 20), (0.88, 0.96), LINE), one_of_the_last_three_is_wild],
    ),
    ("rise in stairs", Plan, &[young_or_old, rise_in_stairs]),
    ("first records of an installation, all flagged", Unassessed, &[young_or_old, Drawn::moved, all_flagged]),
    (
        "one above the limit, then an impossible record",
        Plan,
        &[young_or_old, |d| d.jump(1, 1), |d| d.log(-40.0)],
    ),
    (
        "jump that no line swallows",
        Watch,
        &[
            |d| d.error_um = d.between(3.0, 5.0),
            |d| d.stay((5, 8), (45.0, 55.0)),
            |d| d.above((1, 1), (18.0 * d.error_um, 22.0 * d.error_um)),
        ],
    ),
    (
        "jump below the limit, then a record off its level",
        Watch,
        &[
            |d| d.stay((8, 60), (40.0, 60.0)),
            |d| d.above((4, 8), (45.0, 45.0)),
            |d| d.log(d.um + 45.0 + 12.0 * d.error_um.max(1.0)),
        ],
    ),
    ("two records, the second a jump", Watch, &[|d| d.stay((1, 1), (40.0, 60.0)), |d| d.log(d.um + 60.0)]),
    ("jump at an installation", Normal, &[young_or_old, Drawn::moved, |d| d.jump(1, 8)]),
    ("jump after a booked re-shim", Normal, &[young_or_old, Drawn::reshimmed, |d| d.jump(1, 8)]),
    ("jump after a long pause", Normal, &[young_or_old, |d| d.paused(150), |d| d.jump(1, 8)]),
    ("above, refused since", Act, &[young_or_old, |d| d.jump(2, 8), |d| d.refused(1, 80)]),
    ("flagged records above", Normal, &[young_or_old, |d| d.jump(1, 5), |d| d.doubt(d.rows.len().min(3))]),
    ("one low record after an exceedance", Act, &[young_or_old, |d| d.jump(2, 8), |d| d.log(d.um)]),
    (
        "above but for an outlier",
        Normal,
        &[young_or_old, |d| d.jump(4, 8), |d| d.log(d.um), |d| d.logs(2, |_| 200.0)],
    ),
    (
        "slow wear to the limit",
        Plan,
        &[|d| d.um = d.between(40.0, 60.0), |d| d.rise((200, 400), (1.01, 1.05), LINE)],
    ),
    ("jump that stays below the limit", Watch, &[young_or_old, jump_below_the_limit]),
    (
        "worn, then reset without an entry",
        Watch,
        &[
            |d| d.stay((20, 60), (40.0, 60.0)),
            |d| d.rise((100, 300), (0.7, 0.8), LINE),
            |d| d.above((8, 30), (0.0, 0.0)),
        ],
    ),
    (
        "one low record of another installation after an exceedance",
        Act,
        &[young_or_old, |d| d.jump(2, 8), Drawn::moved, |d| d.log(d.um)],
    ),
    (
        "moved for one record and back, above throughout",
        Act,
        &[|d| d.jump(2, 8), Drawn::moved, |d| d.jump(1, 1)],
    ),
    (
        "above and below in turn",
        Plan,
        &[young_or_old, |d| {
            for _ in 0..d.count(3, 20) {
                d.jump(1, 1);
                d.log(d.um);
            }
        }],
    ),
];

/// The kinds that call for nothing.
pub(crate) const CALM: [Kind; 7] = [
    ("calm", Normal, &[young_or_old]),
    ("calm, sparse logs", Normal, &[|d| d.every = 24, young_or_old]),
    (
        "calm, large errors",
        Normal,
        &[|d| d.error_um = d.between(3.0, 6.0), |d| d.stay((2, 300), (40.0, 60.0))],
    ),
    ("outliers that were not confirmed", Normal, &[young_or_old, wild_records]),
    ("few records", Normal, &[|d| d.stay((1, 8), (40.0, 90.0))]),
    ("moved, with a bias", Normal, &[young_or_old, Drawn::moved, |d| d.above((1, 60), (-4.0, 4.0))]),
    (
        "slow wear far from the limit",
        Normal,
        &[
            |d| d.um = d.between(30.0, 50.0),
            |d| d.rise((60, 300), (d.um / LIMIT_UM, (d.um + 10.0) / LIMIT_UM), LINE),
        ],
    ),
];

/// Histories of a kind, with the due state of each.
pub(crate) fn drawn(kind: Kind, number: u64) -> Vec<(Drawn, State)> {
    let one = |seed: u64| {
        let mut drawn = Drawn::new(1000 * number + seed, 1);
        kind.2.iter().for_each(|happens| happens(&mut drawn));
        let due = drawn.due().max(kind.1);
        (drawn, due)
    };
    (0..UNITS).map(one).collect()
}

/// Units of some kinds whose state is off the due one, each other unit without a fleet.
fn off(first: u64, kinds: &[Kind], is_off: fn(State, State) -> bool) -> Vec<String> {
    let calm: Vec<Drawn> = drawn(CALM[6], 99).into_iter().take(40).map(|(drawn, _)| drawn).collect();
    let (fleet, settings, mut all) = (prior(&calm), settings(), Vec::new());
    for (number, kind) in (first..).zip(kinds) {
        for (k, (drawn, due)) in drawn(*kind, number).into_iter().enumerate() {
            let prior = k.is_multiple_of(2).then_some(&fleet);
            let found = assess(&drawn.series(), drawn.now_us(), &settings, prior).unwrap();
            let shown_um = found.level.map_or(f64::NAN, |level| level.gap_m * 1e6);
            if is_off(found.state, due) {
                let (state, reason) = (found.state, found.reason);
                all.push(format!("{}, unit {k}: {state:?} for {due:?}, {shown_um:.1} µm: {reason}", kind.0));
            }
        }
    }
    all
}

#[test]
fn no_unit_that_must_be_acted_on_is_given_less() {
    let missed = off(1, &URGENT, |found, due| found < due);
    assert!(missed.is_empty(), "{} missed: {missed:#?}", missed.len());
}

#[test]
fn calm_units_raise_no_alarm() {
    let alarms = off(51, &CALM, |found, due| found > due);
    assert!(alarms.len() * 1000 <= 3 * CALM.len() * UNITS as usize, "{} alarms: {alarms:#?}", alarms.len());
}

/// The level shown is that of the last records, and its interval holds the truth.
#[test]
fn the_level_is_that_of_the_last_records() {
    let mut held = 0;
    for seed in 0..300 {
        let mut d = Drawn::new(seed + 5000, 1);
        young_or_old(&mut d);
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
