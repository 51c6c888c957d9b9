//! Followed quantities on the pages of unit, tail and fleet: small charts, levels, and what changed.

use jiff::Timestamp;
use records::{Quantity, QuantityChange};

use crate::charts::quantities::{Line, small_chart};
use crate::format::{NO_DATA, date};
use crate::model::{QuantityView, Report, UnitView};
use crate::page::{Error, tail_path, unit_path};

/// Quantities with a chart on a unit's page.
const OF_UNIT: [Quantity; 6] = [
    Quantity::StiffnessNPerM,
    Quantity::FrictionN,
    Quantity::LostMotionM,
    Quantity::SkewS,
    Quantity::LoadZeroN,
    Quantity::LoadDelayS,
];
/// Quantities with a chart on a tail's page: those that a sensor or recorder of the aircraft moves.
const OF_TAIL: [Quantity; 4] =
    [Quantity::SkewS, Quantity::StiffnessNPerM, Quantity::LoadZeroN, Quantity::LoadDelayS];

/// A chart with its heading and description.
pub(crate) struct Chart {
    pub(crate) heading: String,
    pub(crate) description: String,
    pub(crate) svg: String,
}

/// A followed quantity as a row of a table.
pub(crate) struct Level {
    pub(crate) name: String,
    pub(crate) flights: String,
    pub(crate) level: String,
    pub(crate) change: String,
    pub(crate) limit: String,
    pub(crate) state: String,
}

/// A change as a row of a table.
pub(crate) struct Change {
    pub(crate) since: String,
    pub(crate) whose: &'static str,
    pub(crate) link: Option<String>,
    pub(crate) name: String,
    pub(crate) evidence: String,
}

/// Charts of a unit, all on the time axis of its flights, with its events.
pub(crate) fn unit_charts(unit: &UnitView) -> Result<Vec<Chart>, Error> {
    let Some(span) = span(std::iter::once(unit)) else { return Ok(Vec::new()) };
    let events: Vec<Timestamp> = unit.events.iter().map(|event| event.departure_utc).collect();
    let mut charts = Vec::new();
    for quantity in OF_UNIT {
        let Some(view) = view(unit, quantity) else { continue };
        let steps = view.row.steps.iter().map(|step| step.departure_utc);
        let all: Vec<Timestamp> = events.iter().copied().chain(steps).collect();
        let line = Line { flights: points(unit, view), level: view.row.level };
        let svg = small_chart(quantity, &[line], &all, span)?;
        charts.extend(chart(quantity, svg, &unit.name()));
    }
    Ok(charts)
}

/// Charts of the units of a tail together.
pub(crate) fn tail_charts(report: &Report, tail: &str) -> Result<Vec<Chart>, Error> {
    let units: Vec<&UnitView> =
        report.units.iter().filter(|u| u.tail_number.as_deref() == Some(tail)).collect();
    let Some(span) = span(units.iter().copied()) else { return Ok(Vec::new()) };
    let mut charts = Vec::new();
    for quantity in OF_TAIL {
        let of_tail = |change: &&QuantityChange| {
            change.tail_number.as_deref() == Some(tail)
                && change.serial_number.is_none()
                && change.quantity == quantity.as_str()
        };
        let events: Vec<Timestamp> =
            report.quantity_changes.iter().filter(of_tail).map(|change| change.since_utc).collect();
        let line =
            |unit: &&UnitView| Some(Line { flights: points(unit, view(unit, quantity)?), level: None });
        let lines: Vec<Line> = units.iter().filter_map(line).collect();
        charts.extend(chart(quantity, small_chart(quantity, &lines, &events, span)?, tail));
    }
    Ok(charts)
}

fn chart(quantity: Quantity, svg: String, name: &str) -> Option<Chart> {
    let (unit, _) = quantity.display_unit();
    let unit = if unit.is_empty() { String::new() } else { format!(" [{unit}]") };
    (!svg.is_empty()).then(|| Chart {
        heading: format!("{}{unit}", quantity.label()),
        description: format!("{}{unit} of {name} against date", quantity.label()),
        svg,
    })
}

