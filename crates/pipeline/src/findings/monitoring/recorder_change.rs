//! Recorder changes: changes of followed quantities that wear does not make.
//!
//! The delay between the positions jumps when a recorder, a sensor or its wiring is changed, the fitted stiffness of all
//! actuators of an aircraft when what measures load is, and the zero and the delay of a load channel when its cell or
//! its wiring is.

use jiff::Timestamp;
use records::time::days_between;
use records::{ChangeScope, Quantity, QuantityChange};
use serde::Serialize;

use crate::findings::monitoring::REPORTED_DAYS;

/// A quantity that moved, on one aircraft.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[expect(missing_docs, reason = "each field is named for what it holds")]
pub struct RecorderChange {
    pub tail_number: String,
    pub quantity: Quantity,
    pub positions: Vec<String>,
    /// Whether these are most of the positions of the aircraft that could show it, and two at least: a matter of
    /// what records them, not of any of them.
    pub everywhere: bool,
    /// The first flight of the new level.
    pub since_utc: Timestamp,
    /// Level before the change; of several positions, their median.
    pub from: f64,
    /// Level after it, likewise.
    pub to: f64,
}

impl RecorderChange {
    /// Whether a change on that aircraft may be this one.
    pub(crate) fn explains(&self, tail_number: &str, departure_utc: Timestamp) -> bool {
        self.everywhere
            && self.tail_number == tail_number
            && days_between(self.since_utc, departure_utc).abs() <= SAME_DAYS
    }
}

const SAME_DAYS: f64 = 3.0;

/// Quantities of a channel, and the stiffness: one unit's stiffness changes with the unit, that of a whole aircraft with
/// what measures its loads.
const OF_RECORDERS: [Quantity; 4] =
    [Quantity::SkewS, Quantity::StiffnessNPerM, Quantity::LoadZeroN, Quantity::LoadDelayS];

/// The steps of recorders and sensors within the last month before a day.
pub(crate) fn recorder_changes(changes: &[QuantityChange], as_of: Timestamp) -> Vec<RecorderChange> {
    let moved = |change: &QuantityChange| {
        let quantity = OF_RECORDERS.into_iter().find(|quantity| quantity.as_str() == change.quantity)?;
        let everywhere = change.scope == ChangeScope::Tail.as_str();
        let is_of_recorder = everywhere
            || (change.scope == ChangeScope::Unit.as_str() && quantity != Quantity::StiffnessNPerM);
        let is_recent = days_between(change.since_utc, as_of) <= REPORTED_DAYS;
        (is_of_recorder && is_recent && change.kind == "step").then(|| RecorderChange {
            tail_number: change.tail_number.clone().unwrap_or_default(),
            quantity,
            positions: change.positions.clone(),
            everywhere,
            since_utc: change.since_utc,
            from: change.from,
            to: change.to,
        })
    };
    let mut found: Vec<RecorderChange> = changes.iter().filter_map(moved).collect();
    found.sort_by(|a, b| {
        (&a.tail_number, a.quantity, a.since_utc).cmp(&(&b.tail_number, b.quantity, b.since_utc))
    });
    found
}
