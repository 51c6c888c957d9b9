//! The statement: what is known of one unit on one day.

use std::fmt;

use crate::error::Error;
use crate::prior::FleetPrior;
use crate::series::{Flight, Series};
use crate::settings::Settings;
use crate::{classic, rate};

/// Estimates below which nothing but a level is said.
pub const FEWEST_ESTIMATES: usize = 8;

/// What is known of one unit on one day.
#[derive(Debug, Clone, PartialEq)]
pub struct Trend {
    /// The day of the statement, microseconds since 1970 UTC; nothing later was looked at.
    pub as_of_us: i64,
    /// Flights with a row, refused ones included.
    pub flights: usize,
    /// Flights with a gap.
    pub estimates: usize,
    /// The unit's own hours, where its hours at the start are known.
    pub unit_hours: Option<f64>,
    /// The gap now.
    pub level: Option<Level>,
    /// Its growth now.
    pub rate: Option<Rate>,
    /// Does it wear?
    pub wear: Wear,
    /// Two-sided Mann–Kendall p-value of the estimates; for information.
    pub trend_p_value: Option<f64>,
    /// Steps, resets and onsets, by departure.
    pub changes: Vec<Change>,
    /// When the act limit is met.
    pub crossing: Option<Crossing>,
    /// What to do; nothing when no recent estimate supports a state.
    pub state: Option<State>,
    /// Why this state, or why none.
    pub reason: Reason,
}

/// The gap at the end of the last flight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Level {
    /// The gap, metres.
    pub gap_m: f64,
    /// Its standard error, metres.
    pub se_m: f64,
}

/// Growth in metres per flight hour, with its 90 % interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rate {
    /// 5 % bound.
    pub p05_m_per_hour: f64,
    /// Median.
    pub m_per_hour: f64,
    /// 95 % bound.
    pub p95_m_per_hour: f64,
}

/// Flight hours from the end of the last flight to the first with a gap at the act limit: zero when
/// already over, nothing beyond the horizon.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crossing {
    /// Not before.
    pub p05_hours: Option<f64>,
    /// Likely.
    pub p50_hours: Option<f64>,
    /// Not after.
    pub p95_hours: Option<f64>,
}

/// Whether a unit wears.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wear {
    /// It has grown, or grows.
    Wearing,
    /// No growth is seen.
    Steady,
    /// Too little is known.
    Unknown,
}

/// A change that wear does not make.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Change {
    /// The first flight after it, microseconds since 1970 UTC.
    pub departure_us: i64,
    /// What it is.
    pub kind: ChangeKind,
    /// Its size, metres; zero for an onset.
    pub step_m: f64,
}

/// Kinds of change.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ChangeKind {
    /// The measurement moved: re-rigging, another reference. The wear did not.
    Step,
    /// The gap fell to near a new unit's: re-shimmed, overhauled or replaced.
    Reset,
    /// Wear began, or sped up.
    Onset,
    /// In the books: an installation or a maintenance entry.
    Recorded,
}

/// What to do, from least to most urgent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum State {
    /// Nothing.
    Normal,
    /// Look at it.
    Watch,
    /// Plan the change.
    Plan,
    /// Change it.
    Act,
}

