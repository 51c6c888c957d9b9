//! Changes that wear does not make: the delay between the positions jumps when a recorder, a sensor or its
//! wiring is changed, the fitted stiffness of all actuators of an aircraft when what measures load is, and the zero and
//! the delay of a load channel when its cell or its wiring is.

use std::collections::{BTreeMap, BTreeSet};

use jiff::Timestamp;
use records::uncertainty::SD_OVER_MAD;
use serde::Serialize;
use store::Store;

use crate::error::Error;
use crate::monitoring::REPORTED_DAYS;
use crate::monitoring::recent::{FlightDiagnostics, RecentDiagnostics, newest_utc, recent_diagnostics};
use records::time::days_between;

/// What moved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// The delay of the screw's channel against the motor's, s.
    SkewS,
    /// The fitted stiffness, N/m.
    StiffnessNPerM,
    /// The zero of the load cell, N.
    LoadZeroN,
    /// The delay of the load's channel against the positions, s.
    LoadDelayS,
}

/// A quantity that moved, on one aircraft.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RecorderChange {
    /// The aircraft.
    pub tail_number: String,
    /// What moved, with its unit.
    pub quantity: Quantity,
    /// The positions it moved in.
    pub positions: Vec<String>,
    /// Whether these are all positions of the aircraft that could show it, and two at least: a matter of
    /// what records them, not of any of them.
    pub everywhere: bool,
    /// The first flight of the new level.
    pub since_utc: Timestamp,
    /// Median before and after; that of the first position.
    pub from: f64,
    /// See `from`.
    pub to: f64,
}

impl RecorderChange {
    /// Whether a change on that aircraft may be this one.
    pub(crate) fn explains(&self, tail_number: &str, departure_utc: Timestamp) -> bool {
        self.everywhere
            && self.tail_number == tail_number
            && days_between(self.since_utc, departure_utc).abs() <= SAME_DAYS
    }
}

/// Least numbers of flights before a change, and after it, from which it is detected.
const LEAST_BEFORE: usize = 5;
const LEAST_AFTER: usize = 3;
/// Largest number of latest flights of a position that are tested.
const MAX_FLIGHTS: usize = 200;
/// Least change in standard errors of a difference of medians.
const LEAST_CERTAINTY: f64 = 8.0;
/// Days within which changes of one aircraft are one change.
const SAME_DAYS: f64 = 3.0;

/// Bounds of a significant change.
#[derive(Debug, Clone, Copy)]
struct Bounds {
    least_step: f64,
    /// Smallest assumed scatter of a fitted value.
    least_scatter: f64,
}

/// Half a millisecond costs about 1.5 % of a gap of 100 µm on the published statistic; less is let pass.
const SKEW_S: Bounds = Bounds { least_step: 0.5e-3, least_scatter: 0.05e-3 };
/// Of the logarithm: 4 %, which no unit's stiffness does from one flight to the next.
const LN_STIFFNESS: Bounds = Bounds { least_step: 0.04, least_scatter: 0.005 };
/// A load that is a millisecond late widens the loop of δX over the load by a per cent or so; less is let pass.
const LOAD_DELAY_S: Bounds = Bounds { least_step: 1e-3, least_scatter: 0.1e-3 };
/// Shares of the 95 % load: a zero that moves by less leaves the gap alone.
const LOAD_ZERO: Bounds = Bounds { least_step: 0.02, least_scatter: 0.002 };

/// What moved within the last month before a day that the store holds.
///
/// # Errors
/// When the store cannot be read.
pub(crate) fn detect_changes_in_store(store: &Store, as_of: Timestamp) -> Result<Vec<RecorderChange>, Error> {
    Ok(detect_changes(&recent_diagnostics(store, as_of)?))
}

