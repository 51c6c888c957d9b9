//! Planning of a fleet: units, slots, departures, swaps, flight hours, wear, and the state of each actuator.

use std::collections::BTreeSet;

use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::error::Error;
use crate::fleet::fleet_events::{LogFault, PlantedChange, Replacement};
use crate::fleet::fleet_plan::{Inspection, Installation, Maintenance, Plan, PlannedActuator, PlannedFlight};
use crate::fleet::fleet_spec::{Position, Spec};
use crate::fleet::wear::{self, WearLaw};
use crate::seeded_streams::{derive_seed, seeded_rng};

const HOUR_US: f64 = 3.6e9;
const DAY_US: f64 = 24.0 * HOUR_US;

struct Planner<'a> {
    spec: &'a Spec,
    start_us: i64,
    /// The unit of each seat, an index into `units`.
    unit_at: Vec<usize>,
    units: Vec<FleetUnit>,
    tail_hours: Vec<f64>,
    plan: Plan,
}

impl Plan {
    /// Lays out the calendar of a fleet and the truth of each of its actuators.
    ///
    /// # Errors
    /// The first error of the specification.
    pub fn new(spec: &Spec) -> Result<Self, Error> {
        spec.check()?;
        Planner::new(spec)?.plan()
    }
}

impl<'a> Planner<'a> {
    /// A planner in which every position has its first unit and no flight is planned.
    fn new(spec: &'a Spec) -> Result<Self, Error> {
        let mut planner = Self {
            spec,
            start_us: spec.start_us()?,
            unit_at: (0..spec.tails.len() * spec.positions.len()).collect(),
            units: fleet_units(spec)?,
            tail_hours: (0..spec.tails.len()).map(|k| spec.tail_hours * (1.0 + 0.1 * k as f64)).collect(),
            plan: Plan { parts: spec.parts.clone(), ..Plan::default() },
        };
        (0..planner.unit_at.len()).for_each(|seat| planner.install(seat, planner.start_us));
        Ok(planner)
    }

    /// All flights, in order of their number: a unit may change tails between two of them.
    fn plan(mut self) -> Result<Plan, Error> {
        for number in 1..=self.spec.flights_per_tail {
            self.exchange(number)?;
            self.inspect(number);
            self.reshim(number);
            for tail in 0..self.spec.tails.len() {
                self.plan_flight(number, tail);
            }
        }
        let spec = self.spec;
        let place = |stay: &Installation| seat(spec, &stay.tail_number, &stay.position);
        self.plan.installations.sort_by_key(|stay| (place(stay), stay.installed_us));
        Ok(self.plan)
    }

    /// Begin of a flight's time slot. Swaps happen at this instant, while every aircraft is on the ground.
    fn slot_us(&self, number: usize) -> i64 {
        self.start_us + ((number - 1) as f64 * self.slot_days() * DAY_US) as i64
    }

    /// Length of a slot in days: whole days if a day or more, so that each slot begins at midnight.
    fn slot_days(&self) -> f64 {
        let days = self.spec.days_between_flights;
        if days >= 1.0 { days.floor() } else { days }
    }

    /// Carries out the swaps and replacements that are due before a flight, counted from 1.
    fn exchange(&mut self, number: usize) -> Result<(), Error> {
        let (spec, mut touched) = (self.spec, BTreeSet::new());
        for swap in spec.swaps.iter().filter(|swap| swap.before_flight == number) {
            let [a, b] = [&swap.from, &swap.to].map(|place| seat(spec, &place.tail, &place.position));
            let part = |seat: usize| &spec.parts[self.units[self.unit_at[seat]].part].part_number;
            if part(a) != part(b) {
                return Err(Error::Misfit { flight: number, from: part(a).clone(), to: part(b).clone() });
            }
            self.unit_at.swap(a, b);
            touched.extend([a, b]);
        }
        for (k, spare) in spec.replacements.iter().enumerate().filter(|(_, s)| s.before_flight == number) {
            let seat = seat(spec, &spare.tail, &spare.position);
            self.unit_at[seat] = self.unit_at.len() + k;
            touched.insert(seat);
        }
        let at_us = self.slot_us(number);
        for seat in touched {
            let (tail, position) = self.place(seat);
            let here =
                |stay: &&mut Installation| stay.tail_number == *tail && stay.position == position.position;
            if let Some(stay) = self.plan.installations.iter_mut().rev().find(here) {
                stay.removed_us = Some(at_us);
            }
            self.install(seat, at_us);
        }
        Ok(())
    }

