//! The fleet prior and its parameters.

pub(crate) mod fleet_prior;
pub(crate) mod season_params;
