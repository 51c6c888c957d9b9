//! The Theil–Sen line: the median of all pairwise slopes, exactly, without keeping them.

use super::{check_pairs, median, tie_sizes};
use crate::error::Error;
use crate::math::distributions::quantile;

/// A Theil–Sen line with rank limits of its slope.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TheilSen {
    /// Median of the pairwise slopes.
    pub slope: f64,
    /// median(y) − slope · median(x) (Conover).
    pub intercept: f64,
    /// Lower limit of the slope.
    pub slope_low: f64,
    /// Upper limit of the slope.
    pub slope_high: f64,
}

/// Theil–Sen slope and its limits at `confidence` (0.95 for 95 %), in units of y per unit of x: Sen 1968
/// (<https://doi.org/10.1080/01621459.1968.10480934>), equation 2.6, with ties in x and in y corrected for.
///
/// ```
/// let hours = [0.0, 100.0, 200.0, 300.0, 400.0];
/// let gaps_m = [50e-6, 52e-6, 54e-6, 90e-6, 58e-6];
/// let line = trend::classic::theil_sen(&hours, &gaps_m, 0.95)?;
/// assert!((line.slope - 2e-8).abs() < 1e-12);
/// # Ok::<(), trend::Error>(())
/// ```
///
/// All pairs are compared, so time grows with n²; memory does not, since a bracket from a
/// subsample of pairs decides which slopes are kept. The result is exact either way.
///
/// # Errors
/// [`Error::TooFew`] below two points, [`Error::Lengths`], [`Error::Values`] for values that are not
/// finite or one x only.
pub fn theil_sen(x: &[f64], y: &[f64], confidence: f64) -> Result<TheilSen, Error> {
    check_pairs("Theil-Sen", 2, x, y)?;
    let pairs = Pairs::new(x, y);
    if pairs.count == 0 {
        return Err(Error::Values { statistic: "Theil-Sen", hint: "every x is the same" });
    }
    let half_width = -quantile((1.0 - confidence) / 2.0) * sen_variance(x, y).sqrt();
    let count = pairs.count as f64;
    let rank = |r: f64| r.clamp(0.0, count - 1.0) as usize;
    let high = rank(count.midpoint(half_width).round_ties_even());
    let low = rank(count.midpoint(-half_width).round_ties_even() - 1.0);
    let slope = 0.5 * (pairs.nth((pairs.count - 1) / 2) + pairs.nth(pairs.count / 2));
    Ok(TheilSen {
        slope,
        intercept: median(&mut y.to_vec()) - slope * median(&mut x.to_vec()),
        slope_low: pairs.nth(low),
        slope_high: pairs.nth(high),
    })
}

/// Variance of Kendall's S with both margins' ties.
fn sen_variance(x: &[f64], y: &[f64]) -> f64 {
    let term = |k: f64| k * (k - 1.0) * (2.0 * k + 5.0);
    let ties = |values: &[f64]| tie_sizes(values).map(term).sum::<f64>();
    (term(x.len() as f64) - ties(x) - ties(y)) / 18.0
}

/// All pairs of points with different x.
struct Pairs<'a> {
    x: &'a [f64],
    y: &'a [f64],
    count: usize,
}

impl<'a> Pairs<'a> {
    fn new(x: &'a [f64], y: &'a [f64]) -> Self {
        let mut pairs = Self { x, y, count: 0 };
        let mut count = 0;
        pairs.for_each(|_| count += 1);
        pairs.count = count;
        pairs
    }

    /// Visits every slope once.
    fn for_each(&self, mut visit: impl FnMut(f64)) {
        for (j, (xj, yj)) in self.x.iter().zip(self.y).enumerate() {
            for (xi, yi) in self.x[..j].iter().zip(&self.y[..j]) {
                if xi != xj {
                    visit((yj - yi) / (xj - xi));
                }
            }
        }
    }

    /// The slope of this rank, counted from zero.
    fn nth(&self, rank: usize) -> f64 {
        let (low, high) = self.bracket(rank);
        self.nth_within(rank, low, high)
    }

    /// Keeps only the slopes strictly inside the bracket; ties at its ends are counted, not kept, so
    /// rounded data cost no memory. A bracket that missed the rank is moved, never trusted.
    fn nth_within(&self, rank: usize, low: f64, high: f64) -> f64 {
        let (mut below, mut at_low, mut inside) = (0, 0, Vec::new());
        self.for_each(|slope| {
            if slope < low {
                below += 1;
            } else if slope == low {
                at_low += 1;
            } else if slope < high {
                inside.push(slope);
            }
        });
        match rank.checked_sub(below) {
            None => self.nth_within(rank, f64::NEG_INFINITY, low),
            Some(r) if r < at_low => low,
            Some(r) if r - at_low < inside.len() => {
                *inside.select_nth_unstable_by(r - at_low, f64::total_cmp).1
            }
            Some(_) => self.nth_within(rank, high, f64::INFINITY),
        }
    }

    /// Two slopes that almost surely enclose the rank, from about count^⅔ pairs (Floyd & Rivest 1975)
    /// drawn by a fixed multiplicative sequence: the same input, the same work.
    fn bracket(&self, rank: usize) -> (f64, f64) {
        let wanted = (self.count as f64).powf(2.0 / 3.0) as usize;
        let n = self.x.len() as u64;
        let mut state = 1_u64;
        let mut draw = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((u128::from(state) * u128::from(n)) >> 64) as usize
        };
        let mut sample: Vec<f64> = (0..wanted)
            .map(|_| (draw(), draw()))
            .filter(|&(i, j)| self.x[i] != self.x[j])
            .map(|(i, j)| (self.y[j] - self.y[i]) / (self.x[j] - self.x[i]))
            .collect();
        sample.sort_unstable_by(f64::total_cmp);
        let centre = rank as f64 / self.count as f64 * sample.len() as f64;
        let reach = 2.0 * (sample.len() as f64).sqrt();
        let at = |position: f64, beyond: f64| {
            if position < 0.0 { beyond } else { sample.get(position as usize).copied().unwrap_or(beyond) }
        };
        (at(centre - reach, f64::NEG_INFINITY), at(centre + reach, f64::INFINITY))
    }
}