/// The delays, and the stiffnesses of whole aircraft, that moved within the last month of these flights.
///
/// One unit's stiffness changes with the unit; a change of all of them at once is a change of the recorder.
pub fn detect_changes(recent_diagnostics: &RecentDiagnostics) -> Vec<RecorderChange> {
    let (skews, stiffnesses) = (skews_s(recent_diagnostics), ln_stiffnesses(recent_diagnostics));
    let newest = newest_utc(recent_diagnostics);
    let usual_n = usual_loads_n(recent_diagnostics);
    let (zeros, delays) = (load_zeros(recent_diagnostics, &usual_n), load_delays_s(recent_diagnostics));
    let mut found = of_quantity(&skews, Quantity::SkewS, SKEW_S);
    found.extend(of_quantity(&stiffnesses, Quantity::StiffnessNPerM, LN_STIFFNESS).into_iter().filter_map(
        |m| {
            let (from, to) = (m.from.exp(), m.to.exp());
            m.everywhere.then_some(RecorderChange { from, to, ..m })
        },
    ));
    found.extend(of_quantity(&delays, Quantity::LoadDelayS, LOAD_DELAY_S));
    found.extend(of_quantity(&zeros, Quantity::LoadZeroN, LOAD_ZERO).into_iter().filter_map(|m| {
        let load_n = usual_n.get(&(m.tail_number.as_str(), m.positions.first()?.as_str()))?;
        Some(RecorderChange { from: m.from * load_n, to: m.to * load_n, ..m })
    }));
    found.retain(|detect_changes| {
        newest.is_some_and(|newest| days_between(detect_changes.since_utc, newest) <= REPORTED_DAYS)
    });
    found.sort_by(|a, b| {
        (&a.tail_number, a.quantity, a.since_utc).cmp(&(&b.tail_number, b.quantity, b.since_utc))
    });
    found
}

type Values = Vec<(Timestamp, f64)>;

/// The values of each tail's positions, by departure.
type Tails<'a> = BTreeMap<&'a str, Vec<(&'a str, Values)>>;

fn values(diagnostics: &[FlightDiagnostics], value: impl Fn(&FlightDiagnostics) -> Option<f64>) -> Values {
    diagnostics
        .iter()
        .filter_map(|diagnostics| Some((diagnostics.departure_utc, value(diagnostics)?)))
        .collect()
}

/// A delay is the position's, whichever unit sits there.
fn skews_s(recent_diagnostics: &RecentDiagnostics) -> Tails<'_> {
    by_place(recent_diagnostics, |diagnostics| diagnostics.skew_s)
}

/// Delays of the load that are certain enough to show a step.
fn load_delays_s(recent_diagnostics: &RecentDiagnostics) -> Tails<'_> {
    let is_certain = |se_s: &f64| *se_s < LOAD_DELAY_S.least_step;
    by_place(recent_diagnostics, |diagnostics| {
        diagnostics.load_delay_se_s.filter(is_certain).and(diagnostics.load_delay_s)
    })
}

/// The values of each place, whichever unit sits there, in order of time.
fn by_place(
    recent_diagnostics: &RecentDiagnostics,
    value: impl Fn(&FlightDiagnostics) -> Option<f64>,
) -> Tails<'_> {
    let mut places: BTreeMap<(&str, &str), Values> = BTreeMap::new();
    for (position, diagnostics) in recent_diagnostics {
        let place = places.entry((&position.tail_number, &position.position)).or_default();
        place.extend(values(diagnostics, &value));
    }
    let mut tails = Tails::new();
    for ((tail, position), mut values) in places {
        values.sort_by_key(|(at, _)| *at);
        tails.entry(tail).or_default().push((position, values));
    }
    tails
}

/// The zero of the load cell as a share of the usual 95 % load, where it is certain enough; the cell is the unit's.
fn load_zeros<'a>(recent_diagnostics: &'a RecentDiagnostics, usual_n: &UsualLoads<'_>) -> Tails<'a> {
    let mut tails = Tails::new();
    for (position, diagnostics) in recent_diagnostics {
        let place = (position.tail_number.as_str(), position.position.as_str());
        let Some(&load_n) = usual_n.get(&place) else { continue };
        let values = values(diagnostics, |diagnostics| {
            let se_n = diagnostics.load_zero_se_n?;
            (se_n < LOAD_ZERO.least_step * load_n).then_some(diagnostics.load_zero_n? / load_n)
        });
        tails.entry(&position.tail_number).or_default().push((&position.position, values));
    }
    tails
}

/// Median 95 % load by tail and position, N.
type UsualLoads<'a> = BTreeMap<(&'a str, &'a str), f64>;

fn usual_loads_n(recent_diagnostics: &RecentDiagnostics) -> UsualLoads<'_> {
    let mut loads_n: BTreeMap<(&str, &str), Vec<f64>> = BTreeMap::new();
    for (position, diagnostics) in recent_diagnostics {
        let place = loads_n.entry((&position.tail_number, &position.position)).or_default();
        place.extend(diagnostics.iter().filter_map(|flight| flight.load_p95_n.map(f64::abs)));
    }
    loads_n.into_iter().filter(|(_, all)| !all.is_empty()).map(|(place, all)| (place, median(all))).collect()
}

