//! Fitted quantities other than the gap, followed flight by flight: stiffness, friction, delays, load zero.
//!
//! [`covariates`] removes the effect of temperature and load level, [`common_curve`] what all units of a part share, such
//! as the season, and [`changes`] fits steps and a drift to the rest.

pub mod changes;
pub mod common_curve;
pub mod covariates;

pub use crate::math::median;

/// Fewest flights from which a change is sought.
pub const MIN_FLIGHTS: usize = 8;

/// A quantity of one unit in one flight, in any unit of measurement.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct QuantityValue {
    /// Departure, µs since 1970 UTC.
    pub departure_us: i64,
    /// The unit's usage at departure, flight hours.
    pub usage_hours: f64,
    /// The value.
    pub value: f64,
    /// Its standard error; zero where none is stated.
    pub se: f64,
    /// Mean temperature of the flight, °C; NaN where it is not known.
    pub temperature_c: f64,
    /// Natural logarithm of the flight's 95 % load; NaN where it is not known.
    pub ln_load: f64,
}
