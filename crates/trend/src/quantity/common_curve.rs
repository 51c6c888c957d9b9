//! What the units of a part share over the weeks: the season, or a change of all of them.
//!
//! Median polish (Tukey 1977) of weekly means: a level of each unit, and a deviation of each week. A tail counts once,
//! so that a sensor that serves a whole aircraft moves the curve no more than one unit does.

use std::collections::BTreeMap;

use super::QuantityValue;
use crate::math::{SD_OVER_MAD, median};

const WEEK_US: i64 = 7 * 86_400_000_000;
/// Fewest tails from which a week's deviation is taken.
const MIN_TAILS: usize = 3;
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
    /// Deviation of the week, as the latest sweep found it; zero in a week that too few tails flew in.
    deviation: f64,
}

struct Deviation {
    week: i64,
    value: f64,
    variance: f64,
}

impl CommonCurve {
    /// The curve of some units, each with the tail it flies on; zero with fewer than three tails.
    pub fn fit<'a>(units: impl Iterator<Item = (usize, &'a [QuantityValue])>) -> Self {
        let mut cells: Vec<Cell> = Vec::new();
        for (unit, (tail, values)) in units.enumerate() {
            cells.extend(values.chunk_by(|a, b| week(a) == week(b)).map(|of_week| Cell {
                week: week(&of_week[0]),
                unit,
                tail,
                mean: of_week.iter().map(|v| v.value).sum::<f64>() / of_week.len() as f64,
                deviation: 0.0,
            }));
        }
        let count = cells.last().map_or(0, |cell| cell.unit + 1);
        // A stable sort: within a week and tail, units stay in order.
        cells.sort_by_key(|cell| (cell.week, cell.tail));
        let mut curve = Vec::new();
        for _ in 0..SWEEPS {
            let levels = levels(&cells, count);
            let weeks = cells.chunk_by_mut(|a, b| a.week == b.week);
            curve = weeks.filter_map(|of_week| deviation(of_week, &levels)).collect();
        }
        // The curve is drawn to zero by as much of its variance as its errors explain.
        let noise: f64 = curve.iter().map(|week| week.variance).sum();
        let seen: f64 = curve.iter().map(|week| week.value * week.value).sum();
        let kept = if seen > 0.0 { (1.0 - noise / seen).max(0.0) } else { 0.0 };
        let kept_weeks = curve.into_iter().filter(|_| kept > 0.0);
        Self { weeks: kept_weeks.map(|week| (week.week, kept * week.value)).collect() }
    }

    /// Takes the curve off the values of a unit, in order of departure.
    pub fn take_off(&self, values: &mut [QuantityValue]) {
        for of_week in values.chunk_by_mut(|a, b| week(a) == week(b)) {
            let deviation = self.at(of_week[0].departure_us);
            of_week.iter_mut().for_each(|v| v.value -= deviation);
        }
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

fn week(value: &QuantityValue) -> i64 {
    value.departure_us.div_euclid(WEEK_US)
}

/// Level of each unit: the median of its cells less the deviations of their weeks.
fn levels(cells: &[Cell], units: usize) -> Vec<f64> {
    let mut of_unit = vec![Vec::new(); units];
    for cell in cells {
        of_unit[cell.unit].push(cell.mean - cell.deviation);
    }
    of_unit.into_iter().map(|values| median(values).unwrap_or_default()).collect()
}

/// Deviation of a week: the median over its tails of the difference between the tail's cells and the levels of their
/// units. The cells keep it for the next sweep. None for a week in which too few tails flew.
fn deviation(of_week: &mut [Cell], levels: &[f64]) -> Option<Deviation> {
    let of_tail = |cells: &[Cell]| {
        let sum = cells.iter().fold(0.0, |sum, cell| sum + cell.mean - levels[cell.unit]);
        sum / cells.len() as f64
    };
    let tails: Vec<f64> = of_week.chunk_by(|a, b| a.tail == b.tail).map(of_tail).collect();
    if tails.len() < MIN_TAILS {
        return None;
    }
    let value = median(tails.clone())?;
    let spread = SD_OVER_MAD * median(tails.iter().map(|v| (v - value).abs()).collect())?;
    of_week.iter_mut().for_each(|cell| cell.deviation = value);
    let variance = (MEDIAN_SE * spread).powi(2) / tails.len() as f64;
    Some(Deviation { week: of_week[0].week, value, variance })
}
