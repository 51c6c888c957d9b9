//! Fleet specification `SPEC.toml`: every key has a default except names, parts and positions.

use jiff::civil::Date;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;

use crate::error::{Error, finite, not_negative, positive, within};
use crate::fleet::fleet_events::{LogFault, PlayCheck, Replacement, Reshim, Swap};
use crate::fleet::planted_change::PlantedChange;
use crate::fleet::wear::WearLaw;
use crate::load::flight_profile::Profile;
use crate::load::vibration::Vibration;
use crate::plant::actuator_plant::Plant;
use crate::sensors::sensor::Sensors;

/// The fleet that made the sample data, as TOML text: three tails with four positions, twelve weeks of flights.
pub const SAMPLE_SPEC: &str = include_str!("../../specs/sample.toml");

/// A fleet, its flights and its sensors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, SmartDefault)]
#[serde(deny_unknown_fields, default)]
pub struct Spec {
    /// Everything random follows from this. Default 1.
    #[default(1)]
    pub seed: u64,
    /// Midnight UTC of this day opens the plan, `2026-03-02`.
    #[default("2026-03-02")]
    pub start_date: String,
    /// Tail numbers.
    pub tails: Vec<String>,
    /// How many flights each tail makes. Default 10.
    #[default(10)]
    pub flights_per_tail: usize,
    /// One flight of this many in a row, drawn at random, has a log. Default 1: each.
    #[default(1)]
    pub flights_per_log: usize,
    /// Days from one flight of a tail to the next; below 1, several flights a day. Default 7.
    #[default(7.0)]
    pub days_between_flights: f64,
    /// Mean length of a flight, hours. Default 1.8.
    #[default(1.8)]
    pub flight_hours: f64,
    /// Flights last evenly between ± this share of the mean. Default 0.3.
    #[default(0.3)]
    pub flight_hours_spread: f64,
    /// What the first tail's meter reads at the start, hours; each further tail has 10 % more. Default 2000.
    #[default(2000.0)]
    pub tail_hours: f64,
    /// Length, rate and loads of the logs.
    pub profile: Profile,
    /// The sensors of every actuator.
    pub sensors: Sensors,
    /// How units, aircraft and flights differ from each other.
    pub spread: ParameterSpread,
    /// The designs.
    pub parts: Vec<Part>,
    /// The places on each tail.
    pub positions: Vec<Position>,
    /// Units that are to differ from what chance gives.
    pub units: Vec<UnitSpec>,
    /// Exchanges of two units.
    pub swaps: Vec<Swap>,
    /// Removals of a unit for a spare.
    pub replacements: Vec<Replacement>,
    /// Gaps set by a shim.
    pub reshims: Vec<Reshim>,
    /// Play measured in the hangar.
    pub play_checks: Vec<PlayCheck>,
    /// Log files that do not arrive as recorded.
    pub log_faults: Vec<LogFault>,
    /// Aircraft whose load cells or structure differ from the others'.
    pub aircraft: Vec<Aircraft>,
    /// Changes that come over the flights.
    pub changes: Vec<PlantedChange>,
}

/// What differs, drawn per unit, per place or per flight; every default is zero, no difference.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ParameterSpread {
    /// Stiffness of a unit over the part's, minus one: evenly between ± this.
    pub stiffness: f64,
    /// δX₀ of a stay: evenly between ± this, metres.
    pub offset_m: f64,
    /// Gain of a place's load cell, minus one: rms.
    pub load_gain: f64,
    /// Zero error of a place's load cell: rms, N.
    pub load_bias_n: f64,
    /// Nonlinearity of a place's screw transducer: rms of its peak, metres.
    pub nonlinearity_m: f64,
    /// Delay of a flight's screw channel, added to the sensors' own: rms, seconds.
    pub skew_s: f64,
    /// Drift of a flight's screw channel: rms, metres.
    pub drift_m: f64,
    /// Friction of a flight over the part's, as the rms of its natural logarithm.
    pub friction: f64,
    /// Share of the flights whose load never reverses.
    pub no_reversal_share: f64,
}

/// In which quantity the motor position is logged.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MotorLogFormat {
    /// Metres at the screw.
    Position,
    /// Resolver angle, radians, counted on through the turns.
    #[default]
    Angle,
    /// Resolver angle, radians, −π to π.
    WrappedAngle,
}

