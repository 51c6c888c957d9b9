//! Yearly seasonal component of the measurement: one phase per fleet, one amplitude per unit.

use std::f64::consts::TAU;

use crate::data::series::DAY_US;

/// A tropical year, microseconds.
pub(crate) const YEAR_US: f64 = 365.242_2 * DAY_US as f64;

/// Spread of the amplitude from unit to unit while no fleet is known, a share of the limit.
pub(crate) const PSEUDO_SD: f64 = 0.003;

/// Seasonal component of a part number's fleet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SeasonParams {
    pub(crate) phase: f64,
    /// Mean amplitude and its spread from unit to unit, metres.
    pub(crate) mean_m: f64,
    pub(crate) sd_m: f64,
}

impl SeasonParams {
    /// Parameters while no fleet is known: no mean amplitude.
    pub(crate) fn unknown(limit_m: f64) -> Self {
        Self { phase: 0.0, mean_m: 0.0, sd_m: PSEUDO_SD * limit_m }
    }

    /// The component of unit amplitude at a time.
    pub(crate) fn wave(&self, departure_us: f64) -> f64 {
        (TAU * departure_us / YEAR_US - self.phase).cos()
    }
}
