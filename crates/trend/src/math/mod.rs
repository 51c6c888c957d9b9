//! Distributions, quadrature rules, weighted quantiles and a hash.

pub(crate) mod distributions;
pub(crate) mod fnv;
pub(crate) mod quadrature;
pub(crate) mod weighted;
