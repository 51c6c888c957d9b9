//! Fleet specification `SPEC.toml`: every key has a default except names, parts and positions.
#![expect(missing_docs, reason = "docs/simulator.md explains each key")]

use jiff::civil::Date;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;

use crate::error::Error;
use crate::fleet::fleet_events::{LogFault, PlantedChange, PlayCheck, Replacement, Reshim, Swap};
use crate::fleet::wear::WearLaw;
use crate::load::flight_profile::Profile;
use crate::plant::actuator_plant::Plant;
use crate::ranges;
use crate::sensors::sensor::Sensors;

/// The fleet that made the sample data, as TOML text: three tails with four positions, twelve weeks of flights.
pub const SAMPLE_SPEC: &str = include_str!("../../specs/sample.toml");

/// A fleet, its flights and its sensors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, SmartDefault)]
#[serde(deny_unknown_fields, default)]
pub struct Spec {
    #[default(1)]
    pub seed: u64,
    /// Midnight UTC of this day opens the plan, `2026-03-02`.
    #[default("2026-03-02")]
    pub start_date: String,
    pub tails: Vec<String>,
    #[default(10)]
    pub flights_per_tail: usize,
    #[default(1)]
    pub flights_per_log: usize,
    #[default(7.0)]
    pub days_between_flights: f64,
    #[default(1.8)]
    pub flight_hours: f64,
    /// Flights last evenly between ± this share of the mean. Default 0.3.
    #[default(0.3)]
    pub flight_hours_spread: f64,
    /// What the first tail's meter reads at the start, hours; each further tail has 10 % more. Default 2000.
    #[default(2000.0)]
    pub tail_hours: f64,
    pub profile: Profile,
    pub sensors: Sensors,
    pub spread: ParameterSpread,
    pub parts: Vec<Part>,
    pub positions: Vec<Position>,
    pub units: Vec<UnitSpec>,
    pub swaps: Vec<Swap>,
    pub replacements: Vec<Replacement>,
    pub reshims: Vec<Reshim>,
    pub play_checks: Vec<PlayCheck>,
    pub log_faults: Vec<LogFault>,
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
    Position,
    #[default]
    Angle,
    WrappedAngle,
}

/// Unit of a logged screw position.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum ScrewLogUnit {
    #[default]
    #[serde(rename = "mm")]
    Millimetre,
    #[serde(rename = "um")]
    Micrometre,
}

/// One design.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, SmartDefault)]
#[serde(deny_unknown_fields, default)]
pub struct Part {
    pub part_number: String,
    /// Travel of the screw per turn of the resolver, metres. Default 0.005.
    #[default(0.005)]
    pub lead_m: f64,
    pub motor_log: MotorLogFormat,
    pub screw_log: ScrewLogUnit,
    /// For a rotary actuator the radius r at which its metres and newtons are meant: the output is
    /// logged as `X/r` in radians and the load as `F·r` in N·m. Default none, a linear actuator.
    pub reference_radius_m: Option<f64>,
    #[default(200e-6)]
    pub limit_m: f64,
    /// Least and greatest gap of a unit at the start, metres. Default 50 to 90 µm.
    #[default([50e-6, 90e-6])]
    pub gap_m: [f64; 2],
    /// Least and greatest age of a unit at the start, hours. Default 400 to 1600.
    #[default([400.0, 1600.0])]
    pub unit_hours: [f64; 2],
    pub wear: WearLaw,
    /// Unevenness of wear, metres: the variance of a growth is this times the growth. Default 0.
    pub wear_scatter_m: f64,
    /// Its mechanics; the gap and offset in it are replaced by each unit's own.
    pub plant: Plant,
}

/// One place on every tail.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, SmartDefault)]
#[serde(deny_unknown_fields, default)]
pub struct Position {
    pub position: String,
    pub part_number: String,
    #[default(1.0)]
    pub load_factor: f64,
    pub no_reversal: bool,
}

/// The unit that sits in a place at the start; whatever is left out comes from chance and the part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct UnitSpec {
    pub tail: String,
    pub position: String,
    /// Its serial number. Default: counted up from `S10001`.
    pub serial_number: Option<String>,
    pub gap_m: Option<f64>,
    pub unit_hours: Option<f64>,
    pub stiffness_factor: Option<f64>,
    pub wear: Option<WearLaw>,
}

impl Spec {
    /// Midnight UTC that opens the plan, microseconds since 1970.
    pub(crate) fn start_us(&self) -> Result<i64, Error> {
        let day = Date::strptime("%Y-%m-%d", &self.start_date)
            .map_err(|_| Error::Date { text: self.start_date.clone() })?;
        Ok(day.duration_since(Date::constant(1970, 1, 1)).as_micros() as i64)
    }

