//! The units of a fleet: those of the start and the spares.

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

/// Index of a place, counted by tail and then by position; the spec is checked before, so both names are found.
pub(crate) fn seat(spec: &Spec, tail: &str, position: &str) -> usize {
    let tail = spec.tails.iter().take_while(|known| *known != tail).count();
    let position = spec.positions.iter().take_while(|known| known.position != position).count();
    tail * spec.positions.len() + position
}
