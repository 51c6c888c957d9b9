//! Followed quantities on the pages of unit, tail and fleet: small charts, levels, and what changed.

use jiff::Timestamp;
use records::{Quantity, QuantityChange, significant};

use crate::charts::quantities::small_chart;
use crate::format::NO_DATA;
use crate::model::{QuantityView, Report, UnitView};
use crate::page::{tail_path, unit_path};

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
pub(crate) struct Change<'a> {
    pub(crate) row: &'a QuantityChange,
    /// Page of the unit or tail, and its name.
    pub(crate) link: Option<String>,
    pub(crate) name: String,
}

/// Charts of the quantities that changed on a unit, with their steps and its events.
pub(crate) fn unit_charts(unit: &UnitView) -> Vec<Chart> {
    let events = || unit.events.iter().map(|event| event.departure_utc);
    let chart = |view: &QuantityView| {
        let row = &view.row;
        let quantity = row.quantity.parse().ok().filter(|_| row.state.is_some() || !row.steps.is_empty())?;
        let departures = unit.flights.iter().map(|flight| flight.departure_utc);
        let points = departures.zip(&view.values).filter(|(_, value)| value.is_finite());
        let points: Vec<(Timestamp, f64)> = points.map(|(at, value)| (at, f64::from(*value))).collect();
        let steps: Vec<Timestamp> = events().chain(row.steps.iter().map(|step| step.departure_utc)).collect();
        let svg = small_chart(quantity, &points, row.level, &steps);
        let (unit_of, _) = quantity.display_unit();
        let unit_of = if unit_of.is_empty() { String::new() } else { format!(" [{unit_of}]") };
        let heading = format!("{}{unit_of}", quantity.label());
        let description = format!("{heading} of {} against date", unit.name());
        (!svg.is_empty()).then_some(Chart { heading, description, svg })
    };
    unit.quantities.iter().filter_map(chart).collect()
}

pub(crate) fn level(view: &QuantityView) -> Option<Level> {
    let (row, quantity) = (&view.row, view.row.quantity.parse::<Quantity>().ok()?);
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

/// What changed on some of the fleet's units, tails and parts.
pub(crate) fn changes<'a>(
    report: &'a Report,
    root: &str,
    wanted: impl Fn(&QuantityChange) -> bool,
) -> Vec<Change<'a>> {
    report.quantity_changes.iter().filter(|change| wanted(change)).map(|c| change(report, root, c)).collect()
}

fn change<'a>(report: &Report, root: &str, change: &'a QuantityChange) -> Change<'a> {
    let is_unit = |unit: &&UnitView| {
        Some(&unit.row.serial_number) == change.serial_number.as_ref()
            && unit.row.part_number == change.part_number
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
    Change { row: change, link: link.map(|path| format!("{root}{path}")), name }
}
