//! What a flight asks of an actuator: commands, loads and vibration.

pub(crate) mod flight_profile;
pub(crate) mod turbulence;
pub(crate) mod vibration;

pub(crate) mod flight_commands;
mod shaping_filter;
