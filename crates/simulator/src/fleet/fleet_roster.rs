//! Assignment of units to positions over time.

use rand::Rng;

use crate::error::Error;
use crate::fleet::fleet_events::Replacement;
use crate::fleet::fleet_spec::{Position, Spec};
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

/// Every unit of the fleet, in order of tail and position at the start; then the spares, in the spec's order.
pub(crate) fn fleet_units(spec: &Spec) -> Result<Vec<FleetUnit>, Error> {
    let places = spec.tails.iter().flat_map(|tail| spec.positions.iter().map(move |place| (tail, place)));
    let mut units: Vec<FleetUnit> = places
        .enumerate()
        .map(|(count, (tail, place))| unit(spec, tail, place, count))
        .collect::<Result<_, _>>()?;
    let spares: Vec<_> = spec.replacements.iter().map(|spare| spare_unit(spec, &units, spare)).collect();
    units.extend(spares);
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

/// A spare of the part that its place holds, as stiff as the part.
fn spare_unit(spec: &Spec, units: &[FleetUnit], spare: &Replacement) -> FleetUnit {
    let part = units[seat(spec, &spare.tail, &spare.position)].part;
    FleetUnit {
        part,
        serial_number: spare.serial_number.clone(),
        age_hours: spare.unit_hours,
        gap_m: spare.gap_m,
        stiffness_factor: 1.0,
        wear: spare.wear.unwrap_or(spec.parts[part].wear),
    }
}

/// Index of a place; the spec is checked before, so both names are found.
fn seat(spec: &Spec, tail: &str, position: &str) -> usize {
    let tail = spec.tails.iter().take_while(|known| *known != tail).count();
    let position = spec.positions.iter().take_while(|known| known.position != position).count();
    tail * spec.positions.len() + position
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

    /// The unit installed in a named place.
    pub(crate) fn installed(&self, spec: &Spec, tail: &str, position: &str) -> usize {
        self.units[seat(spec, tail, position)]
    }

    /// Carries out the swaps and replacements due before a flight, counted from 1, and names the seats they
    /// touched.
    pub(crate) fn swap(
        &mut self,
        spec: &Spec,
        units: &[FleetUnit],
        flight: usize,
    ) -> Result<Vec<(usize, usize)>, Error> {
        let mut touched = Vec::new();
        for swap in spec.swaps.iter().filter(|swap| swap.before_flight == flight) {
            let [a, b] = [&swap.from, &swap.to].map(|place| seat(spec, &place.tail, &place.position));
            let part = |seat: usize| units[self.units[seat]].part;
            if part(a) != part(b) {
                let name = |seat| spec.parts[part(seat)].part_number.clone();
                return Err(Error::Misfit { flight, from: name(a), to: name(b) });
            }
            self.units.swap(a, b);
            touched.extend([a, b]);
        }
        let first_spare = spec.tails.len() * self.positions;
        for (k, spare) in spec.replacements.iter().enumerate().filter(|(_, s)| s.before_flight == flight) {
            let at = seat(spec, &spare.tail, &spare.position);
            self.units[at] = first_spare + k;
            touched.push(at);
        }
        touched.sort_unstable();
        touched.dedup();
        Ok(touched.into_iter().map(|seat| (seat / self.positions, seat % self.positions)).collect())
    }
}
