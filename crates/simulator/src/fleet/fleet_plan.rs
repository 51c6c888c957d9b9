//! A fleet's calendar with its truth, and the log of each flight on demand.
//!
//! A plan is cheap and made at once; a flight is costly and made alone, from random streams named
//! after seed, tail, flight and position. Flights can be simulated in any order and on any thread, with
//! bitwise identical results.
#![expect(missing_docs, reason = "each field is named for what it holds, with its unit")]

use std::f64::consts::{PI, TAU};

use crate::error::Error;
use crate::fleet::fleet_events::FaultKind;
use crate::fleet::fleet_spec::{MotorLogFormat, Part, ScrewLogUnit};
use crate::flight::simulate;
use crate::load::flight_profile::Profile;
use crate::plant::actuator_plant::Plant;
use crate::seeded_streams::derive_seed;
use crate::sensors::sensor::Sensors;

/// One stay of one unit in one place.
#[derive(Debug, Clone, PartialEq)]
pub struct Installation {
    pub tail_number: String,
    pub position: String,
    pub part_number: String,
    pub serial_number: String,
    /// First instant of the stay, microseconds since 1970 UTC.
    pub installed_us: i64,
    /// First instant after it; none while the unit still sits there.
    pub removed_us: Option<i64>,
    /// The unit's age when it was installed, hours.
    pub unit_hours_at_install: f64,
    /// The tail's meter when it was installed, hours.
    pub tail_hours_at_install: f64,
}

/// A row of the maintenance table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Maintenance {
    pub part_number: String,
    pub serial_number: String,
    pub at_us: i64,
}

/// Play measured in the hangar.
#[derive(Debug, Clone, PartialEq)]
pub struct Inspection {
    pub part_number: String,
    pub serial_number: String,
    pub at_us: i64,
    pub play_m: f64,
    pub instrument: String,
    pub force_n: f64,
}

/// One actuator in one flight: its unit, and everything needed to simulate it.
#[derive(Debug, Clone, PartialEq)]
pub struct PlannedActuator {
    pub position: String,
    /// Index of the design in the plan's parts.
    pub part: usize,
    pub serial_number: String,
    /// The unit's age after the flight, hours.
    pub unit_hours: f64,
    /// The actuator, with the gap that the wear of this flight leaves.
    pub plant: Plant,
    pub profile: Profile,
    pub sensors: Sensors,
}

/// One flight of the calendar.
#[derive(Debug, Clone, PartialEq)]
pub struct PlannedFlight {
    pub tail_number: String,
    /// The operator's name for the flight, unique in the fleet.
    pub flight_id: String,
    /// Departure, microseconds since 1970 UTC; the log begins here.
    pub departure_us: i64,
    /// Length of the flight, hours; the log shows a part of it.
    pub flight_hours: f64,
    /// The tail's meter after the flight, hours.
    pub tail_hours_end: f64,
    pub has_log: bool,
    pub log_fault: Option<FaultKind>,
    /// The actuators, in the spec's order of positions.
    pub actuators: Vec<PlannedActuator>,
    pub(crate) seed: u64,
}

/// The unit of a logged channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ChannelUnit {
    Metre,
    Micrometre,
    Radian,
    Newton,
    NewtonMetre,
}

/// What was recorded of one actuator; NaN where a sample is missing.
#[derive(Debug, Clone, PartialEq)]
pub struct ActuatorLog {
    pub position: String,
    pub motor: Vec<f64>,
    /// Metres at the screw or radians of the resolver.
    pub motor_unit: ChannelUnit,
    pub screw: Vec<f64>,
    /// Metres or micrometres, or radians of a rotary output.
    pub screw_unit: ChannelUnit,
    pub load: Vec<f64>,
    /// Newtons, or newton metres of a rotary output.
    pub load_unit: ChannelUnit,
}

/// The log of one flight.
#[derive(Debug, Clone, PartialEq)]
pub struct SimulatedFlight {
    /// The stamps, seconds from departure; even unless the clock is not.
    pub time_s: Vec<f64>,
    /// The actuators, in the spec's order of positions.
    pub actuators: Vec<ActuatorLog>,
}

/// Installations, flights and truth of a whole fleet.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Plan {
    /// The designs, with their limits and nominal mechanics.
    pub parts: Vec<Part>,
    pub installations: Vec<Installation>,
    pub maintenance: Vec<Maintenance>,
    pub inspections: Vec<Inspection>,
    /// Every flight, by flight number, then tail.
    pub flights: Vec<PlannedFlight>,
}

impl Plan {
    /// Simulates one flight of the plan; the result does not depend on the order of calls.
    ///
    /// # Errors
    /// [`Error::Value`] for a parameter that a change of the flight moves out of its range.
    pub fn simulate_flight(&self, flight: &PlannedFlight) -> Result<SimulatedFlight, Error> {
        let record = |actuator| self.record(flight.seed, actuator);
        let actuators = flight.actuators.iter().map(record).collect::<Result<_, _>>()?;
        let PlannedActuator { profile, sensors, .. } = &flight.actuators[0];
        let time_s = sensors.clock.stamps(profile.samples(), profile.sample_rate_hz, flight.seed);
        Ok(SimulatedFlight { time_s, actuators })
    }

    fn record(&self, flight_seed: u64, actuator: &PlannedActuator) -> Result<ActuatorLog, Error> {
        let PlannedActuator { position, plant, profile, sensors, .. } = actuator;
        let log = simulate(plant, profile, sensors, derive_seed(flight_seed, &[position]))?;
        let part = &self.parts[actuator.part];
        let (motor, motor_unit) = motor_as_logged(log.motor_m, part);
        let (mut screw, mut load) = (log.screw_m, log.load_n);
        let (screw_unit, load_unit) = match (part.reference_radius_m, part.screw_log) {
            (Some(radius_m), _) => {
                screw.iter_mut().for_each(|x| *x /= radius_m);
                load.iter_mut().for_each(|f| *f *= radius_m);
                (ChannelUnit::Radian, ChannelUnit::NewtonMetre)
            }
            (None, ScrewLogUnit::Millimetre) => (ChannelUnit::Metre, ChannelUnit::Newton),
            (None, ScrewLogUnit::Micrometre) => {
                screw.iter_mut().for_each(|x| *x *= 1e6);
                (ChannelUnit::Micrometre, ChannelUnit::Newton)
            }
        };
        Ok(ActuatorLog { position: position.clone(), motor, motor_unit, screw, screw_unit, load, load_unit })
    }
}

fn motor_as_logged(mut motor: Vec<f64>, part: &Part) -> (Vec<f64>, ChannelUnit) {
    if part.motor_log == MotorLogFormat::Position {
        return (motor, ChannelUnit::Metre);
    }
    motor.iter_mut().for_each(|x| *x *= TAU / part.lead_m);
    if part.motor_log == MotorLogFormat::WrappedAngle {
        motor.iter_mut().for_each(|angle| *angle = (*angle + PI).rem_euclid(TAU) - PI);
    }
    (motor, ChannelUnit::Radian)
}
