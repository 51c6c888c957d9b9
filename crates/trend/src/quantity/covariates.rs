//! What temperature and load level explain of a quantity: slopes that all units of a part share.
//!
//! The slopes are fitted to differences of successive flights, which steps, drift and season hardly enter.

use nalgebra::{Matrix2, Vector2};

use super::QuantityValue;
use crate::math::{SD_OVER_MAD, median};

/// Standard errors from which a slope is applied.
const SIGNIFICANT: f64 = 4.0;
/// Fewest differences from which slopes are fitted.
const MIN_DIFFERENCES: usize = 30;
/// Huber's bound, in standard deviations: 95 % efficient for normal errors (Huber 1981).
const HUBER: f64 = 1.345;
/// Number of reweightings.
const ITERATIONS: usize = 8;

/// Slopes of a quantity.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Slopes {
    /// Change per °C.
    pub per_celsius: f64,
    /// Change per e-fold of the load.
    pub per_ln_load: f64,
    /// Middle of the temperatures, °C.
    pub temperature_c: f64,
    /// Middle of the logarithms of the load.
    pub ln_load: f64,
}

impl Slopes {
    /// Fits the slopes to the values of all units of a part, each in order of departure. A slope that is not
    /// significant is zero.
    pub fn fit<'a>(units: impl Iterator<Item = &'a [QuantityValue]> + Clone) -> Self {
        let all = || units.clone().flatten();
        let temperature_c = median(all().filter_map(|v| v.temperature_c).collect()).unwrap_or_default();
        let ln_load = median(all().filter_map(|v| v.ln_load).collect()).unwrap_or_default();
        let slopes = Self { temperature_c, ln_load, ..Self::default() };
        let differences: Vec<(f64, Vector2<f64>)> = units.flat_map(differences).collect();
        let Some((beta, covariance)) = huber(&differences) else { return slopes };
        let significant = |k: usize| {
            if beta[k].abs() > SIGNIFICANT * covariance[(k, k)].sqrt() { beta[k] } else { 0.0 }
        };
        Self { per_celsius: significant(0), per_ln_load: significant(1), ..slopes }
    }

    /// The value at the middle temperature and load.
    pub fn adjusted(&self, value: &QuantityValue) -> f64 {
        let by_temperature = value.temperature_c.map_or(0.0, |t| self.per_celsius * (t - self.temperature_c));
        let by_load = value.ln_load.map_or(0.0, |l| self.per_ln_load * (l - self.ln_load));
        value.value - by_temperature - by_load
    }
}

/// Differences of successive values, and of their covariates; of a covariate that is not known, zero.
fn differences(values: &[QuantityValue]) -> impl Iterator<Item = (f64, Vector2<f64>)> {
    values.array_windows().map(|[a, b]| {
        let of = |a: Option<f64>, b: Option<f64>| a.zip(b).map_or(0.0, |(a, b)| b - a);
        (b.value - a.value, Vector2::new(of(a.temperature_c, b.temperature_c), of(a.ln_load, b.ln_load)))
    })
}

/// Robust regression through the origin by reweighted least squares; a covariate that never varies has slope zero.
fn huber(rows: &[(f64, Vector2<f64>)]) -> Option<(Vector2<f64>, Matrix2<f64>)> {
    if rows.len() < MIN_DIFFERENCES || rows.iter().all(|(_, x)| *x == Vector2::zeros()) {
        return None;
    }
    let mut beta = Vector2::zeros();
    let mut covariance = Matrix2::zeros();
    for _ in 0..ITERATIONS {
        let residual = |(y, x): &(f64, Vector2<f64>)| y - x.dot(&beta);
        let scale = SD_OVER_MAD * median(rows.iter().map(|row| residual(row).abs()).collect())?;
        if scale.is_nan() || scale <= 0.0 {
            return None;
        }
        let (mut normal, mut right) = (Matrix2::zeros(), Vector2::zeros());
        for row in rows {
            let weight = (HUBER * scale / residual(row).abs()).min(1.0);
            normal += weight * row.1 * row.1.transpose();
            right += weight * row.0 * row.1;
        }
        for k in 0..2 {
            if normal[(k, k)] <= 0.0 {
                normal[(k, k)] = 1.0;
            }
        }
        let inverse = normal.cholesky()?.inverse();
        beta = inverse * right;
        // Doubled: neighbouring differences share a flight's error.
        covariance = 2.0 * scale * scale * inverse;
    }
    Some((beta, covariance))
}
