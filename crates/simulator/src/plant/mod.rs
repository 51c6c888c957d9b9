//! The actuator: masses, coupling, friction and the motor's controller.

pub(crate) mod actuator_plant;
pub(crate) mod backlash_contact;
pub(crate) mod friction;
pub(crate) mod motor_controller;
#[cfg(test)]
mod physics;
pub(crate) mod two_mass;
