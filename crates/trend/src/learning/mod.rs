//! Empirical-Bayes learning of the fleet prior and calibration of its forecasts.

pub(crate) mod calibrate;
pub(crate) mod learn;
