//! A fleet's calendar with its truth, and each of its flights on demand.
//!
//! The plan is cheap and made whole; a flight is dear and made alone, from streams named after seed,
//! tail, flight and position. So flights may be flown in any order and on any thread, to the same bits.

use std::f64::consts::{PI, TAU};

use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::calendar::{DAY_US, HOUR_US, midnight_us};
use crate::error::Error;
use crate::flight::{Expected, simulate};
use crate::plant::Plant;
use crate::profile::Profile;
use crate::random::{derived, stream};
use crate::roster::{self, Seats};
use crate::sensor::Sensors;
use crate::spec::{MotorLog, Part, Spec};
use crate::wear;

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
    seed: u64,
    assignments: Vec<Assignment>,
}

/// Everything needed to fly one actuator.
#[derive(Debug, Clone, PartialEq)]
struct Assignment {
    plant: Plant,
    profile: Profile,
    sensors: Sensors,
    part: usize,
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
    /// Any variant but [`Error::NoSuchFlight`]: the first complaint about the spec.
    pub fn new(spec: &Spec) -> Result<Self, Error> {
        spec.check()?;
        let mut planner = Planner::new(spec)?;
        for number in 1..=spec.flights_per_tail {
            planner.swap(number)?;
            for tail in 0..spec.tails.len() {
                planner.plan_flight(number, tail);
            }
        }
        Ok(planner.finish())
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

/// A calendar in the making.
struct Planner<'a> {
    spec: &'a Spec,
    start_us: i64,
    seats: Seats,
    units: Vec<roster::Unit>,
    wear: Vec<ChaCha8Rng>,
    tail_hours: Vec<f64>,
    installations: Vec<Installation>,
    flights: Vec<PlannedFlight>,
}

impl<'a> Planner<'a> {
    fn new(spec: &'a Spec) -> Result<Self, Error> {
        let units = roster::units(spec)?;
        let wear = units.iter().map(|unit| stream(spec.seed, &["wear", &unit.serial_number])).collect();
        let mut planner = Self {
            spec,
            start_us: midnight_us(&spec.start_date)?,
            seats: Seats::new(spec),
            units,
            wear,
            tail_hours: (0..spec.tails.len()).map(|k| spec.tail_hours * (1.0 + 0.1 * k as f64)).collect(),
            installations: Vec::new(),
            flights: Vec::new(),
        };
        for tail in 0..spec.tails.len() {
            (0..spec.positions.len()).for_each(|position| planner.install(tail, position, planner.start_us));
        }
        Ok(planner)
    }

    /// A flight's slot opens at this instant; swaps happen here, while every aircraft is on the ground.
    fn slot_us(&self, number: usize) -> i64 {
        self.start_us + ((number - 1) as f64 * self.slot_days() * DAY_US) as i64
    }

    /// Slots of a day or more are whole days, so that each begins at midnight.
    fn slot_days(&self) -> f64 {
        let days = self.spec.days_between_flights;
        if days >= 1.0 { days.floor() } else { days }
    }

    fn swap(&mut self, number: usize) -> Result<(), Error> {
        let at_us = self.slot_us(number);
        for (tail, position) in self.seats.swap(self.spec, &self.units, number)? {
            let (tail_number, place) = (&self.spec.tails[tail], &self.spec.positions[position].position);
            let stays = self.installations.iter_mut().rev();
            if let Some(stay) =
                stays.into_iter().find(|s| s.tail_number == *tail_number && s.position == *place)
            {
                stay.removed_us = Some(at_us);
            }
            self.install(tail, position, at_us);
        }
        Ok(())
    }

    fn install(&mut self, tail: usize, position: usize, installed_us: i64) {
        let unit = &self.units[self.seats.unit(tail, position)];
        self.installations.push(Installation {
            tail_number: self.spec.tails[tail].clone(),
            position: self.spec.positions[position].position.clone(),
            part_number: self.spec.parts[unit.part].part_number.clone(),
            serial_number: unit.serial_number.clone(),
            installed_us,
            removed_us: None,
            unit_hours_at_install: unit.age_hours,
            tail_hours_at_install: self.tail_hours[tail],
        });
    }

    fn plan_flight(&mut self, number: usize, tail: usize) {
        let spec = self.spec;
        let name = &spec.tails[tail];
        let flight_id = format!("{name}-{number:04}");
        let mut rng = stream(spec.seed, &["flight", &flight_id]);
        // Books keep hours to a hundredth.
        let spread = spec.flight_hours_spread * rng.random_range(-1.0..=1.0);
        let flight_hours = (spec.flight_hours * (1.0 + spread) * 100.0).round() / 100.0;
        let departure_us = self.slot_us(number) + self.departure_us(flight_hours, &mut rng);
        self.tail_hours[tail] += flight_hours;
        let seats = 0..spec.positions.len();
        let (actuators, assignments) =
            seats.map(|position| self.plan_actuator(tail, position, &flight_id, flight_hours)).unzip();
        self.flights.push(PlannedFlight {
            tail_number: name.clone(),
            seed: derived(spec.seed, &["log", &flight_id]),
            flight_id,
            departure_us,
            flight_hours,
            tail_hours_end: self.tail_hours[tail],
            actuators,
            assignments,
        });
    }

