//! Changes in a run: states and events of units with and without the run's flights.
//!
//! Both assessments are computed now with one prior, so nothing is stored between runs, and a new training cut-off
//! of a prior changes no state by itself. Where a run computes records again, the assessments before it are kept.
use std::collections::BTreeMap;

use serde::Serialize;

use crate::history::histories::UnitKey;
use records::time::days_between;
use records::{ChangePoint, TrendRow};

/// An event of one kind is the same one when its date moved by no more than this: dates are estimates.
const SAME_EVENT_DAYS: f64 = 60.0;

/// A unit whose assessment differs from the one without the run's flights.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[expect(missing_docs, reason = "each field is named for what it holds")]
pub struct UnitChange {
    pub part_number: Option<String>,
    pub serial_number: String,
    pub tail_number: Option<String>,
    pub position: Option<String>,
    /// The state without the run's flights, and with them.
    pub from: Option<&'static str>,
    pub to: Option<&'static str>,
    /// Why the state is what it is now.
    pub reason: Option<String>,
    pub new_events: Vec<ChangePoint>,
    pub cleared_events: Vec<ChangePoint>,
}

/// The units whose state or events differ, in the order of `now`.
pub(crate) fn changed(before: &BTreeMap<UnitKey, TrendRow>, now: &[TrendRow]) -> Vec<UnitChange> {
    now.iter().filter_map(|row| of_unit(before.get(&row.unit()), row)).collect()
}

/// The change of a unit of which no flight is left: the records of its logs belong to another unit now.
pub(crate) fn gone(row: &TrendRow, now: &[TrendRow]) -> UnitChange {
    let is_same_place =
        |other: &&TrendRow| other.tail_number == row.tail_number && other.position == row.position;
    let reason = match now.iter().find(is_same_place) {
        Some(other) => format!(
            "no flight is left; {} of {} is {} / {} now",
            row.position.as_deref().unwrap_or("–"),
            row.tail_number.as_deref().unwrap_or("–"),
            other.part_number.as_deref().unwrap_or("–"),
            other.serial_number
        ),
        None => "no flight is left".to_owned(),
    };
    UnitChange {
        part_number: row.part_number.clone(),
        serial_number: row.serial_number.clone(),
        tail_number: row.tail_number.clone(),
        position: row.position.clone(),
        from: row.state,
        to: None,
        reason: Some(reason),
        new_events: Vec::new(),
        cleared_events: Vec::new(),
    }
}

fn of_unit(before: Option<&TrendRow>, now: &TrendRow) -> Option<UnitChange> {
    let known = before.map_or(&[][..], |row| &row.change_points);
    let new_events = beyond(&now.change_points, known);
    let cleared_events = beyond(known, &now.change_points);
    let from = before.and_then(|row| row.state);
    let is_news = from != now.state || !new_events.is_empty() || !cleared_events.is_empty();
    is_news.then(|| UnitChange {
        part_number: now.part_number.clone(),
        serial_number: now.serial_number.clone(),
        tail_number: now.tail_number.clone(),
        position: now.position.clone(),
        from,
        to: now.state,
        reason: now.reason.clone(),
        new_events,
        cleared_events,
    })
}

/// Events that have no like among others.
fn beyond(events: &[ChangePoint], others: &[ChangePoint]) -> Vec<ChangePoint> {
    let is_like = |a: &ChangePoint, b: &ChangePoint| {
        a.kind == b.kind && days_between(a.departure_utc, b.departure_utc).abs() <= SAME_EVENT_DAYS
    };
    events.iter().filter(|event| !others.iter().any(|other| is_like(event, other))).cloned().collect()
}
