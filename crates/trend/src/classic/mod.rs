//! The classic statistics engineers know by name: reported, never used as an alarm.
//!
//! Where flights share a bias or a season these tests alarm falsely several times too often, and a
//! robust line misses the bend of every wear law but one; the statements of this crate come from
//! elsewhere. These are here because a reader will ask for them.

#![expect(clippy::float_cmp, reason = "a tie is exact equality by definition")]

mod line;
mod mann_kendall;
mod noise;
mod theil_sen;

pub use line::{Line, least_squares, weighted_least_squares};
pub use mann_kendall::{MannKendall, hamed_rao, mann_kendall, trend_free_pre_whitening};
pub use noise::dispersion;
pub use theil_sen::{TheilSen, theil_sen};

use crate::error::Error;

/// Refuses values that are not finite, or too few of them.
fn check(statistic: &'static str, needed: usize, values: &[f64]) -> Result<(), Error> {
    if values.len() < needed {
        return Err(Error::TooFew { statistic, needed, given: values.len() });
    }
    if values.iter().any(|v| !v.is_finite()) {
        return Err(Error::Values { statistic, hint: "not all of them are finite" });
    }
    Ok(())
}

/// Refuses two slices that do not belong together, and values as [`check`] does.
fn check_pairs(statistic: &'static str, needed: usize, left: &[f64], right: &[f64]) -> Result<(), Error> {
    if left.len() != right.len() {
        return Err(Error::Lengths { statistic, left: left.len(), right: right.len() });
    }
    check(statistic, needed, left)?;
    check(statistic, needed, right)
}

/// Median by selection, the mean of the middle two for an even count. Reorders the values, of which
/// there must be one at least.
pub(crate) fn median(values: &mut [f64]) -> f64 {
    let half = values.len() / 2;
    let even = values.len().is_multiple_of(2);
    let (below, &mut upper, _) = values.select_nth_unstable_by(half, f64::total_cmp);
    if even { below.iter().copied().fold(f64::NEG_INFINITY, f64::max).midpoint(upper) } else { upper }
}

/// Sizes of the groups of equal values.
fn tie_sizes(y: &[f64]) -> impl Iterator<Item = f64> {
    let mut sorted = y.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    sizes_of_equals(&sorted).collect::<Vec<f64>>().into_iter()
}

fn sizes_of_equals(sorted: &[f64]) -> impl Iterator<Item = f64> {
    sorted.chunk_by(|a, b| a == b).map(|group| group.len() as f64)
}
