//! Distributions, quadrature rules and weighted quantiles.

pub(crate) mod distributions;
pub(crate) mod median;
pub(crate) mod quadrature;
pub(crate) mod weighted;
