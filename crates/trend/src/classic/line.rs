//! Straight lines by ordinary and by weighted least squares.

use super::check_pairs;
use crate::error::Error;
use crate::math::distributions::student_two_sided;

/// A fitted line y = intercept + slope·x, in the units of y and y per x.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    /// Change of y per unit of x.
    pub slope: f64,
    /// Value at x = 0.
    pub intercept: f64,
    /// Standard error of the slope.
    pub slope_se: f64,
    /// Standard error of the intercept.
    pub intercept_se: f64,
    /// Weighted sum of squared residuals: χ² for stated weights, plain squares without.
    pub chi2: f64,
    /// Two-sided p-value of the slope: Student's t for ordinary, normal for weighted least squares.
    pub p_value: f64,
}

/// Ordinary least squares; the standard errors use the residual variance with n − 2 degrees of freedom.
///
/// # Errors
/// [`Error::TooFew`] below three points, [`Error::Lengths`], [`Error::Values`] for values that are not
/// finite or one x only.
pub fn least_squares(x: &[f64], y: &[f64]) -> Result<Line, Error> {
    check_pairs("least squares", 3, x, y)?;
    let mut line = fit(x, y, |_| 1.0)?;
    let dof = x.len() as f64 - 2.0;
    let scale = (line.chi2 / dof).sqrt();
    line.slope_se *= scale;
    line.intercept_se *= scale;
    line.p_value = student_two_sided(line.slope / line.slope_se, dof);
    Ok(line)
}

/// Weighted least squares with weights 1/se²; the standard errors are those of the inverse normal
/// matrix, not rescaled, hence as honest as the stated ones.
///
/// # Errors
/// As [`least_squares`]; also [`Error::Values`] for a standard error that is not positive.
pub fn weighted_least_squares(x: &[f64], y: &[f64], se: &[f64]) -> Result<Line, Error> {
    check_pairs("weighted least squares", 3, x, y)?;
    check_pairs("weighted least squares", 3, x, se)?;
    if se.iter().any(|s| *s <= 0.0) {
        return Err(Error::Values {
            statistic: "weighted least squares",
            hint: "a standard error is not positive",
        });
    }
    fit(x, y, |i| 1.0 / (se[i] * se[i]))
}

/// Centred normal equations: x̄ and ȳ are weighted means, which keeps the cancellation out.
fn fit(x: &[f64], y: &[f64], weight: impl Fn(usize) -> f64) -> Result<Line, Error> {
    let sum = |f: &dyn Fn(usize) -> f64| (0..x.len()).map(|i| weight(i) * f(i)).sum::<f64>();
    let total = sum(&|_| 1.0);
    let x_mean = sum(&|i| x[i]) / total;
    let y_mean = sum(&|i| y[i]) / total;
    let spread = sum(&|i| (x[i] - x_mean).powi(2));
    if spread <= 0.0 {
        return Err(Error::Values { statistic: "a line", hint: "every x is the same" });
    }
    let slope = sum(&|i| (x[i] - x_mean) * (y[i] - y_mean)) / spread;
    let slope_se = spread.recip().sqrt();
    Ok(Line {
        slope,
        intercept: y_mean - slope * x_mean,
        slope_se,
        intercept_se: (total.recip() + x_mean * x_mean / spread).sqrt(),
        chi2: sum(&|i| (y[i] - y_mean - slope * (x[i] - x_mean)).powi(2)),
        p_value: crate::math::distributions::two_sided(slope / slope_se),
    })
}
