//! A fleet's calendar with its truth, and the log of one flight.

use crate::fleet::fleet_events::FaultKind;
use crate::fleet::fleet_spec::Part;
use crate::load::flight_profile::Profile;
use crate::plant::actuator_plant::Plant;
use crate::sensors::sensor::Sensors;

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

/// A row of the maintenance table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Maintenance {
    /// The design.
    pub part_number: String,
    /// The unit.
    pub serial_number: String,
    /// When, microseconds since 1970 UTC.
    pub at_us: i64,
}

/// Play measured in the hangar.
#[derive(Debug, Clone, PartialEq)]
pub struct Inspection {
    /// The design.
    pub part_number: String,
    /// The unit.
    pub serial_number: String,
    /// When, microseconds since 1970 UTC.
    pub at_us: i64,
    /// The reading, metres.
    pub play_m: f64,
    /// The instrument.
    pub instrument: String,
    /// The force at which the play was read, N.
    pub force_n: f64,
}

/// One actuator in one flight: its unit, and everything needed to simulate it.
#[derive(Debug, Clone, PartialEq)]
pub struct PlannedActuator {
    /// The place.
    pub position: String,
    /// Index of the design in the plan's parts.
    pub part: usize,
    /// The unit.
    pub serial_number: String,
    /// The unit's age after the flight, hours.
    pub unit_hours: f64,
    /// The actuator, with the gap that the wear of this flight leaves.
    pub plant: Plant,
    /// Commands and loads.
    pub profile: Profile,
    /// The sensors that read it.
    pub sensors: Sensors,
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
    /// Whether it has a log.
    pub has_log: bool,
    /// What happens to the file of that log.
    pub log_fault: Option<FaultKind>,
    /// The actuators, in the spec's order of positions.
    pub actuators: Vec<PlannedActuator>,
    pub(crate) seed: u64,
}

/// The unit of a logged channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ChannelUnit {
    /// m.
    Metre,
    /// µm.
    Micrometre,
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
    pub motor_unit: ChannelUnit,
    /// Screw position, in `screw_unit`.
    pub screw: Vec<f64>,
    /// Metres or micrometres, or radians of a rotary output.
    pub screw_unit: ChannelUnit,
    /// Load, in `load_unit`.
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
    /// Every stay, by tail, position and time.
    pub installations: Vec<Installation>,
    /// Recorded re-shims, by time.
    pub maintenance: Vec<Maintenance>,
    /// Play checks, by time.
    pub inspections: Vec<Inspection>,
    /// Every flight, by flight number, then tail.
    pub flights: Vec<PlannedFlight>,
}