    fn place(&self, seat: usize) -> (&'a String, &'a Position) {
        let positions = &self.spec.positions;
        (&self.spec.tails[seat / positions.len()], &positions[seat % positions.len()])
    }

    /// Reads the play of units before a flight, to the micrometre.
    fn inspect(&mut self, number: usize) {
        for check in self.spec.play_checks.iter().filter(|check| check.before_flight == number) {
            let unit = &self.units[self.unit_at[seat(self.spec, &check.tail, &check.position)]];
            self.plan.inspections.push(Inspection {
                part_number: self.spec.parts[unit.part].part_number.clone(),
                serial_number: unit.serial_number.clone(),
                at_us: self.slot_us(number),
                play_m: ((unit.gap_m + check.error_m) * 1e6).round() / 1e6,
                instrument: check.instrument.clone(),
                force_n: check.force_n,
            });
        }
    }

    /// Sets gaps before a flight, after the inspections.
    fn reshim(&mut self, number: usize) {
        let at_us = self.slot_us(number);
        for shim in self.spec.reshims.iter().filter(|shim| shim.before_flight == number) {
            let index = self.unit_at[seat(self.spec, &shim.tail, &shim.position)];
            let unit = &mut self.units[index];
            unit.gap_m = shim.gap_m;
            if shim.is_recorded {
                let part_number = self.spec.parts[unit.part].part_number.clone();
                let serial_number = unit.serial_number.clone();
                self.plan.maintenance.push(Maintenance { part_number, serial_number, at_us });
            }
        }
    }

    /// Number of a flight's log among those of its tail, from 1: one random flight of each `flights_per_log` has a log.
    fn log_number(&self, number: usize, tail: &str) -> Option<usize> {
        let (size, log) = (self.spec.flights_per_log, (number - 1) / self.spec.flights_per_log + 1);
        let size = size.min(self.spec.flights_per_tail - (log - 1) * size);
        let logged = seeded_rng(self.spec.seed, &["logged", tail, &log.to_string()]).random_range(0..size);
        ((number - 1) % self.spec.flights_per_log == logged).then_some(log)
    }

    fn install(&mut self, seat: usize, installed_us: i64) {
        let ((tail, position), unit) = (self.place(seat), &self.units[self.unit_at[seat]]);
        self.plan.installations.push(Installation {
            tail_number: tail.clone(),
            position: position.position.clone(),
            part_number: self.spec.parts[unit.part].part_number.clone(),
            serial_number: unit.serial_number.clone(),
            installed_us,
            removed_us: None,
            unit_hours_at_install: unit.age_hours,
            tail_hours_at_install: self.tail_hours[seat / self.spec.positions.len()],
        });
    }

    fn plan_flight(&mut self, number: usize, tail: usize) {
        let spec = self.spec;
        let name = &spec.tails[tail];
        let flight_id = format!("{name}-{number:04}");
        let mut rng = seeded_rng(spec.seed, &["flight", &flight_id]);
        // Operators record flight hours to a hundredth.
        let spread = spec.flight_hours_spread * rng.random_range(-1.0..=1.0);
        let flight_hours = (spec.flight_hours * (1.0 + spread) * 100.0).round() / 100.0;
        let departure_us = self.slot_us(number) + self.departure_us(flight_hours, &mut rng);
        self.tail_hours[tail] += flight_hours;
        let seats = tail * spec.positions.len()..(tail + 1) * spec.positions.len();
        let actuators =
            seats.map(|seat| self.plan_actuator(seat, number, &flight_id, flight_hours)).collect();
        let log = self.log_number(number, name);
        let is_meant = |fault: &&LogFault| fault.tail == *name && Some(fault.log) == log;
        self.plan.flights.push(PlannedFlight {
            tail_number: name.clone(),
            seed: derive_seed(spec.seed, &["log", &flight_id]),
            flight_id,
            departure_us,
            flight_hours,
            tail_hours_end: self.tail_hours[tail],
            has_log: log.is_some(),
            log_fault: spec.log_faults.iter().find(is_meant).map(|fault| fault.fault),
            actuators,
        });
    }

