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
        let differences = || units.clone().flat_map(differences);
        let is_varied = differences().any(|(_, covariates)| covariates != Vector2::zeros());
        let fitted = is_varied.then(|| huber(&differences().collect::<Vec<_>>())).flatten();
        let Some((beta, covariance)) = fitted else { return Self::default() };
        let [per_celsius, per_ln_load] = [0, 1]
            .map(|k| if beta[k].abs() > SIGNIFICANT * covariance[(k, k)].sqrt() { beta[k] } else { 0.0 });
        let middle = move |of: fn(&QuantityValue) -> f64| {
            let known = units.clone().flatten().map(of).filter(|number| !number.is_nan());
            median(known.collect()).unwrap_or_default()
        };
        let (temperature_c, ln_load) = (middle(|v| v.temperature_c), middle(|v| v.ln_load));
        Self { per_celsius, per_ln_load, temperature_c, ln_load }
    }

    /// The value at the middle temperature and load.
    pub fn adjusted(&self, value: &QuantityValue) -> f64 {
        let by_temperature = known(self.per_celsius * (value.temperature_c - self.temperature_c));
        value.value - by_temperature - known(self.per_ln_load * (value.ln_load - self.ln_load))
    }
}

/// Differences of successive values, and of their covariates; of a covariate that is not known, zero.
fn differences(values: &[QuantityValue]) -> impl Iterator<Item = (f64, Vector2<f64>)> {
    values.array_windows().map(|[a, b]| {
        let covariates = Vector2::new(known(b.temperature_c - a.temperature_c), known(b.ln_load - a.ln_load));
        (b.value - a.value, covariates)
    })
}

/// An effect of covariates; zero where one is not known.
fn known(effect: f64) -> f64 {
    if effect.is_nan() { 0.0 } else { effect }
}

/// Robust regression through the origin by reweighted least squares; a covariate that never varies has slope zero.
fn huber(rows: &[(f64, Vector2<f64>)]) -> Option<(Vector2<f64>, Matrix2<f64>)> {
    if rows.len() < MIN_DIFFERENCES {
        return None;
    }
    let (mut beta, mut covariance) = (Vector2::zeros(), Matrix2::zeros());
    for _ in 0..ITERATIONS {
        let residual = |(y, x): &(f64, Vector2<f64>)| y - x.dot(&beta);
        let spread = median(rows.iter().map(|row| residual(row).abs()).collect());
        let scale = spread.map(|middle| SD_OVER_MAD * middle).filter(|scale| *scale > 0.0)?;
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
