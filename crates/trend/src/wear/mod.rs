//! Wear laws and the bank of candidate curves made of them.

pub(crate) mod bank;
pub(crate) mod life_curve;
