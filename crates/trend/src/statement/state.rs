//! Alert state of a unit, and its reason.

use std::fmt;

use crate::data::series::DAY_US;
use crate::settings::Settings;
use crate::statement::types::{ChangePoint, ChangePointKind, Crossing, Level, MIN_ESTIMATES};

/// By how much a limit must be left before the state it caused is: three per cent of a gap, fifteen of
/// the planning horizon. Without it a unit at a limit would change its state from run to run.
const GAP_MARGIN: f64 = 0.97;
const HORIZON_MARGIN: f64 = 1.15;

/// Alert state of a unit, from least to most urgent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum State {
    /// No action.
    Normal,
    /// Inspect or monitor the unit.
    Watch,
    /// Plan the replacement.
    Plan,
    /// Replace the unit.
    Act,
}

impl State {
    /// All states, from least to most urgent.
    pub const ALL: [Self; 4] = [Self::Normal, Self::Watch, Self::Plan, Self::Act];

    /// Its word in columns, keys and messages.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Normal => "normal",
            Self::Watch => "watch",
            Self::Plan => "plan",
            Self::Act => "act",
        }
    }

    /// The state with this word.
    pub fn from_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|state| state.as_str() == word)
    }
}

/// Why a state, or none.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(missing_docs, reason = "each field is named for what it holds, with its unit")]
pub enum Reason {
    /// No flight before the day, or none with a gap.
    NoEstimate,
    /// Too few estimates.
    TooFew { estimates: usize },
    /// No curve that explains the history has the gap where the last estimates are.
    Unsupported { gap_m: f64, recent_m: f64 },
    /// The gap is at its act limit.
    AtLimit { gap_m: f64, limit_m: f64 },
    /// The early crossing lies within the planning horizon.
    CrossesSoon { p05_hours: f64, planning_horizon_hours: f64 },
    /// The gap is at its watch limit.
    AtWatch { gap_m: f64, watch_m: f64 },
    /// A recent unrecorded change.
    Changed { kind: ChangePointKind, days: f64 },
    /// Nothing calls for anything.
    Clear,
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let um = |m: f64| m * 1e6;
        match *self {
            Self::NoEstimate => write!(f, "no estimate yet"),
            Self::TooFew { estimates } => {
                let noun = if estimates == 1 { "estimate" } else { "estimates" };
                write!(f, "only {estimates} {noun}; at least {MIN_ESTIMATES} are needed")
            }
            Self::Unsupported { gap_m, recent_m } => {
                let (gap_um, recent_um) = (um(gap_m), um(recent_m));
                write!(
                    f,
                    "fit ends at {gap_um:.1} µm but the latest estimates average {recent_um:.1} µm: not assessed"
                )
            }
            Self::AtLimit { gap_m, limit_m } if gap_m < limit_m => write!(
                f,
                "gap {:.1} µm was at the limit of {:.1} µm; `act` holds until it is below {:.1} µm",
                um(gap_m),
                um(limit_m),
                um(GAP_MARGIN * limit_m)
            ),
            Self::AtLimit { gap_m, limit_m } => {
                write!(f, "gap {:.1} µm is at or above the limit of {:.1} µm", um(gap_m), um(limit_m))
            }
            Self::CrossesSoon { p05_hours, planning_horizon_hours } if p05_hours < 0.5 => {
                write!(
                    f,
                    "may already be at the limit (5 % point); planning horizon {planning_horizon_hours:.0} FH"
                )
            }
            Self::CrossesSoon { p05_hours, planning_horizon_hours } if p05_hours > planning_horizon_hours => {
                let held_hours = HORIZON_MARGIN * planning_horizon_hours;
                write!(
                    f,
                    "could reach the limit in {p05_hours:.0} FH (5 % point); `plan` holds until that exceeds {held_hours:.0} FH"
                )
            }
            Self::CrossesSoon { p05_hours, planning_horizon_hours } => {
                write!(
                    f,
                    "could reach the limit within {p05_hours:.0} FH (5 % point); planning horizon {planning_horizon_hours:.0} FH"
                )
            }
            Self::AtWatch { gap_m, watch_m } if gap_m < watch_m => write!(
                f,
                "gap {:.1} µm was above the watch limit of {:.1} µm; `watch` holds until it is below {:.1} µm",
                um(gap_m),
                um(watch_m),
                um(GAP_MARGIN * watch_m)
            ),
            Self::AtWatch { gap_m, watch_m } => {
                write!(f, "gap {:.1} µm is above the watch limit of {:.1} µm", um(gap_m), um(watch_m))
            }
            Self::Changed { kind: ChangePointKind::Onset, days } => {
                write!(f, "wear began or sped up {days:.0} days ago")
            }
            Self::Changed { kind, days } => write!(f, "{kind} {days:.0} days ago, not on record"),
            Self::Clear => write!(f, "below all limits"),
        }
    }
}

