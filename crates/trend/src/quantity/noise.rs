//! Scatter of a quantity from flight to flight, as steps and drift leave it alone.

use super::QuantityValue;
pub(super) use crate::math::median::SD_OVER_MAD;

/// Flights of a batch whose means show a scatter that neighbours share.
const BATCH: usize = 8;
/// Variance inflation assumed before a batch is seen, and the number of batches it counts for.
const USUAL_INFLATION: (f64, f64) = (2.5, 5.0);
/// Largest variance inflation: beyond it, what neighbours share is a change, not scatter.
const MAX_INFLATION: f64 = 8.0;
/// Neighbours on each side by which an outlier is judged, and how many of them must agree with it.
const NEIGHBOURS: usize = 3;
const AGREEING: usize = 2;
/// Two values agree when they differ by at most this many standard deviations.
const OUTLIER_SDS: f64 = 4.0;

/// Scatter of a quantity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scatter {
    /// Standard deviation between flights beyond the stated standard errors, in the quantity's unit.
    pub between_flights: f64,
    /// Factor of the variance of a mean of many flights, because neighbouring flights share errors; at least 1.
    pub inflation: f64,
}

impl Scatter {
    /// Scatter of successive values (von Neumann 1941, with medians), which neither a step nor a drift enters.
    ///
    /// `least` is the smallest scatter to assume.
    pub fn of(values: &[QuantityValue], least: f64) -> Self {
        let differences: Vec<f64> = values.array_windows().map(|[a, b]| (b.value - a.value).abs()).collect();
        let total = SD_OVER_MAD * median(differences).unwrap_or(0.0) / std::f64::consts::SQRT_2;
        let stated = median(values.iter().map(|v| v.se * v.se).collect()).unwrap_or(0.0);
        let between_flights = (total * total - stated).max(0.0).sqrt().max(least);
        let scatter = Self { between_flights, inflation: 1.0 };
        Self { inflation: scatter.inflation_of(values), ..scatter }
    }

    /// Variance of one flight's value.
    pub fn variance(&self, value: &QuantityValue) -> f64 {
        self.between_flights.powi(2) + value.se * value.se
    }

    /// Variance of batch means over what independent flights would give: successive batches are compared, so that a
    /// drift counts little.
    fn inflation_of(&self, values: &[QuantityValue]) -> f64 {
        let means: Vec<(f64, f64)> = values
            .chunks_exact(BATCH)
            .map(|batch| {
                let weight: f64 = batch.iter().map(|v| self.variance(v).recip()).sum();
                let sum: f64 = batch.iter().map(|v| v.value / self.variance(v)).sum();
                (sum / weight, weight.recip())
            })
            .collect();
        let normal: Vec<f64> =
            means.array_windows().map(|[a, b]| (b.0 - a.0).abs() / (a.1 + b.1).sqrt()).collect();
        let (usual, weight) = USUAL_INFLATION;
        let seen = normal.len() as f64;
        let sd = SD_OVER_MAD * median(normal).unwrap_or(0.0);
        ((seen * sd * sd + weight * usual) / (seen + weight)).clamp(1.0, MAX_INFLATION)
    }
}

/// The values that are no outliers: those that agree with at least two of their nearest neighbours.
///
/// The flights after a step agree with each other from the third on.
pub fn without_outliers(values: &[QuantityValue], scatter: &Scatter) -> Vec<QuantityValue> {
    let agrees = |a: &QuantityValue, b: &QuantityValue| {
        let variance = scatter.variance(a) + scatter.variance(b);
        (a.value - b.value).abs() <= OUTLIER_SDS * (scatter.inflation * variance).sqrt()
    };
    let is_sound = |k: usize| {
        let near = k.saturating_sub(NEIGHBOURS)..(k + 1 + NEIGHBOURS).min(values.len());
        near.filter(|&other| other != k && agrees(&values[k], &values[other])).count() >= AGREEING
    };
    (0..values.len()).filter(|&k| values.len() <= AGREEING || is_sound(k)).map(|k| values[k]).collect()
}

/// The median; none of nothing.
pub fn median(mut values: Vec<f64>) -> Option<f64> {
    crate::math::median::median(&mut values)
}