fn view(unit: &UnitView, quantity: Quantity) -> Option<&QuantityView> {
    unit.quantities.iter().find(|view| view.row.quantity == quantity.as_str())
}

/// The values of a quantity by departure.
fn points(unit: &UnitView, view: &QuantityView) -> Vec<(Timestamp, f64)> {
    let departures = unit.flights.iter().map(|flight| flight.departure_utc);
    let points = departures.zip(&view.values).filter(|(_, value)| value.is_finite());
    points.map(|(at, value)| (at, f64::from(*value))).collect()
}

/// First and last flight of some units.
fn span<'a>(units: impl Iterator<Item = &'a UnitView>) -> Option<(Timestamp, Timestamp)> {
    let flights: Vec<Timestamp> =
        units.flat_map(|unit| unit.flights.iter().map(|flight| flight.departure_utc)).collect();
    Some((*flights.iter().min()?, *flights.iter().max()?))
}

/// Levels of all followed quantities of a unit.
pub(crate) fn levels(unit: &UnitView) -> Vec<Level> {
    unit.quantities.iter().filter_map(level).collect()
}

fn level(view: &QuantityView) -> Option<Level> {
    let (row, quantity) = (&view.row, Quantity::from_name(view.row.quantity)?);
    let (unit, factor) = quantity.display_unit();
    let shown = |value: Option<f64>| {
        value.map_or_else(|| NO_DATA.to_owned(), |v| format!("{} {unit}", significant(v * factor)))
    };
    let with_error = |value: Option<f64>, se: Option<f64>| match (value, se) {
        (Some(v), Some(se)) => {
            let half = records::uncertainty::NORMAL_95 * se * factor;
            // Two digits of the uncertainty; more of the level are noise.
            let places = if half > 0.0 { (1 - half.log10().floor() as i32).clamp(0, 6) as usize } else { 2 };
            format!("{:.places$} ± {half:.places$} {unit}", v * factor)
        }
        _ => NO_DATA.to_owned(),
    };
    let is_changed = row.change.is_some_and(|change| change != 0.0);
    Some(Level {
        name: quantity.label().to_owned(),
        flights: row.flights.to_string(),
        level: with_error(row.level, row.level_se),
        change: if is_changed { with_error(row.change, row.change_se) } else { "none".to_owned() },
        limit: shown(row.change_limit),
        state: row.state.unwrap_or_default().replace('_', " "),
    })
}

/// A number with three significant digits.
fn significant(value: f64) -> String {
    let magnitude = if value == 0.0 { 0 } else { value.abs().log10().floor() as i32 };
    format!("{value:.*}", (2 - magnitude).clamp(0, 4) as usize)
}

/// What changed on some of the fleet's units, tails and parts.
pub(crate) fn changes(report: &Report, root: &str, wanted: impl Fn(&QuantityChange) -> bool) -> Vec<Change> {
    report.quantity_changes.iter().filter(|change| wanted(change)).map(|c| change(report, root, c)).collect()
}

fn change(report: &Report, root: &str, change: &QuantityChange) -> Change {
    let is_unit = |unit: &&UnitView| {
        Some(&unit.serial_number) == change.serial_number.as_ref() && unit.part_number == change.part_number
    };
    let unit = change.serial_number.as_ref().and_then(|_| report.units.iter().find(is_unit));
    let known = |tail: &&String| report.tails.iter().any(|t| t.tail_number == **tail);
    let link = match unit {
        Some(unit) => Some(unit_path(unit)),
        None => change.tail_number.as_ref().filter(known).map(|tail| tail_path(tail)),
    };
    let name = match (unit, &change.tail_number, &change.part_number) {
        (Some(unit), ..) => unit.name(),
        (None, Some(tail), _) => tail.clone(),
        (None, None, part) => part.clone().unwrap_or_else(|| NO_DATA.to_owned()),
    };
    Change {
        since: date(change.since_utc),
        whose: change.scope,
        link: link.map(|path| format!("{root}{path}")),
        name,
        evidence: change.evidence.clone(),
    }
}
