//! The fleet prior and its parameters.

pub(crate) mod calibration_params;
pub(crate) mod fleet_prior;
pub(crate) mod season_params;
