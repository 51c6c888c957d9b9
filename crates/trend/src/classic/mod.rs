//! Classic trend statistics: Theil–Sen slope and Mann–Kendall test. They are reported and raise no alarm.
//!
//! Where flights share a bias or a season, these tests reject the hypothesis of no trend several times too often, and
//! a line does not follow the bend of most wear laws. Assessments therefore do not use them.

#![expect(clippy::float_cmp, reason = "a tie is exact equality by definition")]

mod mann_kendall;
mod theil_sen;

pub use mann_kendall::{MannKendall, hamed_rao, mann_kendall};
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
