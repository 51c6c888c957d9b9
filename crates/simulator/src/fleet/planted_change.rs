//! Changes that come over the flights of a fleet: to a unit, to the sensors of a tail, to all units of a part.

use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;

use crate::load::flight_profile::Profile;
use crate::load::vibration::Vibration;
use crate::plant::actuator_plant::Plant;
use crate::sensors::sensor::Sensors;

/// A change of the actuators that meet all of its conditions; a condition that is left out holds for all.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, SmartDefault)]
#[serde(deny_unknown_fields, default)]
pub struct PlantedChange {
    /// The aircraft.
    pub tail: Option<String>,
    /// The place.
    pub position: Option<String>,
    /// The design.
    pub part_number: Option<String>,
    /// The unit, wherever it is installed.
    pub serial_number: Option<String>,
    /// First flight of a tail that shows the change, counted from 1. Default 1.
    #[default(1)]
    pub from_flight: usize,
    /// Flight from which the whole change shows; in between it grows in proportion. Default `from_flight`: a step.
    pub to_flight: Option<usize>,
    /// Stiffness over that before. Default 1.
    #[default(1.0)]
    pub stiffness_factor: f64,
    /// Dry and load-dependent friction over that before. Default 1.
    #[default(1.0)]
    pub friction_factor: f64,
    /// Added to the gain error of the load cell. Default 0.
    pub load_gain: f64,
    /// Added to the zero error of the load cell, N. Default 0.
    pub load_bias_n: f64,
    /// Added to the delay of the screw channel, seconds. Default 0.
    pub skew_s: f64,
    /// Added to the delay of the load channel, seconds. Default 0.
    pub load_delay_s: f64,
    /// Vibration of the load in place of the profile's. Default the profile's.
    pub buffet: Option<Vibration>,
}

/// One actuator of one flight.
pub(crate) struct ActuatorFlight<'a> {
    pub(crate) tail: &'a str,
    pub(crate) position: &'a str,
    pub(crate) part_number: &'a str,
    pub(crate) serial_number: &'a str,
    /// Flight of the tail, counted from 1.
    pub(crate) number: usize,
}

impl PlantedChange {
    /// Applies the change as far as it has come in a flight.
    pub(crate) fn apply(
        &self,
        flight: &ActuatorFlight<'_>,
        plant: &mut Plant,
        profile: &mut Profile,
        sensors: &mut Sensors,
    ) {
        let share = self.share(flight);
        if share == 0.0 {
            return;
        }
        plant.contact.stiffness_n_per_m *= 1.0 + share * (self.stiffness_factor - 1.0);
        *plant = plant.with_friction_factor(1.0 + share * (self.friction_factor - 1.0));
        sensors.load.gain_error += share * self.load_gain;
        sensors.load.bias += share * self.load_bias_n;
        sensors.screw.delay_s += share * self.skew_s;
        sensors.load.delay_s += share * self.load_delay_s;
        if let Some(buffet) = &self.buffet {
            profile.buffet = buffet.clone();
        }
    }

    /// How much of the change a flight shows, 0 to 1.
    fn share(&self, flight: &ActuatorFlight<'_>) -> f64 {
        let conditions = [
            (&self.tail, flight.tail),
            (&self.position, flight.position),
            (&self.part_number, flight.part_number),
            (&self.serial_number, flight.serial_number),
        ];
        let is_meant = conditions.iter().all(|(wanted, is)| wanted.as_deref().is_none_or(|w| w == *is));
        if !is_meant || flight.number < self.from_flight {
            return 0.0;
        }
        let growing = self.to_flight.map_or(0, |to| to.saturating_sub(self.from_flight));
        let gone = flight.number - self.from_flight;
        if gone >= growing { 1.0 } else { (gone + 1) as f64 / (growing + 1) as f64 }
    }
}
