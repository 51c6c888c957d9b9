//! A fleet's calendar with its truth, and each of its flights on demand.
//!
//! The plan is cheap and made whole; a flight is dear and made alone, from streams named after seed,
//! tail, flight and position. So flights may be flown in any order and on any thread, to the same bits.

use std::f64::consts::{PI, TAU};

use crate::error::Error;
use crate::flight::{Expected, simulate};
use crate::planner::Planner;
use crate::plant::Plant;
use crate::profile::Profile;
use crate::random::derived;
use crate::sensor::Sensors;
use crate::spec::{MotorLog, Part, Spec};

/// One stay of one unit in one place.
#[derive(Debug, Clone, PartialEq)]
pub struct Installation {
    /// The aircraft.
    pub tail_number: String,
    /// The place on it.
    pub position: String,
    /// The design.
    pub part_number: String,
    /// The unit.
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

/// What is true of one actuator in one flight.
#[derive(Debug, Clone, PartialEq)]
pub struct ActuatorTruth {
    /// The place.
    pub position: String,
    /// The design.
    pub part_number: String,
    /// The unit.
    pub serial_number: String,
    /// The unit's age after the flight, hours.
    pub unit_hours: f64,
    /// The gap, with the wear of this flight, metres.
    pub gap_m: f64,
    /// Stiffness of a flank, N/m.
    pub stiffness_n_per_m: f64,
    /// τ in `screw_logged(t) = X_screw(t − τ)` against the motor channel, seconds.
    pub skew_s: f64,
    /// Whether the gap can be seen.
    pub expected: Expected,
}

/// One flight of the calendar.
#[derive(Debug, Clone, PartialEq)]
pub struct PlannedFlight {
    /// The aircraft.
    pub tail_number: String,
    /// The operator's name for the flight, unique in the fleet.
    pub flight_id: String,
    /// Departure, microseconds since 1970 UTC; the log begins here.
    pub departure_us: i64,
    /// Length of the flight, hours; the log shows a part of it.
    pub flight_hours: f64,
    /// The tail's meter after the flight, hours.
    pub tail_hours_end: f64,
    /// The truth of each actuator, in the spec's order of positions.
    pub actuators: Vec<ActuatorTruth>,
    pub(crate) seed: u64,
    pub(crate) assignments: Vec<Assignment>,
}

/// Everything needed to fly one actuator.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Assignment {
    pub(crate) plant: Plant,
    pub(crate) profile: Profile,
    pub(crate) sensors: Sensors,
    /// Index into the plan's parts.
    pub(crate) part: usize,
}

/// In which unit a channel is logged.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unit {
    /// m.
    Metre,
    /// rad.
    Radian,
    /// N.
    Newton,
    /// N·m.
    NewtonMetre,
}

/// What was recorded of one actuator; NaN where a sample is missing.
#[derive(Debug, Clone, PartialEq)]
pub struct ActuatorLog {
    /// The place.
    pub position: String,
    /// Motor position, in `motor_unit`.
    pub motor: Vec<f64>,
    /// Metres at the screw or radians of the resolver.
    pub motor_unit: Unit,
    /// Screw position, in `screw_unit`.
    pub screw: Vec<f64>,
    /// Metres, or radians of a rotary output.
    pub screw_unit: Unit,
    /// Load, in `load_unit`.
    pub load: Vec<f64>,
    /// Newtons, or newton metres of a rotary output.
    pub load_unit: Unit,
}

/// The log of one flight.
#[derive(Debug, Clone, PartialEq)]
pub struct SimulatedFlight {
    /// The declared step, seconds.
    pub step_s: f64,
    /// The stamps, seconds from departure; even unless the clock is not.
    pub time_s: Vec<f64>,
    /// The actuators, in the spec's order of positions.
    pub actuators: Vec<ActuatorLog>,
}

/// Installations, flights and truth of a whole fleet.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// The designs, with their limits and nominal mechanics.
    pub parts: Vec<Part>,
    /// Every stay, by tail, position and time.
    pub installations: Vec<Installation>,
    /// Every flight, by flight number, then tail.
    pub flights: Vec<PlannedFlight>,
}

impl Plan {
    /// Lays out the calendar of a fleet and the truth of each of its actuators.
    ///
    /// # Errors
    /// Any variant but [`Error::NoSuchFlight`]: the first diagnostic about the spec.
    pub fn new(spec: &Spec) -> Result<Self, Error> {
        spec.check()?;
        Planner::new(spec)?.plan()
    }

    /// Flies one flight, counted from 0; the same flight gives the same bits in any order.
    ///
    /// # Errors
    /// [`Error::NoSuchFlight`] beyond the end of the plan.
    pub fn fly(&self, flight_index: usize) -> Result<SimulatedFlight, Error> {
        let missing = Error::NoSuchFlight { index: flight_index, flights: self.flights.len() };
        let flight = self.flights.get(flight_index).ok_or(missing)?;
        let pairs = flight.actuators.iter().zip(&flight.assignments);
        let actuators =
            pairs.map(|(truth, task)| self.record(flight, truth, task)).collect::<Result<_, _>>()?;
        let first = &flight.assignments[0];
        let rate_hz = first.profile.sample_rate_hz;
        Ok(SimulatedFlight {
            step_s: 1.0 / rate_hz,
            time_s: first.sensors.stamps(first.profile.samples(), rate_hz, flight.seed),
            actuators,
        })
    }

    fn record(
        &self,
        flight: &PlannedFlight,
        truth: &ActuatorTruth,
        task: &Assignment,
    ) -> Result<ActuatorLog, Error> {
        let seed = derived(flight.seed, &[&truth.position]);
        let log = simulate(&task.plant, &task.profile, &task.sensors, seed)?;
        let part = &self.parts[task.part];
        let (motor, motor_unit) = motor_as_logged(log.motor_m, part);
        let position = truth.position.clone();
        let (mut screw, mut load) = (log.screw_m, log.load_n);
        let Some(radius_m) = part.reference_radius_m else {
            let (screw_unit, load_unit) = (Unit::Metre, Unit::Newton);
            return Ok(ActuatorLog { position, motor, motor_unit, screw, screw_unit, load, load_unit });
        };
        screw.iter_mut().for_each(|x| *x /= radius_m);
        load.iter_mut().for_each(|f| *f *= radius_m);
        let (screw_unit, load_unit) = (Unit::Radian, Unit::NewtonMetre);
        Ok(ActuatorLog { position, motor, motor_unit, screw, screw_unit, load, load_unit })
    }
}

fn motor_as_logged(mut motor: Vec<f64>, part: &Part) -> (Vec<f64>, Unit) {
    if part.motor_log == MotorLog::Position {
        return (motor, Unit::Metre);
    }
    motor.iter_mut().for_each(|x| *x *= TAU / part.lead_m);
    if part.motor_log == MotorLog::WrappedAngle {
        motor.iter_mut().for_each(|angle| *angle = (*angle + PI).rem_euclid(TAU) - PI);
    }
    (motor, Unit::Radian)
}
