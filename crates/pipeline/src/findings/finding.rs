//! Finding: the state of one quantity of one unit after a run, or a change that a tail or a part made, as alerts and
//! work requests need it.

use jiff::Timestamp;
use records::{QuantityChange, QuantityRow, TrendRow};

use crate::fleet::histories::UnitKey;

/// Quantity of the free play.
pub const GAP: &str = "gap";

/// Planning horizons within which a `plan` that was sent stands.
const NEAR_PLAN: f64 = 1.1;

/// State of a quantity other than the gap that has not changed.
pub(crate) const UNCHANGED: &str = "normal";

/// State of one quantity of one unit, or a change that a tail or a part made.
#[derive(Debug, Clone, Default, PartialEq)]
#[expect(missing_docs, reason = "each field is named for what it holds, with its unit")]
pub struct Finding {
    /// Without a serial number for a tail or a part.
    pub unit: UnitKey,
    pub tail_number: Option<String>,
    pub position: Option<String>,
    /// Name of the quantity, [`GAP`] for the free play.
    pub quantity: &'static str,
    /// `None` of a unit that is not assessed or was removed.
    pub state: Option<&'static str>,
    pub reason: Option<String>,
    /// First flight of a change that a tail or a part made; none for a unit's state.
    pub since_utc: Option<Timestamp>,
    pub as_of_utc: Timestamp,
    pub latest_flight_utc: Option<Timestamp>,
    /// Whether the unit wears and its earliest crossing is beyond the planning horizon by a tenth at most: a `plan` that
    /// was sent stands, or it would come and go with the scatter of the forecast.
    pub is_near_plan: bool,
    /// The assessment, of a gap.
    pub assessment: Option<TrendRow>,
    /// The open work request about it.
    pub work_request: Option<String>,
    /// Why the state is another one than after the run before, where it is.
    pub cause: Option<String>,
}

impl Finding {
    /// Findings about the followed quantities of units, each `normal` where it has no state of its own.
    pub(crate) fn of_quantities(rows: &[QuantityRow]) -> impl Iterator<Item = Self> {
        rows.iter().map(|row| Self {
            unit: row.unit(),
            tail_number: row.tail_number.clone(),
            position: row.position.clone(),
            quantity: row.quantity,
            state: Some(row.state.unwrap_or(UNCHANGED)),
            reason: row.reason.clone(),
            as_of_utc: row.as_of_utc,
            ..Self::default()
        })
    }

    /// Findings about changes that tails or parts made.
    pub(crate) fn of_common_changes(
        changes: &[QuantityChange],
        as_of_utc: Timestamp,
    ) -> impl Iterator<Item = Self> {
        changes.iter().filter(|change| change.serial_number.is_none()).map(move |change| Self {
            unit: (change.part_number.clone(), String::new()),
            tail_number: change.tail_number.clone(),
            quantity: change.quantity,
            state: change.state,
            reason: Some(change.evidence.clone()),
            since_utc: Some(change.since_utc),
            as_of_utc,
            ..Self::default()
        })
    }

    pub(crate) fn serial_number(&self) -> Option<&str> {
        Some(self.unit.1.as_str()).filter(|_| self.since_utc.is_none())
    }

    /// Whether the state is worth a row where none was known: every state of a gap, and other quantities that changed.
    pub(crate) fn is_noteworthy(&self) -> bool {
        if self.quantity == GAP { self.state.is_some() } else { self.state != Some(UNCHANGED) }
    }

    /// The state of a unit's gap, where the limit is planned for within some flight hours.
    pub(crate) fn of_gap(
        row: &TrendRow,
        latest_flight_utc: Option<Timestamp>,
        planning_horizon_hours: f64,
    ) -> Self {
        let is_near = |hours: f64| hours <= NEAR_PLAN * planning_horizon_hours;
        Self {
            unit: row.unit(),
            tail_number: row.tail_number.clone(),
            position: row.position.clone(),
            quantity: GAP,
            state: row.state,
            reason: row.reason.clone(),
            as_of_utc: row.as_of_utc,
            latest_flight_utc,
            is_near_plan: row.trend == "wearing" && row.crossing_hours_p05.is_some_and(is_near),
            assessment: Some(row.clone()),
            ..Self::default()
        }
    }
}
