//! The actuator: two masses at the screw, the coupling between them, friction on both, and the drive.
#![expect(missing_docs, reason = "docs/simulator.md explains each key")]

use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;

use crate::plant::backlash_contact::Contact;
use crate::plant::friction::{Friction, FrictionLaw};
use crate::plant::motor_controller::Drive;

/// One actuator. Defaults are a mid-sized aileron actuator of about 10 kN.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, SmartDefault)]
#[serde(deny_unknown_fields, default)]
pub struct Plant {
    #[default(80.0)]
    pub motor_mass_kg: f64,
    #[default(8.0)]
    pub screw_mass_kg: f64,
    pub contact: Contact,
    #[default(Friction::new(250.0, 0.04, 3000.0))]
    pub motor_friction: Friction,
    #[default(Friction::new(150.0, 0.03, 1000.0))]
    pub screw_friction: Friction,
    pub friction_law: FrictionLaw,
    pub drive: Drive,
}

impl Plant {
    /// The same actuator with another gap.
    #[must_use]
    pub fn with_gap_m(mut self, gap_m: f64) -> Self {
        self.contact.gap_m = gap_m;
        self
    }

    /// The same actuator with dry and load-dependent friction of both masses times a factor.
    #[must_use]
    pub fn with_friction_factor(mut self, factor: f64) -> Self {
        self.motor_friction = self.motor_friction.scaled(factor);
        self.screw_friction = self.screw_friction.scaled(factor);
        self
    }

    pub(crate) fn is_varying(&self) -> bool {
        self.contact.is_varying() || self.motor_friction.is_warming() || self.screw_friction.is_warming()
    }

    pub(crate) fn at(&self, time_s: f64, duration_s: f64) -> Self {
        Self {
            contact: self.contact.at(time_s / duration_s),
            motor_friction: self.motor_friction.at(time_s),
            screw_friction: self.screw_friction.at(time_s),
            ..*self
        }
    }
}
