//! Bayesian inference over one segment: a Kalman filter, the candidate bank, the posterior mixture.

pub(crate) mod consistency;
pub(crate) mod level_filter;
pub(crate) mod posterior;
pub(crate) mod season;
pub(crate) mod segment_fit;