/// Unit of a logged screw position.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum ScrewLogUnit {
    /// Millimetres.
    #[default]
    #[serde(rename = "mm")]
    Millimetre,
    /// Micrometres.
    #[serde(rename = "um")]
    Micrometre,
}

/// One design.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Part {
    /// Its name.
    pub part_number: String,
    /// Travel of the screw per turn of the resolver, metres. Default 0.005.
    #[serde(default = "default_lead")]
    pub lead_m: f64,
    /// How its motor position is logged. Default `angle`.
    #[serde(default)]
    pub motor_log: MotorLogFormat,
    /// Unit in which a linear screw position is logged. Default `mm`.
    #[serde(default)]
    pub screw_log: ScrewLogUnit,
    /// For a rotary actuator the radius r at which its metres and newtons are meant: the output is
    /// logged as `X/r` in radians and the load as `F·r` in N·m. Default none, a linear actuator.
    pub reference_radius_m: Option<f64>,
    /// The gap at which a unit must be removed, metres. Default 200 µm.
    #[serde(default = "default_limit")]
    pub limit_m: f64,
    /// Least and greatest gap of a unit at the start, metres. Default 50 to 90 µm.
    #[serde(default = "default_gaps")]
    pub gap_m: [f64; 2],
    /// Least and greatest age of a unit at the start, hours. Default 400 to 1600.
    #[serde(default = "default_ages")]
    pub unit_hours: [f64; 2],
    /// How its units wear. Default steady.
    #[serde(default)]
    pub wear: WearLaw,
    /// Unevenness of wear, metres: the variance of a growth is this times the growth. Default 0.
    #[serde(default)]
    pub wear_scatter_m: f64,
    /// Its mechanics; the gap and offset in it are replaced by each unit's own.
    #[serde(default)]
    pub plant: Plant,
}

fn default_lead() -> f64 {
    0.005
}
fn default_limit() -> f64 {
    200e-6
}
fn default_gaps() -> [f64; 2] {
    [50e-6, 90e-6]
}
fn default_ages() -> [f64; 2] {
    [400.0, 1600.0]
}

/// One place on every tail.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Position {
    /// Its name, as logs and installations use it.
    pub position: String,
    /// The design that fits there.
    pub part_number: String,
    /// Its load over the profile's. Default 1.
    #[serde(default = "default_factor")]
    pub load_factor: f64,
    /// Its load never changes sign. Default false.
    #[serde(default)]
    pub no_reversal: bool,
}

fn default_factor() -> f64 {
    1.0
}

/// The unit that sits in a place at the start; whatever is left out comes from chance and the part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct UnitSpec {
    /// The tail it starts on.
    pub tail: String,
    /// The place it starts in.
    pub position: String,
    /// Its serial number. Default: counted up from `S10001`.
    pub serial_number: Option<String>,
    /// Its gap at the start, metres.
    pub gap_m: Option<f64>,
    /// Its age at the start, hours.
    pub unit_hours: Option<f64>,
    /// Its stiffness over the part's.
    pub stiffness_factor: Option<f64>,
    /// How it wears.
    pub wear: Option<WearLaw>,
}

/// What differs on all actuators of one tail.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Aircraft {
    /// The tail.
    pub tail: String,
    /// Zero error of its load cells, N, added to the sensors' own. Default 0.
    #[serde(default)]
    pub load_bias_n: f64,
    /// Vibration of its loads in place of the profile's. Default the profile's.
    pub buffet: Option<Vibration>,
}

impl Spec {
    /// Midnight UTC that opens the plan, microseconds since 1970.
    pub(crate) fn start_us(&self) -> Result<i64, Error> {
        let day = Date::strptime("%Y-%m-%d", &self.start_date)
            .map_err(|_| Error::Date { text: self.start_date.clone() })?;
        Ok(day.duration_since(Date::constant(1970, 1, 1)).as_micros() as i64)
    }

    /// Where in `parts` the part of a name stands.
    pub(crate) fn part_index(&self, place: &str, part_number: &str) -> Result<usize, Error> {
        let mut names = self.parts.iter().map(|part| part.part_number.as_str());
        let found = names.clone().position(|name| name == part_number);
        found.ok_or_else(|| unknown(&format!("position \"{place}\""), "part", part_number, &mut names))
    }