    /// Departure within the slot, to the second: between six and ten at night on any of its days, or
    /// anywhere the flight still fits.
    fn departure_us(&self, flight_hours: f64, rng: &mut ChaCha8Rng) -> i64 {
        let slot_hours = 24.0 * self.slot_days();
        let chance: f64 = rng.random();
        let hours = if slot_hours >= 24.0 {
            let day = rng.random_range(0..self.slot_days() as u32);
            24.0 * f64::from(day) + 6.0 + chance * (16.0 - flight_hours)
        } else {
            0.04 * slot_hours + chance * (0.92 * slot_hours - flight_hours)
        };
        ((hours * 3600.0) as i64) * (HOUR_US as i64 / 3600)
    }

    /// Wears the unit through the flight and says what flies.
    fn plan_actuator(
        &mut self,
        tail: usize,
        position: usize,
        flight_id: &str,
        flight_hours: f64,
    ) -> (ActuatorTruth, Assignment) {
        let index = self.seats.unit(tail, position);
        self.wear(index, flight_hours);
        let assignment = self.assignment(tail, position, flight_id);
        let unit = &self.units[index];
        let truth = ActuatorTruth {
            position: self.spec.positions[position].position.clone(),
            part_number: self.spec.parts[unit.part].part_number.clone(),
            serial_number: unit.serial_number.clone(),
            unit_hours: unit.age_hours,
            gap_m: unit.gap_m,
            stiffness_n_per_m: assignment.plant.contact.stiffness_n_per_m,
            skew_s: assignment.sensors.skew_s(),
            expected: if assignment.profile.no_reversal { Expected::Refuse } else { Expected::Estimate },
        };
        (truth, assignment)
    }

    fn wear(&mut self, index: usize, flight_hours: f64) {
        let unit = &mut self.units[index];
        let scatter_m = self.spec.parts[unit.part].wear_scatter_m;
        let before_m = unit.wear.growth_m(unit.age_hours);
        unit.age_hours += flight_hours;
        let growth_m = unit.wear.growth_m(unit.age_hours) - before_m;
        unit.gap_m += wear::step_m(growth_m, scatter_m, &mut self.wear[index]);
    }

    fn assignment(&self, tail: usize, position: usize, flight_id: &str) -> Assignment {
        let (spec, unit) = (self.spec, &self.units[self.seats.unit(tail, position)]);
        let (spread, place, tail) = (&spec.spread, &spec.positions[position], &spec.tails[tail]);
        let mut of_place = stream(spec.seed, &["place", tail, &place.position]);
        let mut of_stay = stream(spec.seed, &["stay", tail, &place.position, &unit.serial_number]);
        let mut of_flight = stream(spec.seed, &["actuator", flight_id, &place.position]);
        let mut sensors = spec.sensors;
        sensors.load.gain_error += spread.load_gain * normal(&mut of_place);
        sensors.screw.nonlinearity += spread.nonlinearity_m * normal(&mut of_place);
        sensors.screw.delay_s += spread.skew_s * normal(&mut of_flight);
        sensors.screw.drift += spread.drift_m * normal(&mut of_flight);
        let mut plant = spec.parts[unit.part].plant.with_gap_m(unit.gap_m);
        plant.contact.stiffness_n_per_m *= unit.stiffness_factor;
        plant.contact.offset_m = spread.offset_m * of_stay.random_range(-1.0..=1.0);
        plant = plant.with_friction_factor((spread.friction * normal(&mut of_flight)).exp());
        let mut profile = spec.profile;
        profile.load_n *= place.load_factor;
        profile.no_reversal |= place.no_reversal || of_flight.random_bool(spread.no_reversal_share);
        Assignment { plant, profile, sensors, part: unit.part }
    }

    fn finish(self) -> Plan {
        let mut installations = self.installations;
        let place = |name: &str| self.spec.positions.iter().position(|known| known.position == name);
        let tail = |name: &str| self.spec.tails.iter().position(|known| known == name);
        installations.sort_by_key(|s| (tail(&s.tail_number), place(&s.position), s.installed_us));
        Plan { parts: self.spec.parts.clone(), installations, flights: self.flights }
    }
}

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    let drawn: f64 = StandardNormal.sample(rng);
    drawn.clamp(-2.5, 2.5)
}
