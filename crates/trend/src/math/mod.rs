//! Distributions, medians and weighted quantiles.

pub(crate) mod distributions;
pub(crate) mod median;
pub(crate) mod weighted;
