//! The fleet prior and how it is learned.

pub(crate) mod fleet_prior;
pub(crate) mod learn;
pub(crate) mod season_params;