    /// Departure within the slot, to the second: on any of its days with the flight between 06:00 and 22:00, or, in a
    /// slot shorter than a day, at any time that lets the flight end within the slot.
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

    fn wear(&mut self, index: usize, flight_hours: f64) {
        let unit = &mut self.units[index];
        let scatter_m = self.spec.parts[unit.part].wear_scatter_m;
        let before_m = unit.wear.growth_m(unit.age_hours);
        unit.age_hours += flight_hours;
        let growth_m = unit.wear.growth_m(unit.age_hours) - before_m;
        unit.gap_m += wear::step_m(growth_m, scatter_m, &mut unit.wear_rng);
    }

    /// Applies the wear of the flight and draws plant, profile and sensors.
    fn plan_actuator(
        &mut self,
        seat: usize,
        number: usize,
        flight_id: &str,
        flight_hours: f64,
    ) -> PlannedActuator {
        self.wear(self.unit_at[seat], flight_hours);
        let (spec, unit) = (self.spec, &self.units[self.unit_at[seat]]);
        let (spread, (tail, place)) = (&spec.spread, self.place(seat));
        let mut of_place = seeded_rng(spec.seed, &["place", tail, &place.position]);
        let mut of_stay = seeded_rng(spec.seed, &["stay", tail, &place.position, &unit.serial_number]);
        let mut of_flight = seeded_rng(spec.seed, &["actuator", flight_id, &place.position]);
        let mut sensors = spec.sensors.clone();
        sensors.load.gain_error += spread.load_gain * normal(&mut of_place);
        sensors.screw.nonlinearity += spread.nonlinearity_m * normal(&mut of_place);
        sensors.screw.delay_s += spread.skew_s * normal(&mut of_flight);
        sensors.screw.drift += spread.drift_m * normal(&mut of_flight);
        sensors.load.bias += spread.load_bias_n * normal(&mut of_place);
        let mut plant = spec.parts[unit.part].plant.with_gap_m(unit.gap_m);
        plant.contact.stiffness_n_per_m *= unit.stiffness_factor;
        plant.contact.offset_m = spread.offset_m * of_stay.random_range(-1.0..=1.0);
        plant = plant.with_friction_factor((spread.friction * normal(&mut of_flight)).exp());
        let mut profile = spec.profile.clone();
        profile.load_n *= place.load_factor;
        let mut actuator = PlannedActuator {
            position: place.position.clone(),
            part: unit.part,
            serial_number: unit.serial_number.clone(),
            unit_hours: unit.age_hours,
            plant,
            profile,
            sensors,
        };
        let part_number = &spec.parts[unit.part].part_number;
        spec.changes.iter().for_each(|change| change.apply(&mut actuator, tail, part_number, number));
        actuator.profile.no_reversal |= place.no_reversal || of_flight.random_bool(spread.no_reversal_share);
        actuator
    }
}

impl PlantedChange {
    /// Applies the change to an actuator on a tail, as far as it has come in a flight of the tail, counted from 1.
    fn apply(&self, actuator: &mut PlannedActuator, tail: &str, part_number: &str, number: usize) {
        let conditions = [
            (&self.tail, tail),
            (&self.position, &actuator.position),
            (&self.part_number, part_number),
            (&self.serial_number, &actuator.serial_number),
        ];
        let is_meant = conditions.iter().all(|(wanted, is)| wanted.as_deref().is_none_or(|w| w == *is));
        let Some(gone) = number.checked_sub(self.from_flight).filter(|_| is_meant) else { return };
        let growing = self.to_flight.map_or(0, |to| to.saturating_sub(self.from_flight));
        let share = if gone >= growing { 1.0 } else { (gone + 1) as f64 / (growing + 1) as f64 };
        let PlannedActuator { plant, profile, sensors, .. } = actuator;
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
}

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    let drawn: f64 = StandardNormal.sample(rng);
    drawn.clamp(-2.5, 2.5)
}