    /// Checks that every number is in its range and every name is declared once.
    pub(crate) fn check(&self) -> Result<(), Error> {
        self.start_us()?;
        self.check_names()?;
        self.check_flights()?;
        self.profile.check()?;
        self.sensors.check()?;
        self.spread.check()?;
        self.parts.iter().try_for_each(Part::check)?;
        self.positions.iter().try_for_each(|place| self.check_position(place))?;
        self.units.iter().try_for_each(|unit| self.check_unit(unit))?;
        self.swaps.iter().try_for_each(|swap| self.check_swap(swap))?;
        self.replacements.iter().try_for_each(|spare| self.check_replacement(spare))?;
        self.reshims.iter().try_for_each(|shim| self.check_reshim(shim))?;
        self.play_checks.iter().try_for_each(|check| self.check_play_check(check))?;
        self.log_faults.iter().try_for_each(|fault| self.check_log_fault(fault))?;
        self.aircraft.iter().try_for_each(|aircraft| self.check_aircraft(aircraft))?;
        self.changes.iter().try_for_each(|change| self.check_change(change))
    }

    fn check_names(&self) -> Result<(), Error> {
        let tails: Vec<&str> = self.tails.iter().map(String::as_str).collect();
        let parts: Vec<&str> = self.parts.iter().map(|part| part.part_number.as_str()).collect();
        let positions: Vec<&str> = self.positions.iter().map(|place| place.position.as_str()).collect();
        check_unique("tails", "tail", &tails)?;
        check_unique("parts", "part", &parts)?;
        check_unique("positions", "position", &positions)
    }

    fn check_flights(&self) -> Result<(), Error> {
        positive("flights_per_tail", self.flights_per_tail as f64)?;
        positive("flights_per_log", self.flights_per_log as f64)?;
        positive("days_between_flights", self.days_between_flights)?;
        positive("flight_hours", self.flight_hours)?;
        within("flight_hours_spread", self.flight_hours_spread, 0.0, 0.9, "between 0 and 0.9")?;
        not_negative("tail_hours", self.tail_hours)?;
        let longest = self.flight_hours * (1.0 + self.flight_hours_spread);
        let day_hours =
            if self.days_between_flights >= 1.0 { 16.0 } else { 22.0 * self.days_between_flights };
        if longest > day_hours {
            return Err(Error::Crowded { flight_hours: longest, days: self.days_between_flights });
        }
        Ok(())
    }

    fn check_position(&self, place: &Position) -> Result<(), Error> {
        not_negative(&format!("positions {} load_factor", place.position), place.load_factor)?;
        self.part_index(&place.position, &place.part_number).map(|_| ())
    }

    fn check_unit(&self, unit: &UnitSpec) -> Result<(), Error> {
        self.check_place("a unit", &unit.tail, &unit.position)?;
        let key = |name: &str| format!("units {} {} {name}", unit.tail, unit.position);
        not_negative(&key("gap_m"), unit.gap_m.unwrap_or(0.0))?;
        not_negative(&key("unit_hours"), unit.unit_hours.unwrap_or(0.0))?;
        positive(&key("stiffness_factor"), unit.stiffness_factor.unwrap_or(1.0))?;
        unit.wear.map_or(Ok(()), |law| law.check())
    }

    fn check_swap(&self, swap: &Swap) -> Result<(), Error> {
        self.check_before("a swap", swap.before_flight, &swap.from.tail, &swap.from.position)?;
        self.check_place("a swap", &swap.to.tail, &swap.to.position)
    }

    fn check_replacement(&self, spare: &Replacement) -> Result<(), Error> {
        let key = |name: &str| format!("replacements {} {name}", spare.serial_number);
        not_negative(&key("gap_m"), spare.gap_m)?;
        not_negative(&key("unit_hours"), spare.unit_hours)?;
        spare.wear.map_or(Ok(()), |law| law.check())?;
        self.check_before("a replacement", spare.before_flight, &spare.tail, &spare.position)
    }

    fn check_reshim(&self, shim: &Reshim) -> Result<(), Error> {
        not_negative(&format!("reshims {} {} gap_m", shim.tail, shim.position), shim.gap_m)?;
        self.check_before("a re-shim", shim.before_flight, &shim.tail, &shim.position)
    }

    fn check_play_check(&self, check: &PlayCheck) -> Result<(), Error> {
        let key = |name: &str| format!("play_checks {} {} {name}", check.tail, check.position);
        finite(&key("error_m"), check.error_m)?;
        positive(&key("force_n"), check.force_n)?;
        self.check_before("a play check", check.before_flight, &check.tail, &check.position)
    }

