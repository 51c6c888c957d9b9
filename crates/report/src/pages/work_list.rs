//! Work list: units by aircraft with due date, action, reason and chance, on the pages of fleet and tail.

use std::collections::BTreeMap;

use records::TrendRow;

use crate::charts::quantities::sparkline;
use crate::model::{Report, UnitView};

/// Name of the group of units that are on no known aircraft.
pub(crate) const UNKNOWN: &str = "tail not known";

/// Units of an aircraft, the earliest date first.
pub(crate) struct Group<'a> {
    /// Number of the aircraft; empty on its own page.
    pub(crate) tail: &'a str,
    pub(crate) units: Vec<&'a UnitView>,
}

impl<'a> Group<'a> {
    /// Units in order of their dates, those without a date last.
    pub(crate) fn new(tail: &'a str, mut units: Vec<&'a UnitView>) -> Self {
        let due = |unit: &UnitView| (unit.row.due_utc.is_none(), unit.row.due_utc);
        units.sort_by(|a, b| due(a).cmp(&due(b)).then_with(|| a.row.by_urgency(&b.row)));
        Self { tail, units }
    }

    /// Whether one visit serves several units.
    pub(crate) fn visit(&self) -> String {
        match self.units.iter().filter(|unit| unit.row.action.is_some()).count() {
            0 | 1 => String::new(),
            2 => "one visit: do both".to_owned(),
            count => format!("one visit: do all {count}"),
        }
    }
}

/// Units that need action or have an open work request, with the most urgent aircraft first.
pub(crate) fn work(report: &Report) -> Vec<&UnitView> {
    let needs_work = |unit: &&UnitView| unit.row.action.is_some() || unit.open_request().is_some();
    let mut units: Vec<&UnitView> = report.units.iter().filter(needs_work).collect();
    units.sort_by(|a, b| a.row.by_urgency(&b.row));
    let mut first: BTreeMap<Option<&str>, usize> = BTreeMap::new();
    for (rank, unit) in units.iter().enumerate() {
        first.entry(unit.row.tail_number.as_deref()).or_insert(rank);
    }
    units.sort_by_key(|unit| first.get(&unit.row.tail_number.as_deref()).copied());
    units
}

/// Groups units that are sorted by aircraft.
pub(crate) fn grouped<'a>(units: &[&'a UnitView]) -> Vec<Group<'a>> {
    let tail = |unit: &&'a UnitView| unit.row.tail_number.as_deref().unwrap_or(UNKNOWN);
    units.chunk_by(|a, b| tail(a) == tail(b)).map(|of| Group::new(tail(&of[0]), of.to_vec())).collect()
}

/// What to do with which actuator: `Replace aileron_left`; of a unit without an action, its position.
pub(crate) fn what(row: &TrendRow) -> String {
    let position = row.position.as_deref().unwrap_or(&row.serial_number);
    let Some(verb) = row.verb() else { return position.to_owned() };
    let between = if verb.contains(' ') { ":" } else { "" };
    format!("{}{between} {position}", capital(&verb))
}

pub(crate) fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map(|first| first.to_uppercase().chain(letters).collect()).unwrap_or_default()
}

/// Gaps of a unit from zero to its limit, oldest first.
pub(crate) fn sketch(unit: &UnitView) -> String {
    let gaps: Vec<[f64; 2]> =
        unit.row.sketch_m.0.iter().enumerate().map(|(k, gap_m)| [k as f64, gap_m * 1e6]).collect();
    let limit = unit.row.limit_m.map(|limit_m| limit_m * 1e6);
    let full = gaps.iter().map(|gap| gap[1]).chain(limit).fold(1.0, f64::max) * 1.05;
    sparkline([150.0, 32.0], [0.0, gaps.len().saturating_sub(1).max(1) as f64], full, &gaps, limit)
}