/// Why a state, or none.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(missing_docs, reason = "each field is named for what it holds, with its unit")]
pub enum Reason {
    /// No flight before the day, or none with a gap.
    NoEstimate,
    /// The last estimate is too old.
    Stale { days: f64 },
    /// Too few estimates.
    TooFew { estimates: usize },
    /// The gap is at its act limit.
    AtLimit { gap_m: f64, limit_m: f64 },
    /// The early crossing lies within the planning horizon.
    CrossesSoon { p05_hours: f64, planning_horizon_hours: f64 },
    /// The gap is at its watch limit.
    AtWatch { gap_m: f64, watch_m: f64 },
    /// Nothing calls for anything.
    Clear,
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let um = |m: f64| m * 1e6;
        match *self {
            Self::NoEstimate => write!(f, "no estimate yet"),
            Self::Stale { days } => write!(f, "last estimate is {days:.0} days old"),
            Self::TooFew { estimates } => {
                write!(f, "only {estimates} estimates, {FEWEST_ESTIMATES} are needed")
            }
            Self::AtLimit { gap_m, limit_m } => {
                write!(f, "gap {:.1} µm is at the limit of {:.1} µm", um(gap_m), um(limit_m))
            }
            Self::CrossesSoon { p05_hours, planning_horizon_hours } => {
                write!(
                    f,
                    "limit may be met in {p05_hours:.0} h, within the planning horizon of {planning_horizon_hours:.0} h"
                )
            }
            Self::AtWatch { gap_m, watch_m } => {
                write!(f, "gap {:.1} µm is at the watch limit of {:.1} µm", um(gap_m), um(watch_m))
            }
            Self::Clear => write!(f, "no limit is near"),
        }
    }
}

/// States what is known of a unit on a day from its flights until then.
///
/// `prior` is what the part number's fleet teaches, learned from nothing later than the same day;
/// without one a unit is judged by itself alone.
///
/// # Errors
/// [`Error::Setting`] or [`Error::LimitOrder`] for unusable settings.
pub fn trend(
    series: &Series,
    as_of_us: i64,
    settings: &Settings,
    prior: Option<&FleetPrior>,
) -> Result<Trend, Error> {
    settings.check()?;
    let flights = series.until(as_of_us);
    let points = rate::points(flights);
    let line = rate::fit(&points, prior);
    let crossing = line.as_ref().map(|line| line.crossing(settings));
    let (state, reason) =
        judge(flights, points.len(), as_of_us, settings, line.as_ref().map(|l| l.level), crossing);
    let gaps: Vec<f64> = points.iter().map(|p| p.gap_m).collect();
    Ok(Trend {
        as_of_us,
        flights: flights.len(),
        estimates: points.len(),
        unit_hours: series.unit_hours_at_start().zip(flights.last()).map(|(start, last)| start + last.hours),
        level: line.as_ref().map(|l| l.level),
        rate: line.as_ref().map(|l| l.rate),
        wear: line.as_ref().map_or(Wear::Unknown, rate::Fit::wear),
        trend_p_value: classic::mann_kendall(&gaps).ok().map(|test| test.p_value),
        changes: Vec::new(),
        crossing,
        state,
        reason,
    })
}

/// The state and its reason, most urgent first.
fn judge(
    flights: &[Flight],
    estimates: usize,
    as_of_us: i64,
    settings: &Settings,
    level: Option<Level>,
    crossing: Option<Crossing>,
) -> (Option<State>, Reason) {
    const DAY_US: f64 = 86_400e6;
    let Some(last) = flights.iter().rev().find(|f| f.gap.is_some()) else {
        return (None, Reason::NoEstimate);
    };
    let days = (as_of_us - last.departure_us) as f64 / DAY_US;
    if days > settings.stale_after_days {
        return (None, Reason::Stale { days });
    }
    let (Some(Level { gap_m, .. }), Some(crossing)) = (level, crossing) else {
        return (None, Reason::TooFew { estimates });
    };
    let Settings { limit_m, watch_m, planning_horizon_hours, .. } = *settings;
    if gap_m >= limit_m {
        return (Some(State::Act), Reason::AtLimit { gap_m, limit_m });
    }
    if let Some(p05_hours) = crossing.p05_hours.filter(|h| *h <= planning_horizon_hours) {
        return (Some(State::Plan), Reason::CrossesSoon { p05_hours, planning_horizon_hours });
    }
    if gap_m >= watch_m {
        return (Some(State::Watch), Reason::AtWatch { gap_m, watch_m });
    }
    (Some(State::Normal), Reason::Clear)
}
