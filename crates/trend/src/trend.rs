//! The statement: what is known of one unit on one day.

use serde::{Deserialize, Serialize};

use std::fmt;

use crate::error::Error;
use crate::kept::Kept;
use crate::prior::FleetPrior;
use crate::series::Series;
use crate::settings::Settings;
use crate::state::{Reason, State};

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
    /// Probability that the gap has grown by 2 µm or more since it was new here, or reset.
    pub growth_probability: Option<f64>,
    /// The law most believed in, and how much.
    pub law: Option<(WearLaw, f64)>,
    /// Steps, resets and onsets, by departure.
    pub changes: Vec<Change>,
    /// When the act limit is met.
    pub crossing: Option<Crossing>,
    /// Probability that it is met before the next check ([`Settings::check_interval_hours`]).
    pub check_probability: Option<f64>,
    /// How the unit is used now, to turn hours into flights and days.
    pub pace: Option<Pace>,
    /// Flights whose gap was left out as an outlier, by departure.
    pub outliers_us: Vec<i64>,
    /// Variance found between flights over the variance stated.
    pub noise_factor: f64,
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

/// The unit's recent use: over its last ninety days of flights.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pace {
    /// Flight hours a day.
    pub hours_per_day: f64,
    /// Flight hours a flight.
    pub hours_per_flight: f64,
}

/// Forms of wear.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WearLaw {
    /// It does not wear.
    None,
    /// Flat, then a line.
    Onset,
    /// Ever more slowly.
    Slowing,
    /// As the usage.
    Linear,
    /// Ever faster.
    Accelerating,
}

impl fmt::Display for WearLaw {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::None => "none",
            Self::Onset => "onset",
            Self::Slowing => "slowing",
            Self::Linear => "linear",
            Self::Accelerating => "accelerating",
        })
    }
}

/// Whether a unit wears.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wear {
    /// It has grown by 2 µm or more with a probability above 95 %.
    Wearing,
    /// That much growth is not certain.
    Steady,
    /// Too little is known.
    Unknown,
}

/// A change that wear does not make.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Change {
    /// The first flight after it, microseconds since 1970 UTC.
    pub departure_us: i64,
    /// What it is.
    pub kind: ChangeKind,
    /// Its size, metres; zero for an onset.
    pub step_m: f64,
    /// Standard error of its size, metres; zero for an onset.
    pub se_m: f64,
    /// Probability that it is one: of a step that it has the sign it is said to have, of an onset that
    /// wear began at all, one where the books say so.
    pub certainty: f64,
}

/// Kinds of change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum ChangeKind {
    /// The measurement moved: re-rigging, another reference. The wear did not.
    Step,
    /// The gap fell to near a new unit's: re-shimmed, overhauled or replaced.
    Reset,
    /// Wear began, or sped up.
    Onset,
    /// In the books: an installation or a maintenance entry; without a step where the gap shows none.
    Recorded,
}

impl fmt::Display for ChangeKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Step => "step",
            Self::Reset => "reset",
            Self::Onset => "onset",
            Self::Recorded => "recorded",
        })
    }
}

/// States what is known of a unit on a day from its flights until then.
///
/// `prior` is what the part number's fleet teaches, learned from nothing later than the same day;
/// without one a unit is judged by itself alone. `previous` is the state it was given last time, which
/// it leaves only when it is clearly past the limit that caused it.
///
/// # Errors
/// [`Error::Setting`] or [`Error::LimitOrder`] for unusable settings.
pub fn trend(
    series: &Series,
    as_of_us: i64,
    settings: &Settings,
    prior: Option<&FleetPrior>,
    previous: Option<State>,
) -> Result<Trend, Error> {
    settings.check()?;
    let vague = FleetPrior::vague(settings.limit_m);
    let prior = prior.unwrap_or(&vague);
    let (kept, standing) = Kept::standing(series, as_of_us, prior);
    Ok(kept.statement(standing, as_of_us, series.book_until(as_of_us), settings, prior, previous))
}
