//! The making of a plan, and of each of its flights on demand.
//!
//! A plan is cheap and made at once; a flight is costly and made alone, from random streams named
//! after seed, tail, flight and position. Flights can be simulated in any order and on any thread, with
//! bitwise identical results.

use std::f64::consts::{PI, TAU};

use crate::error::Error;
use crate::fleet::fleet_plan_types::{
    ActuatorLog, ChannelUnit, Plan, PlannedActuator, PlannedFlight, SimulatedFlight,
};
use crate::fleet::fleet_planner::Planner;
use crate::fleet::fleet_spec::{MotorLogFormat, Part, ScrewLogUnit, Spec};
use crate::flight::simulate;
use crate::seeded_streams::derive_seed;

impl Plan {
    /// Lays out the calendar of a fleet and the truth of each of its actuators.
    ///
    /// # Errors
    /// The first fault of the spec.
    pub fn new(spec: &Spec) -> Result<Self, Error> {
        spec.check()?;
        Planner::new(spec)?.plan()
    }

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
