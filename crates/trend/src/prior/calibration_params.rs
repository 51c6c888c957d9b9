//! Calibrated widths of the forecasts of a fleet.

/// Least factor by which forecast intervals are wider than the mixture's own.
///
/// The true law is seldom in the bank, so the evidence for one candidate against its neighbours is worth less than the
/// likelihood has it: uncorrected 90 % intervals covered 85 and 86 % on two simulated fleets. Tempered weights
/// (a power below one) would cover as well, but they move the median away from the truth.
pub(crate) const USUAL_WIDTH: f64 = 1.25;

/// Quantiles (5 %, 50 %, 95 %) of the fleet's past growth, in widths of the forecast.
///
/// A width is the distance from the median to the 95 % bound above it, and to the 5 % bound below it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct CalibrationParams {
    pub(crate) low: f64,
    pub(crate) middle: f64,
    pub(crate) high: f64,
    /// Past forecasts that they were learned from.
    pub(crate) scored: usize,
}

impl CalibrationParams {
    /// Parameters of a fleet without past forecasts.
    pub(crate) const USUAL: Self = Self { low: -USUAL_WIDTH, middle: 0.0, high: USUAL_WIDTH, scored: 0 };
}