/// A stiffness is the unit's, wherever it sits.
fn ln_stiffnesses(recent_diagnostics: &RecentDiagnostics) -> Tails<'_> {
    let mut tails = Tails::new();
    for (position, diagnostics) in recent_diagnostics {
        let values = values(diagnostics, |diagnostics| {
            diagnostics.stiffness_n_per_m.filter(|k| *k > 0.0).map(f64::ln)
        });
        tails.entry(&position.tail_number).or_default().push((&position.position, values));
    }
    tails
}

/// The clearest change of each place's latest values, those of one aircraft at one time together.
fn of_quantity(tails: &Tails<'_>, quantity: Quantity, bounds: Bounds) -> Vec<RecorderChange> {
    let mut found: Vec<RecorderChange> = Vec::new();
    for (&tail, places) in tails {
        let from = found.len();
        for (position, values) in places {
            let latest = &values[values.len().saturating_sub(MAX_FLIGHTS)..];
            let Some((since_utc, from_value, to)) = step(latest, bounds) else { continue };
            let is_same = |m: &&mut RecorderChange| days_between(m.since_utc, since_utc).abs() <= SAME_DAYS;
            match found[from..].iter_mut().find(is_same) {
                Some(known) => known.positions.push((*position).to_owned()),
                None => found.push(RecorderChange {
                    tail_number: tail.to_owned(),
                    quantity,
                    positions: vec![(*position).to_owned()],
                    everywhere: false,
                    since_utc,
                    from: from_value,
                    to,
                }),
            }
        }
        for detect_changes in &mut found[from..] {
            let able: BTreeSet<&str> = places
                .iter()
                .filter(|(_, values)| has_enough_flights(values, detect_changes.since_utc))
                .map(|(p, _)| *p)
                .collect();
            detect_changes.everywhere =
                able.len() >= 2 && able.iter().all(|p| detect_changes.positions.iter().any(|m| m == p));
        }
    }
    found
}

/// Whether there are flights enough on both sides of a change.
fn has_enough_flights(values: &[(Timestamp, f64)], since_utc: Timestamp) -> bool {
    let before = values.partition_point(|(at, _)| *at < since_utc);
    before >= LEAST_BEFORE && values.len() - before >= LEAST_AFTER
}

/// The clearest jump of a series: when, from where, to where.
fn step(flights: &[(Timestamp, f64)], bounds: Bounds) -> Option<(Timestamp, f64, f64)> {
    let values: Vec<f64> = flights.iter().map(|(_, skew)| *skew).collect();
    let last = values.len().checked_sub(LEAST_AFTER)?;
    // The split with the smallest absolute residuals around two medians.
    let (at, from, to, off) = (LEAST_BEFORE..=last)
        .map(|at| {
            let (before, after) = values.split_at(at);
            let (from, to) = (median(before.to_vec()), median(after.to_vec()));
            let off = before.iter().map(|v| (v - from).abs()).chain(after.iter().map(|v| (v - to).abs()));
            (at, from, to, off.collect::<Vec<f64>>())
        })
        .min_by(|a, b| a.3.iter().sum::<f64>().total_cmp(&b.3.iter().sum()))?;
    let scatter = (SD_OVER_MAD * median(off)).max(bounds.least_scatter);
    let (before, after) = (at as f64, (values.len() - at) as f64);
    // The median of a normal sample scatters 1.25 times as much as its mean.
    let error = 1.25 * scatter * (before.recip() + after.recip()).sqrt();
    let is_moved = (to - from).abs() >= (LEAST_CERTAINTY * error).max(bounds.least_step);
    is_moved.then(|| (flights[at].0, from, to))
}

