//! Assignment of units to positions over time.

use rand::Rng;

use crate::error::Error;
use crate::fleet::fleet_spec::{Place, Position, Spec};
use crate::fleet::wear::WearLaw;
use crate::seeded_streams::seeded_rng;

/// A unit as chance and the spec made it.
#[derive(Debug, Clone)]
pub(crate) struct FleetUnit {
    /// Index into the spec's parts.
    pub(crate) part: usize,
    pub(crate) serial_number: String,
    pub(crate) age_hours: f64,
    pub(crate) gap_m: f64,
    pub(crate) stiffness_factor: f64,
    pub(crate) wear: WearLaw,
}

/// Every unit of the fleet, in order of tail and position at the start.
pub(crate) fn fleet_units(spec: &Spec) -> Result<Vec<FleetUnit>, Error> {
    let places = spec.tails.iter().flat_map(|tail| spec.positions.iter().map(move |place| (tail, place)));
    let units: Vec<FleetUnit> = places
        .enumerate()
        .map(|(count, (tail, place))| unit(spec, tail, place, count))
        .collect::<Result<_, _>>()?;
    let names: Vec<_> = units.iter().map(|unit| (unit.part, unit.serial_number.as_str())).collect();
    match names.iter().enumerate().find(|(k, name)| names[..*k].contains(name)) {
        Some((_, (_, name))) => Err(Error::Twice { kind: "serial number", name: (*name).to_owned() }),
        None => Ok(units),
    }
}

fn unit(spec: &Spec, tail: &str, place: &Position, count: usize) -> Result<FleetUnit, Error> {
    let part = spec.part_index(&place.position, &place.part_number)?;
    let chances = &spec.parts[part];
    let mut rng = seeded_rng(spec.seed, &["unit", tail, &place.position]);
    let mut between = |[least, greatest]: [f64; 2]| least + (greatest - least) * rng.random::<f64>();
    let (gap_m, age_hours) = (between(chances.gap_m), between(chances.unit_hours));
    let stiffness_factor = 1.0 + between([-spec.spread.stiffness, spec.spread.stiffness]);
    let declared = spec.units.iter().find(|unit| unit.tail == tail && unit.position == place.position);
    Ok(FleetUnit {
        part,
        serial_number: declared
            .and_then(|u| u.serial_number.clone())
            .unwrap_or(format!("S{}", 10_001 + count)),
        age_hours: declared.and_then(|u| u.unit_hours).unwrap_or(age_hours),
        gap_m: declared.and_then(|u| u.gap_m).unwrap_or(gap_m),
        stiffness_factor: declared.and_then(|u| u.stiffness_factor).unwrap_or(stiffness_factor),
        wear: declared.and_then(|u| u.wear).unwrap_or(chances.wear),
    })
}

/// Who sits where, one flight after the other.
#[derive(Debug, Clone)]
pub(crate) struct UnitAssignment {
    positions: usize,
    units: Vec<usize>,
}

impl UnitAssignment {
    /// Everybody where they start.
    pub(crate) fn new(spec: &Spec) -> Self {
        let positions = spec.positions.len();
        Self { positions, units: (0..spec.tails.len() * positions).collect() }
    }

    /// The unit in a place.
    pub(crate) fn unit(&self, tail: usize, position: usize) -> usize {
        self.units[tail * self.positions + position]
    }

    /// Carries out the swaps due before a flight, counted from 1, and names the seats they touched.
    pub(crate) fn swap(
        &mut self,
        spec: &Spec,
        units: &[FleetUnit],
        flight: usize,
    ) -> Result<Vec<(usize, usize)>, Error> {
        let mut touched = Vec::new();
        for swap in spec.swaps.iter().filter(|swap| swap.before_flight == flight) {
            let (a, b) = (self.seat(spec, &swap.from), self.seat(spec, &swap.to));
            let part = |seat: usize| units[self.units[seat]].part;
            if part(a) != part(b) {
                let name = |seat| spec.parts[part(seat)].part_number.clone();
                return Err(Error::Misfit { flight, from: name(a), to: name(b) });
            }
            self.units.swap(a, b);
            touched.extend([a, b].map(|seat| (seat / self.positions, seat % self.positions)));
        }
        touched.sort_unstable();
        touched.dedup();
        Ok(touched)
    }

    /// The spec is checked before, so both names are found.
    fn seat(&self, spec: &Spec, place: &Place) -> usize {
        let tail = spec.tails.iter().take_while(|tail| **tail != place.tail).count();
        let position = spec.positions.iter().take_while(|known| known.position != place.position).count();
        tail * self.positions + position
    }
}