/// A unit, with properties drawn at random where the specification does not declare them.
#[derive(Debug, Clone)]
struct FleetUnit {
    /// Index into the spec's parts.
    part: usize,
    serial_number: String,
    age_hours: f64,
    gap_m: f64,
    stiffness_factor: f64,
    wear: WearLaw,
    wear_rng: ChaCha8Rng,
}

/// Every unit of the fleet, in order of tail and position at the start; then the spares, in the spec's order.
fn fleet_units(spec: &Spec) -> Result<Vec<FleetUnit>, Error> {
    let mut units = Vec::new();
    for tail in &spec.tails {
        for place in &spec.positions {
            units.push(unit(spec, tail, place, units.len())?);
        }
    }
    for spare in &spec.replacements {
        units.push(spare_unit(spec, &units, spare));
    }
    let names: Vec<_> = units.iter().map(|unit| (unit.part, unit.serial_number.as_str())).collect();
    match names.iter().enumerate().find(|(k, name)| names[..*k].contains(name)) {
        Some((_, (_, name))) => Err(Error::Twice { kind: "serial number", name: (*name).to_owned() }),
        None => Ok(units),
    }
}

fn unit(spec: &Spec, tail: &str, place: &Position, count: usize) -> Result<FleetUnit, Error> {
    let part = spec.part_of(place)?;
    let chances = &spec.parts[part];
    let mut rng = seeded_rng(spec.seed, &["unit", tail, &place.position]);
    let mut between = |[least, greatest]: [f64; 2]| least + (greatest - least) * rng.random::<f64>();
    let (gap_m, age_hours) = (between(chances.gap_m), between(chances.unit_hours));
    let stiffness_factor = 1.0 + between([-spec.spread.stiffness, spec.spread.stiffness]);
    let declared = spec.units.iter().find(|unit| unit.tail == tail && unit.position == place.position);
    let serial_number = declared.and_then(|u| u.serial_number.clone());
    let serial_number = serial_number.unwrap_or(format!("S{}", 10_001 + count));
    Ok(FleetUnit {
        part,
        wear_rng: seeded_rng(spec.seed, &["wear", &serial_number]),
        serial_number,
        age_hours: declared.and_then(|u| u.unit_hours).unwrap_or(age_hours),
        gap_m: declared.and_then(|u| u.gap_m).unwrap_or(gap_m),
        stiffness_factor: declared.and_then(|u| u.stiffness_factor).unwrap_or(stiffness_factor),
        wear: declared.and_then(|u| u.wear).unwrap_or(chances.wear),
    })
}

/// A spare of the part number at its position, with the nominal stiffness.
fn spare_unit(spec: &Spec, units: &[FleetUnit], spare: &Replacement) -> FleetUnit {
    let part = units[seat(spec, &spare.tail, &spare.position)].part;
    FleetUnit {
        part,
        wear_rng: seeded_rng(spec.seed, &["wear", &spare.serial_number]),
        serial_number: spare.serial_number.clone(),
        age_hours: spare.unit_hours,
        gap_m: spare.gap_m,
        stiffness_factor: 1.0,
        wear: spare.wear.unwrap_or(spec.parts[part].wear),
    }
}

/// Index of a position of a tail, counted by tail and then by position; `Spec::check` ensures that both names exist.
fn seat(spec: &Spec, tail: &str, position: &str) -> usize {
    let tail = spec.tails.iter().take_while(|known| *known != tail).count();
    let position = spec.positions.iter().take_while(|known| known.position != position).count();
    tail * spec.positions.len() + position
}
