//! How far the scatter of a series is from what its standard errors claim.

use super::{check_pairs, median};
use crate::error::Error;

/// Consistency of the median absolute deviation with a normal standard deviation.
const MAD_TO_SIGMA: f64 = 1.4826;

/// Variance factor of a series against its stated standard errors, from successive differences.
///
/// ```text
/// (1.4826 · median |y(k+1) − y(k)| / √(se(k)² + se(k+1)²))²
/// ```
/// One on honest errors, 2.25 when they are stated 1.5 times too small. Wear and outliers hardly enter.
///
/// # Errors
/// [`Error::TooFew`] below two values, [`Error::Lengths`], [`Error::Values`] for values that are not
/// finite or standard errors that are not positive.
pub fn dispersion(y: &[f64], se: &[f64]) -> Result<f64, Error> {
    check_pairs("dispersion", 2, y, se)?;
    if se.iter().any(|s| *s <= 0.0) {
        return Err(Error::Values { statistic: "dispersion", hint: "a standard error is not positive" });
    }
    let mut ratios: Vec<f64> =
        y.windows(2).zip(se.windows(2)).map(|(y, se)| (y[1] - y[0]).abs() / se[0].hypot(se[1])).collect();
    Ok((MAD_TO_SIGMA * median(&mut ratios)).powi(2))
}
