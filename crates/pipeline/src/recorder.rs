//! Changes that wear does not make: the delay between the positions jumps when a recorder, a sensor or its
//! wiring is changed. Wear never moves it.

use std::collections::BTreeMap;

use fleet::GapRecord;
use jiff::Timestamp;
use serde::Serialize;

/// A delay that moved, on one aircraft.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Moved {
    /// The aircraft.
    pub tail_number: String,
    /// The positions it moved in; all of them at once speak of the recorder.
    pub positions: Vec<String>,
    /// The first flight with the new delay.
    pub since_utc: Timestamp,
    /// Median delay before and after, s; that of the first position.
    pub from_s: f64,
    /// See `from_s`.
    pub to_s: f64,
}

/// So many flights before a change, and after it, are the least that show one.
const LEAST_BEFORE: usize = 5;
const LEAST_AFTER: usize = 3;
/// Half a millisecond costs about 1.5 % of a gap of 100 µm on the published statistic; less is let pass.
const LEAST_STEP_S: f64 = 0.5e-3;
/// Least change in standard errors of a difference of medians.
const LEAST_CERTAINTY: f64 = 8.0;
/// Scatter below which nothing is believed of a fitted delay, s.
const LEAST_SCATTER_S: f64 = 0.05e-3;
/// Changes of one aircraft this close together are one, days.
const SAME_DAYS: f64 = 3.0;
/// A change is told for so many days.
const TOLD_DAYS: f64 = 30.0;

/// The delays that moved within the last month of the records, aircraft by aircraft.
pub fn moved(records: &[GapRecord]) -> Vec<Moved> {
    let mut series: BTreeMap<(String, String), Vec<(Timestamp, f64)>> = BTreeMap::new();
    for record in records {
        if let Some(skew_s) = record.estimate.skew_s {
            let key = (record.flight.tail_number.to_string(), record.position.to_string());
            series.entry(key).or_default().push((record.flight.departure_utc, skew_s));
        }
    }
    let newest = records.iter().map(|r| r.flight.departure_utc).max();
    let mut found: Vec<Moved> = Vec::new();
    for ((tail_number, position), mut flights) in series {
        flights.sort_by_key(|(at, _)| *at);
        let Some((since_utc, from_s, to_s)) = step(&flights) else { continue };
        if newest.is_some_and(|newest| days(since_utc, newest) > TOLD_DAYS) {
            continue;
        }
        let same =
            |m: &&mut Moved| m.tail_number == tail_number && days(m.since_utc, since_utc).abs() <= SAME_DAYS;
        match found.iter_mut().find(same) {
            Some(known) => known.positions.push(position),
            None => found.push(Moved { tail_number, positions: vec![position], since_utc, from_s, to_s }),
        }
    }
    found
}

fn days(from: Timestamp, to: Timestamp) -> f64 {
    to.duration_since(from).as_secs_f64() / 86_400.0
}

/// The clearest jump of a series: when, from where, to where.
fn step(flights: &[(Timestamp, f64)]) -> Option<(Timestamp, f64, f64)> {
    let values: Vec<f64> = flights.iter().map(|(_, skew)| *skew).collect();
    let last = values.len().checked_sub(LEAST_AFTER)?;
    // Where two levels leave least unexplained, there the jump is, if it is one.
    let (at, from, to, off) = (LEAST_BEFORE..=last)
        .map(|at| {
            let (before, after) = values.split_at(at);
            let (from, to) = (median(before.to_vec()), median(after.to_vec()));
            let off = before.iter().map(|v| (v - from).abs()).chain(after.iter().map(|v| (v - to).abs()));
            (at, from, to, off.collect::<Vec<f64>>())
        })
        .min_by(|a, b| a.3.iter().sum::<f64>().total_cmp(&b.3.iter().sum()))?;
    let scatter = (1.4826 * median(off)).max(LEAST_SCATTER_S);
    let (before, after) = (at as f64, (values.len() - at) as f64);
    // The median of a normal sample scatters 1.25 times as much as its mean.
    let error = 1.25 * scatter * (before.recip() + after.recip()).sqrt();
    let is_moved = (to - from).abs() >= (LEAST_CERTAINTY * error).max(LEAST_STEP_S);
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
        let (since, from, to) = step(&series).unwrap();
        assert_eq!(since, series[26].0);
        assert!((from - 0.1e-3).abs() < 0.2e-3 && (to - 2.1e-3).abs() < 0.3e-3, "{from} s to {to} s");
    }

    /// A thousand units whose delay stays: at most one in a hundred is called moved.
    #[test]
    fn a_delay_that_stays_is_left_alone() {
        let alarms =
            (0..1000).filter(|seed| step(&flights(40, seed * 7919 + 1, |_| 0.3e-3)).is_some()).count();
        assert!(alarms <= 10, "{alarms} of 1,000");
    }

    #[test]
    fn too_few_flights_show_nothing() {
        assert_eq!(step(&flights(7, 1, |k| if k < 4 { 0.0 } else { 5e-3 })), None);
        assert_eq!(step(&[]), None);
    }
}
