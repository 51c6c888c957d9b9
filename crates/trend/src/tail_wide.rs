//! Tail-wide steps: most units of a tail step at once, because its sensor or its recorder changed.

use std::collections::BTreeSet;

use crate::data::series::DAY_US;
use crate::math::median;

/// Time within which steps of one tail are one step: a step is dated to within some flights.
const SAME_US: i64 = 7 * DAY_US;

/// Minimum share of the tail's units that make the step: single units may be too noisy.
const SHARE: f64 = 0.75;

/// The gaps of one unit on one tail.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct UnitOnTail {
    /// Departures of its first and last gap there, microseconds since 1970 UTC.
    pub first_us: i64,
    /// See `first_us`.
    pub last_us: i64,
    /// Its unrecorded steps there: departure of the first flight after each, microseconds since 1970 UTC, and size, m.
    pub steps: Vec<(i64, f64)>,
}

/// A step that most units of a tail make together: one finding, of the tail.
#[derive(Debug, Clone, PartialEq)]
pub struct TailWideStep {
    /// Departures of the first flights after it, of the earliest and of the latest unit, microseconds since 1970 UTC.
    pub first_us: i64,
    /// See `first_us`.
    pub last_us: i64,
    /// Median size, m.
    pub step_m: f64,
    /// Number of units that make it, and of those with gaps before and after it.
    pub units: usize,
    /// See `units`.
    pub units_able: usize,
}

/// The tail-wide steps among the steps of a tail's units, by time: three quarters of the units with gaps before and
/// after it, and two at least, step in one direction within a week.
///
/// ```
/// use trend::{UnitOnTail, tail_wide_steps};
///
/// let day_us = |day: i64| day * 86_400_000_000;
/// let unit = |steps| UnitOnTail { first_us: 0, last_us: day_us(90), steps };
/// // Three of four actuators rise by some 15 µm within two days, where the fourth falls; one of them rises alone later.
/// let units = [
///     unit(vec![(day_us(40), 15e-6), (day_us(70), 9e-6)]),
///     unit(vec![(day_us(41), 14e-6)]),
///     unit(vec![(day_us(42), 16e-6)]),
///     unit(vec![(day_us(41), -15e-6)]),
/// ];
/// let found = tail_wide_steps(&units);
/// assert_eq!((found.len(), found[0].units, found[0].units_able), (1, 3, 4));
/// assert_eq!((found[0].first_us, found[0].last_us), (day_us(40), day_us(42)));
/// assert!((found[0].step_m - 15e-6).abs() < 1e-12);
/// ```
pub fn tail_wide_steps(units: &[UnitOnTail]) -> Vec<TailWideStep> {
    let mut found = of_sign(units, |step_m| step_m > 0.0);
    found.extend(of_sign(units, |step_m| step_m < 0.0));
    found.sort_by_key(|step| step.first_us);
    found
}

/// The tail-wide steps up, or those down: no sensor and no recorder moves one unit up and another down, but a swap of two
/// units does.
fn of_sign(units: &[UnitOnTail], is_of_sign: impl Fn(f64) -> bool) -> Vec<TailWideStep> {
    let of_unit = |(unit, on_tail): (usize, &UnitOnTail)| {
        let steps = on_tail.steps.iter().filter(|(_, step_m)| is_of_sign(*step_m));
        steps.map(move |(at_us, step_m)| (*at_us, unit, *step_m)).collect::<Vec<_>>()
    };
    let mut steps: Vec<(i64, usize, f64)> = units.iter().enumerate().flat_map(of_unit).collect();
    steps.sort_unstable_by_key(|step| (step.0, step.1));
    let mut found: Vec<TailWideStep> = Vec::new();
    let mut begin = 0;
    while let Some((first_us, ..)) = steps.get(begin).copied() {
        let end = begin + steps[begin..].partition_point(|step| step.0.saturating_sub(first_us) <= SAME_US);
        let stepped: BTreeSet<usize> = steps[begin..end].iter().map(|step| step.1).collect();
        let is_able =
            |unit: &&UnitOnTail| first_us.saturating_sub(unit.first_us) > SAME_US && unit.last_us >= first_us;
        let able = units.iter().filter(is_able).count();
        if stepped.len() < 2 || (stepped.len() as f64) < SHARE * able as f64 {
            begin += 1;
            continue;
        }
        let sizes_m: Vec<f64> = steps[begin..end].iter().map(|step| step.2).collect();
        found.push(TailWideStep {
            first_us,
            last_us: steps[end - 1].0,
            step_m: median(sizes_m).unwrap_or_default(),
            units: stepped.len(),
            units_able: able.max(stepped.len()),
        });
        begin = end;
    }
    found
}
