//! What the units of a part share over the weeks: the season, or a change of all of them.
//!
//! Median polish (Tukey 1977) of weekly means: a level of each unit, and a deviation of each week. A tail counts once,
//! so that a sensor that serves a whole aircraft moves the curve no more than one unit does.

use std::collections::{BTreeMap, BTreeSet};

use super::QuantityValue;
use crate::math::{SD_OVER_MAD, median};

const WEEK_US: i64 = 7 * 86_400_000_000;
/// Fewest tails from which a week's deviation is taken.
const MIN_TAILS: usize = 3;
/// Sweeps of the polish.
const SWEEPS: usize = 10;
/// A median of a normal sample scatters this much more than its mean: √(π/2).
const MEDIAN_SE: f64 = 1.253_314_137_315_5;

/// Deviation of a part's units by week.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CommonCurve {
    weeks: BTreeMap<i64, f64>,
}

/// Weekly mean of a unit on a tail.
struct Cell {
    week: i64,
    unit: usize,
    tail: usize,
    mean: f64,
}

impl CommonCurve {
    /// The curve of some units, each with the tail it flies on; zero with fewer than three tails.
    pub fn fit<'a>(units: impl Iterator<Item = (usize, &'a [QuantityValue])>) -> Self {
        let cells: Vec<Cell> =
            units.enumerate().flat_map(|(unit, (tail, values))| cells(unit, tail, values)).collect();
        if cells.iter().map(|cell| cell.tail).collect::<BTreeSet<_>>().len() < MIN_TAILS {
            return Self::default();
        }
        let mut weeks: BTreeMap<i64, f64> = BTreeMap::new();
        let mut left = BTreeMap::new();
        for _ in 0..SWEEPS {
            let levels = levels(&cells, &weeks);
            left = by_week(&cells, &levels);
            weeks =
                left.iter().map(|(week, tails)| (*week, median(tails.clone()).unwrap_or_default())).collect();
        }
        Self { weeks: shrunk(weeks, &left) }
    }

    /// Deviation in the week of a departure, µs since 1970 UTC; of a week that no three tails flew in, of the nearest.
    pub fn at(&self, departure_us: i64) -> f64 {
        let week = departure_us.div_euclid(WEEK_US);
        let before = self.weeks.range(..=week).next_back();
        let after = self.weeks.range(week..).next();
        let near = before.into_iter().chain(after).min_by_key(|(other, _)| other.abs_diff(week));
        near.map_or(0.0, |(_, deviation)| *deviation)
    }
}

fn cells(unit: usize, tail: usize, values: &[QuantityValue]) -> impl Iterator<Item = Cell> {
    let week = |v: &QuantityValue| v.departure_us.div_euclid(WEEK_US);
    values.chunk_by(move |a, b| week(a) == week(b)).map(move |of_week| Cell {
        week: week(&of_week[0]),
        unit,
        tail,
        mean: of_week.iter().map(|v| v.value).sum::<f64>() / of_week.len() as f64,
    })
}

/// Level of each unit, the deviations of the weeks taken off.
fn levels(cells: &[Cell], weeks: &BTreeMap<i64, f64>) -> BTreeMap<usize, f64> {
    let mut of_unit: BTreeMap<usize, Vec<f64>> = BTreeMap::new();
    for cell in cells {
        let deviation = weeks.get(&cell.week).copied().unwrap_or_default();
        of_unit.entry(cell.unit).or_default().push(cell.mean - deviation);
    }
    of_unit.into_iter().filter_map(|(unit, values)| Some((unit, median(values)?))).collect()
}

/// Deviation of each tail in each week that enough tails flew in.
fn by_week(cells: &[Cell], levels: &BTreeMap<usize, f64>) -> BTreeMap<i64, Vec<f64>> {
    let mut sums: BTreeMap<(i64, usize), (f64, f64)> = BTreeMap::new();
    for cell in cells {
        let sum = sums.entry((cell.week, cell.tail)).or_default();
        *sum = (sum.0 + cell.mean - levels.get(&cell.unit).copied().unwrap_or_default(), sum.1 + 1.0);
    }
    let mut weeks: BTreeMap<i64, Vec<f64>> = BTreeMap::new();
    for ((week, _), (sum, count)) in sums {
        weeks.entry(week).or_default().push(sum / count);
    }
    weeks.retain(|_, tails| tails.len() >= MIN_TAILS);
    weeks
}

/// The curve drawn to zero by as much of its variance as its errors explain.
fn shrunk(weeks: BTreeMap<i64, f64>, left: &BTreeMap<i64, Vec<f64>>) -> BTreeMap<i64, f64> {
    let error = |week: &i64, value: f64| {
        let tails = left.get(week)?;
        let spread = SD_OVER_MAD * median(tails.iter().map(|v| (v - value).abs()).collect())?;
        Some((MEDIAN_SE * spread).powi(2) / tails.len() as f64)
    };
    let noise: f64 = weeks.iter().filter_map(|(week, value)| error(week, *value)).sum();
    let seen: f64 = weeks.values().map(|value| value * value).sum();
    let kept = if seen > 0.0 { (1.0 - noise / seen).max(0.0) } else { 0.0 };
    weeks.into_iter().map(|(week, value)| (week, kept * value)).collect()
}