/// Evidence for a state.
pub(crate) struct Evidence<'a> {
    /// Departure of the last flight with a gap.
    pub(crate) last_gap_us: Option<i64>,
    pub(crate) estimates: usize,
    pub(crate) as_of_us: i64,
    pub(crate) level: Option<Level>,
    pub(crate) crossing: Option<Crossing>,
    pub(crate) changes: &'a [ChangePoint],
    /// The unsupported level, and the level of the last estimates.
    pub(crate) unsupported: Option<(f64, f64)>,
}

/// The state and its reason, most urgent first; a `previous` state is left only past its margin.
pub(crate) fn alert_state(
    evidence: &Evidence<'_>,
    settings: &Settings,
    previous: Option<State>,
) -> (Option<State>, Reason) {
    let Some(last_gap_us) = evidence.last_gap_us else {
        return (None, Reason::NoEstimate);
    };
    let days_since =
        |departure_us: i64| evidence.as_of_us.saturating_sub(departure_us) as f64 / DAY_US as f64;
    let (Some(Level { gap_m, .. }), Some(crossing)) = (evidence.level, evidence.crossing) else {
        let few = Reason::TooFew { estimates: evidence.estimates };
        let unsupported = |(gap_m, recent_m)| Reason::Unsupported { gap_m, recent_m };
        let enough = evidence.estimates >= MIN_ESTIMATES;
        return (None, evidence.unsupported.filter(|_| enough).map_or(few, unsupported));
    };
    let Settings { limit_m, watch_m, planning_horizon_hours, .. } = *settings;
    let margin = |state: State, margin: f64| if previous >= Some(state) { margin } else { 1.0 };
    if gap_m >= limit_m * margin(State::Act, GAP_MARGIN) {
        return (Some(State::Act), Reason::AtLimit { gap_m, limit_m });
    }
    let horizon_hours = planning_horizon_hours * margin(State::Plan, HORIZON_MARGIN);
    if let Some(p05_hours) = crossing.p05_hours.filter(|hours| *hours <= horizon_hours) {
        return (Some(State::Plan), Reason::CrossesSoon { p05_hours, planning_horizon_hours });
    }
    if gap_m >= watch_m * margin(State::Watch, GAP_MARGIN) {
        return (Some(State::Watch), Reason::AtWatch { gap_m, watch_m });
    }
    let unknown = |change: &&ChangePoint| change.kind != ChangePointKind::Recorded;
    if let Some(change) = evidence.changes.iter().rev().find(unknown) {
        let days = days_since(change.departure_us);
        // Counted to the last estimate: that no flight follows clears nothing.
        let days_until_estimate = days - days_since(last_gap_us);
        if days_until_estimate <= settings.change_watch_days {
            return (Some(State::Watch), Reason::Changed { kind: change.kind, days });
        }
    }
    (Some(State::Normal), Reason::Clear)
}