/// The upper median of at least one value.
pub(crate) fn median(mut values: Vec<f64>) -> f64 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::monitoring::recent::PositionKey;

    /// Scatter of ± 0.2 ms, the same in every run.
    fn flights(count: i64, seed: u64, level: impl Fn(i64) -> f64) -> Vec<(Timestamp, f64)> {
        let mut state = seed;
        let mut scatter = || {
            let mut sum = 0.0;
            for _ in 0..12 {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                sum += (state >> 11) as f64 / (1_u64 << 53) as f64;
            }
            0.2e-3 * (sum - 6.0)
        };
        let at = |k: i64| Timestamp::from_second(1_763_500_000 + 86_400 * k).unwrap();
        (0..count).map(|k| (at(k), level(k) + scatter())).collect()
    }

    #[test]
    fn a_new_recorder_is_seen_within_a_few_flights_and_dated() {
        let series = flights(30, 7, |k| if k < 26 { 0.1e-3 } else { 2.1e-3 });
        let (since, from, to) = step(&series, SKEW_S).unwrap();
        assert_eq!(since, series[26].0);
        assert!((from - 0.1e-3).abs() < 0.2e-3 && (to - 2.1e-3).abs() < 0.3e-3, "{from} s to {to} s");
    }

    /// A thousand units whose delay stays: at most one in a hundred is called moved.
    #[test]
    fn a_delay_that_stays_is_left_alone() {
        let alarms = (0..1000)
            .filter(|seed| step(&flights(40, seed * 7919 + 1, |_| 0.3e-3), SKEW_S).is_some())
            .count();
        assert!(alarms <= 10, "{alarms} of 1,000");
    }

    #[test]
    fn too_few_flights_show_nothing() {
        assert_eq!(step(&flights(7, 1, |k| if k < 4 { 0.0 } else { 5e-3 }), SKEW_S), None);
        assert_eq!(step(&[], SKEW_S), None);
    }

    /// Places of one tail, each with values of its own about a stiffness that changes with a flight.
    fn recent_diagnostics(places: &[(&str, f64)], changes_at: i64) -> RecentDiagnostics {
        let diagnostics = |seed: usize, factor: f64| {
            let skews = flights(60, seed as u64 + 3, |_| 0.1e-3);
            let diagnostics = |(k, (departure_utc, skew_s)): (usize, (Timestamp, f64))| FlightDiagnostics {
                departure_utc,
                flight_id: k.to_string().into(),
                skew_s: Some(skew_s),
                // The scatter of ± 0.2 ms corresponds to one of 2 %.
                stiffness_n_per_m: Some(
                    8e7 * (1.0 + 100.0 * (skew_s - 0.1e-3))
                        * if k as i64 >= changes_at { factor } else { 1.0 },
                ),
                ..FlightDiagnostics::default()
            };
            skews.into_iter().enumerate().map(diagnostics).collect()
        };
        let position = |position: &str| PositionKey {
            tail_number: "N1".into(),
            position: position.into(),
            part_number: "EMA".into(),
            serial_number: position.to_uppercase(),
        };
        places
            .iter()
            .enumerate()
            .map(|(i, (name, factor))| (position(name), diagnostics(i, *factor)))
            .collect()
    }

    #[test]
    fn a_stiffness_that_moves_everywhere_speaks_of_the_recorder_and_of_one_unit_of_that_unit() {
        let all = recent_diagnostics(&[("a", 1.1), ("b", 1.1), ("c", 1.12)], 45);
        let [change] = &detect_changes(&all)[..] else { panic!("{:?}", detect_changes(&all)) };
        assert_eq!((change.quantity, change.everywhere), (Quantity::StiffnessNPerM, true));
        assert_eq!(change.positions, ["a", "b", "c"]);
        assert!((change.to / change.from - 1.1).abs() < 0.02, "{change:?}");
        assert!(change.explains("N1", change.since_utc) && !change.explains("N2", change.since_utc));
        assert_eq!(detect_changes(&recent_diagnostics(&[("a", 1.1), ("b", 1.0), ("c", 1.0)], 45)), []);
        assert_eq!(detect_changes(&recent_diagnostics(&[("a", 1.1)], 45)), []);
    }

    #[test]
    fn a_load_cell_whose_zero_moves_is_named_in_newtons_and_an_uncertain_zero_shows_nothing() {
        let flights = |se_n: f64| -> RecentDiagnostics {
            let flight = |(k, (departure_utc, scatter)): (usize, (Timestamp, f64))| FlightDiagnostics {
                departure_utc,
                // The scatter of ± 0.2 ms corresponds to one of 20 N.
                load_zero_n: Some(if k < 30 { 50.0 } else { 450.0 } + 1e5 * scatter),
                load_zero_se_n: Some(se_n),
                load_p95_n: Some(7_000.0),
                ..FlightDiagnostics::default()
            };
            let key = PositionKey {
                tail_number: "N1".into(),
                position: "ail_l".into(),
                part_number: "EMA".into(),
                serial_number: "1".into(),
            };
            let flights = flights(40, 11, |_| 0.0);
            BTreeMap::from([(key, flights.into_iter().enumerate().map(flight).collect())])
        };
        let [change] = &detect_changes(&flights(30.0))[..] else {
            panic!("{:?}", detect_changes(&flights(30.0)))
        };
        assert_eq!((change.quantity, change.everywhere), (Quantity::LoadZeroN, false));
        assert!((change.from - 50.0).abs() < 20.0 && (change.to - 450.0).abs() < 30.0, "{change:?}");
        assert_eq!(detect_changes(&flights(500.0)), []);
    }
}