    pub(crate) fn part_of(&self, place: &Position) -> Result<usize, Error> {
        let who = format!("position \"{}\"", place.position);
        known(&who, "part", &place.part_number, &self.part_numbers())
    }

    fn tails(&self) -> Vec<&str> {
        self.tails.iter().map(String::as_str).collect()
    }

    fn part_numbers(&self) -> Vec<&str> {
        self.parts.iter().map(|part| part.part_number.as_str()).collect()
    }

    fn positions(&self) -> Vec<&str> {
        self.positions.iter().map(|place| place.position.as_str()).collect()
    }

    /// Checks that every number is in its range and every name is declared once.
    pub(crate) fn check(&self) -> Result<(), Error> {
        self.start_us()?;
        check_unique("tails", "tail", &self.tails())?;
        check_unique("parts", "part", &self.part_numbers())?;
        check_unique("positions", "position", &self.positions())?;
        // Every seed is possible, but not every one is a number of TOML.
        ranges::check("", &Self { seed: 0, ..self.clone() })?;
        self.check_departures()?;
        self.positions.iter().try_for_each(|place| self.part_of(place).map(drop))?;
        self.units.iter().try_for_each(|unit| self.check_place("a unit", &unit.tail, &unit.position))?;
        self.check_events()?;
        self.log_faults.iter().try_for_each(|fault| self.check_log_fault(fault))?;
        self.changes.iter().try_for_each(|change| self.check_change(change))
    }

    /// The longest flight fits between two departures.
    fn check_departures(&self) -> Result<(), Error> {
        let longest = self.flight_hours * (1.0 + self.flight_hours_spread);
        let day_hours =
            if self.days_between_flights >= 1.0 { 16.0 } else { 22.0 * self.days_between_flights };
        if longest > day_hours {
            return Err(Error::Crowded { flight_hours: longest, days: self.days_between_flights });
        }
        Ok(())
    }

    /// Each event lies between two flights of a declared place.
    fn check_events(&self) -> Result<(), Error> {
        let swaps = self.swaps.iter().flat_map(|swap| {
            [&swap.from, &swap.to].map(|of| ("a swap", swap.before_flight, &of.tail, &of.position))
        });
        let spares = self.replacements.iter();
        let spares = spares.map(|of| ("a replacement", of.before_flight, &of.tail, &of.position));
        let reshims = self.reshims.iter();
        let reshims = reshims.map(|of| ("a re-shim", of.before_flight, &of.tail, &of.position));
        let checks = self.play_checks.iter();
        let checks = checks.map(|of| ("a play check", of.before_flight, &of.tail, &of.position));
        swaps.chain(spares).chain(reshims).chain(checks).try_for_each(|(who, flight, tail, position)| {
            if !(2..=self.flights_per_tail).contains(&flight) {
                let (key, must) = (format!("before_flight of {who}"), "between 2 and `flights_per_tail`");
                return Err(Error::Value { key, value: flight as f64, must: must.to_owned() });
            }
            self.check_place(who, tail, position)
        })
    }

    fn check_log_fault(&self, fault: &LogFault) -> Result<(), Error> {
        if !(1..=self.flights_per_tail.div_ceil(self.flights_per_log)).contains(&fault.log) {
            let must = "between 1 and the number of the tail's logs".to_owned();
            return Err(Error::Value { key: "log_faults log".to_owned(), value: fault.log as f64, must });
        }
        known("a log fault", "tail", &fault.tail, &self.tails()).map(drop)
    }

    fn check_change(&self, change: &PlantedChange) -> Result<(), Error> {
        let tail = change.tail.as_deref().unwrap_or(&self.tails[0]);
        let position = change.position.as_deref().unwrap_or(&self.positions[0].position);
        self.check_place("a change", tail, position)?;
        let mut parts = change.part_number.iter();
        parts.try_for_each(|part| known("a change", "part", part, &self.part_numbers()).map(drop))
    }

    fn check_place(&self, who: &str, tail: &str, position: &str) -> Result<(), Error> {
        known(who, "tail", tail, &self.tails())?;
        known(who, "position", position, &self.positions()).map(drop)
    }
}

fn check_unique(key: &'static str, kind: &'static str, names: &[&str]) -> Result<(), Error> {
    if names.is_empty() || names.contains(&"") {
        return Err(Error::Empty { key });
    }
    let again = names.iter().enumerate().find(|(k, name)| names[..*k].contains(name));
    again.map_or(Ok(()), |(_, name)| Err(Error::Twice { kind, name: (*name).to_owned() }))
}

/// Index of a name among the declared ones; `who` uses it.
fn known(who: &str, kind: &'static str, name: &str, declared: &[&str]) -> Result<usize, Error> {
    declared.iter().position(|known| *known == name).ok_or_else(|| Error::Unknown {
        place: who.to_owned(),
        kind,
        name: name.to_owned(),
        known: declared.join(", "),
    })
}
