//! Mann–Kendall test of a monotonic trend, also for autocorrelated values.

use super::{check, sizes_of_equals, theil_sen};
use crate::error::Error;
use crate::math::distributions::{quantile, two_sided};

/// A Mann–Kendall test.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MannKendall {
    /// Pairs that rise less pairs that fall.
    pub s: f64,
    /// Variance of S under no trend, ties corrected for.
    pub variance: f64,
    /// Standard score with continuity correction.
    pub z: f64,
    /// Two-sided p-value, free of cancellation also beyond |z| = 8.
    pub p_value: f64,
    /// S over the number of pairs.
    pub tau: f64,
}

/// Mann–Kendall test of values in order of time, in O(n log n).
///
/// S = Σ_{i<j} sign(y_j − y_i) and its variance with ties: Mann 1945 (<https://doi.org/10.2307/1907187>), Kendall
/// 1975, *Rank Correlation Methods*; S by counting inversions: Knight 1966. The result has no unit and does not depend
/// on that of `y`.
///
/// # Errors
/// [`Error::TooFew`] below two values, [`Error::Values`] for values that are not finite.
pub fn mann_kendall(y: &[f64]) -> Result<MannKendall, Error> {
    check("Mann-Kendall", 2, y)?;
    Ok(test(y, 1.0))
}

/// Mann–Kendall with the variance of an autocorrelated series: Hamed and Rao 1998
/// (<https://doi.org/10.1016/S0022-1694(97)00125-X>).
///
/// The ranks of the series, freed of its Sen slope by index, are autocorrelated at every lag; lags
/// significant at 5 % scale the variance. (The lags cost O(n²), as the slope does.)
///
/// # Errors
/// [`Error::TooFew`] below three values, [`Error::Values`] for values that are not finite.
pub fn hamed_rao(y: &[f64]) -> Result<MannKendall, Error> {
    check("Hamed-Rao", 3, y)?;
    let n = y.len() as f64;
    let ranks = mean_ranks(&detrended(y)?);
    let significant = quantile(0.975) / n.sqrt();
    let correlation = Correlation::new(&ranks);
    let sum: f64 = (1..y.len())
        .map(|lag| (lag as f64, correlation.at(lag)))
        .filter(|(_, r)| r.abs() > significant)
        .map(|(lag, r)| (n - lag) * (n - lag - 1.0) * (n - lag - 2.0) * r)
        .sum();
    Ok(test(y, 1.0 + 2.0 / (n * (n - 1.0) * (n - 2.0)) * sum))
}

/// The test, with its variance multiplied by `inflation`.
fn test(y: &[f64], inflation: f64) -> MannKendall {
    let n = y.len() as f64;
    let (mut sorted, mut spare) = (y.to_vec(), y.to_vec());
    let inversions = inversions(&mut sorted, &mut spare) as f64;
    let ties: Vec<f64> = sizes_of_equals(&sorted).collect();
    let tied: f64 = ties.iter().map(|k| 0.5 * k * (k - 1.0)).sum();
    // Pairs less ties less twice the inversions, which a merge sort counts (Knight 1966).
    let s = 0.5 * n * (n - 1.0) - tied - 2.0 * inversions;
    let term = |k: f64| k * (k - 1.0) * (2.0 * k + 5.0);
    let variance = inflation * (term(n) - ties.into_iter().map(term).sum::<f64>()) / 18.0;
    let z = if s == 0.0 { 0.0 } else { (s - s.signum()) / variance.sqrt() };
    MannKendall { s, variance, z, p_value: two_sided(z), tau: s / (0.5 * n * (n - 1.0)) }
}

/// Sorts the values and counts the pairs in strictly falling order.
fn inversions(values: &mut [f64], spare: &mut [f64]) -> u64 {
    let half = values.len() / 2;
    if half == 0 {
        return 0;
    }
    let (left, right) = values.split_at_mut(half);
    let mut count = inversions(left, &mut spare[..half]) + inversions(right, &mut spare[half..]);
    let (mut i, mut j) = (0, 0);
    // Which half goes on is chance: it is computed with, since a branch would be guessed wrong every other time.
    while i < left.len() && j < right.len() {
        let (of_left, of_right) = (left[i], right[j]);
        let falls = of_right < of_left;
        spare[i + j] = if falls { of_right } else { of_left };
        count += u64::from(falls) * (left.len() - i) as u64;
        i += usize::from(!falls);
        j += usize::from(falls);
    }
    spare[i + j..left.len() + j].copy_from_slice(&left[i..]);
    spare[left.len() + j..].copy_from_slice(&right[j..]);
    values.copy_from_slice(spare);
    count
}

/// The series less its Sen slope by index counted from one.
fn detrended(y: &[f64]) -> Result<Vec<f64>, Error> {
    let index: Vec<f64> = (0..y.len()).map(|i| i as f64).collect();
    let slope = theil_sen(&index, y, 0.95)?.slope;
    Ok(y.iter().zip(&index).map(|(y, i)| y - (i + 1.0) * slope).collect())
}

/// Ranks from one, ties sharing their mean.
fn mean_ranks(y: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..y.len()).collect();
    order.sort_unstable_by(|&a, &b| y[a].total_cmp(&y[b]));
    let mut ranks = vec![0.0; y.len()];
    let mut first = 0;
    for group in order.chunk_by(|&a, &b| y[a] == y[b]) {
        let mean = first as f64 + (group.len() + 1) as f64 / 2.0;
        for &i in group {
            ranks[i] = mean;
        }
        first += group.len();
    }
    ranks
}

/// Sample autocorrelation about the mean.
struct Correlation {
    centred: Vec<f64>,
    power: f64,
}

impl Correlation {
    fn new(y: &[f64]) -> Self {
        let mean = y.iter().sum::<f64>() / y.len() as f64;
        let centred: Vec<f64> = y.iter().map(|v| v - mean).collect();
        let power = centred.iter().map(|v| v * v).sum();
        Self { centred, power }
    }

    /// At a lag; zero for a constant series, which has none.
    fn at(&self, lag: usize) -> f64 {
        if self.power == 0.0 {
            return 0.0;
        }
        self.centred.iter().zip(&self.centred[lag..]).map(|(a, b)| a * b).sum::<f64>() / self.power
    }
}