    fn check_log_fault(&self, fault: &LogFault) -> Result<(), Error> {
        let logs = self.flights_per_tail.div_ceil(self.flights_per_log) as f64;
        within("log_faults log", fault.log as f64, 1.0, logs, "between 1 and the number of the tail's logs")?;
        self.check_tail("a log fault", &fault.tail)
    }

    /// An event lies between two flights of a declared place.
    fn check_before(&self, who: &str, flight: usize, tail: &str, position: &str) -> Result<(), Error> {
        let (last, must) = (self.flights_per_tail as f64, "between 2 and `flights_per_tail`");
        within(&format!("before_flight of {who}"), flight as f64, 2.0, last, must)?;
        self.check_place(who, tail, position)
    }

    fn check_aircraft(&self, aircraft: &Aircraft) -> Result<(), Error> {
        let tail = &aircraft.tail;
        self.check_tail("an aircraft", tail)?;
        finite(&format!("aircraft {tail} load_bias_n"), aircraft.load_bias_n)?;
        aircraft.buffet.as_ref().map_or(Ok(()), |buffet| buffet.check(&format!("aircraft {tail} buffet")))
    }

    fn check_change(&self, change: &PlantedChange) -> Result<(), Error> {
        change.check()?;
        let tail = change.tail.as_deref().unwrap_or(&self.tails[0]);
        let position = change.position.as_deref().unwrap_or(&self.positions[0].position);
        self.check_place("a change", tail, position)?;
        let part = change.part_number.as_deref().map(|part| self.part_index("a change", part));
        part.transpose().map(|_| ())
    }

    fn check_tail(&self, who: &str, tail: &str) -> Result<(), Error> {
        if self.tails.iter().any(|known| known == tail) {
            return Ok(());
        }
        Err(unknown(who, "tail", tail, self.tails.iter().map(String::as_str)))
    }

    fn check_place(&self, who: &str, tail: &str, position: &str) -> Result<(), Error> {
        self.check_tail(who, tail)?;
        let mut positions = self.positions.iter().map(|place| place.position.as_str());
        if positions.clone().all(|known| known != position) {
            return Err(unknown(who, "position", position, &mut positions));
        }
        Ok(())
    }
}

impl ParameterSpread {
    fn check(&self) -> Result<(), Error> {
        within("spread.stiffness", self.stiffness, 0.0, 0.3, "between 0 and 0.3")?;
        finite("spread.offset_m", self.offset_m)?;
        within("spread.load_gain", self.load_gain, 0.0, 0.1, "between 0 and 0.1")?;
        not_negative("spread.load_bias_n", self.load_bias_n)?;
        not_negative("spread.nonlinearity_m", self.nonlinearity_m)?;
        within("spread.skew_s", self.skew_s, 0.0, 0.05, "between 0 and 0.05 s")?;
        not_negative("spread.drift_m", self.drift_m)?;
        within("spread.friction", self.friction, 0.0, 1.0, "between 0 and 1")?;
        within("spread.no_reversal_share", self.no_reversal_share, 0.0, 1.0, "between 0 and 1")
    }
}

impl Part {
    fn check(&self) -> Result<(), Error> {
        let key = |name: &str| format!("parts {} {name}", self.part_number);
        positive(&key("lead_m"), self.lead_m)?;
        positive(&key("reference_radius_m"), self.reference_radius_m.unwrap_or(1.0))?;
        positive(&key("limit_m"), self.limit_m)?;
        for (name, [least, greatest]) in [("gap_m", self.gap_m), ("unit_hours", self.unit_hours)] {
            not_negative(&key(name), least)?;
            within(&key(name), greatest, least, f64::MAX, "a range, the least value first")?;
        }
        self.wear.check()?;
        not_negative(&key("wear_scatter_m"), self.wear_scatter_m)?;
        self.plant.check()
    }
}

fn check_unique(key: &'static str, kind: &'static str, names: &[&str]) -> Result<(), Error> {
    if names.is_empty() {
        return Err(Error::Empty { key });
    }
    let again = names.iter().enumerate().find(|(k, name)| names[..*k].contains(name));
    again.map_or(Ok(()), |(_, name)| Err(Error::Twice { kind, name: (*name).to_owned() }))
}

fn unknown<'a>(place: &str, kind: &'static str, name: &str, known: impl Iterator<Item = &'a str>) -> Error {
    let known = known.collect::<Vec<_>>().join(", ");
    Error::Unknown { place: place.to_owned(), kind, name: name.to_owned(), known }
}
