//! The statement: what is known of one unit on one day.

use std::fmt;

use crate::crossing::Remaining;
use crate::error::Error;
use crate::grounded::{Grounded, Groundless, grounded};
use crate::history::{self, History};
use crate::level;
use crate::posterior::{Posterior, Segment};
use crate::prior::FleetPrior;
use crate::series::{Flight, Series};
use crate::settings::Settings;
use crate::state::{Evidence, Reason, State, judge};

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
#[derive(Debug, Clone, Copy, PartialEq)]
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
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
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
    let flights = series.until(as_of_us);
    let history = history::read(flights, series.book_until(as_of_us), series.unit_hours_at_start(), prior);
    let alone = prior.alone();
    let (changes, judged) = follow(&history, flights, prior, &alone);
    let unsupported = match judged {
        Err(Groundless::Unsupported { level_m, recent_m }) => Some((level_m, recent_m)),
        _ => None,
    };
    let judged = judged.ok().filter(|_| history.estimates.len() >= FEWEST_ESTIMATES);
    let prior = judged.as_ref().map_or(prior, |judged| judged.prior);
    let judged = judged.map(|judged| judged.posterior);
    let growth_probability = judged.as_ref().map(level::growth_probability);
    let ratio = hours_per_usage(flights, prior);
    let remaining = judged.as_ref().map(|p| Remaining::new(p, prior, settings, ratio, history.offset_m2));
    let level = judged.as_ref().map(|p| level::level(p, prior, history.offset_m2));
    let crossing = remaining.as_ref().map(Remaining::crossing);
    let estimates = history.estimates.len();
    let evidence = Evidence { flights, estimates, as_of_us, level, crossing, changes: &changes, unsupported };
    let (state, reason) = judge(&evidence, settings, previous);
    Ok(Trend {
        as_of_us,
        flights: flights.len(),
        estimates,
        unit_hours: series.unit_hours_at_start().zip(flights.last()).map(|(start, last)| start + last.hours),
        level,
        rate: judged.as_ref().map(|p| level::rate(p, ratio)),
        wear: wear(growth_probability),
        growth_probability,
        law: judged.as_ref().and_then(level::law),
        changes,
        crossing,
        check_probability: remaining.as_ref().map(|r| r.within(settings.check_interval_hours)),
        pace: pace(flights),
        outliers_us: history.outliers.iter().map(|&flight| flights[flight].departure_us).collect(),
        noise_factor: history.noise_factor,
        state,
        reason,
    })
}

/// Changes found, onsets of every segment included, and what the last segment says.
fn follow<'a>(
    history: &History,
    flights: &[Flight],
    prior: &'a FleetPrior,
    alone: &'a FleetPrior,
) -> (Vec<Change>, Result<Grounded<'a>, Groundless>) {
    let mut changes = history.changes.clone();
    let mut judged = Err(Groundless::Empty);
    for segment in history.segments() {
        judged = grounded(&segment, prior, alone, history.offset_m2);
        let found = judged.as_ref().ok().and_then(|j| onset(&j.posterior, &segment, flights, prior));
        changes.extend(found);
    }
    changes.sort_by_key(|change| change.departure_us);
    (changes, judged)
}

/// The onset of wear in a segment as a change.
fn onset(
    posterior: &Posterior,
    segment: &Segment<'_>,
    flights: &[Flight],
    prior: &FleetPrior,
) -> Option<Change> {
    let (after, certainty) = level::onset(posterior)?;
    let start = segment.begin + after;
    let first = flights.partition_point(|flight| prior.usage(flight) < start);
    let departure_us = flights.get(first)?.departure_us;
    Some(Change { departure_us, kind: ChangeKind::Onset, step_m: 0.0, se_m: 0.0, certainty })
}

fn wear(growth_probability: Option<f64>) -> Wear {
    match growth_probability {
        Some(probability) if probability > 0.95 => Wear::Wearing,
        Some(_) => Wear::Steady,
        None => Wear::Unknown,
    }
}

/// Flight hours per hour's worth of usage where the unit flies now: over its present installation, or
/// over its last flights while that is young.
pub(crate) fn hours_per_usage(flights: &[Flight], prior: &FleetPrior) -> f64 {
    const YOUNG: usize = 20;
    const LAST: usize = 300;
    let Some(last) = flights.last() else { return 1.0 };
    let here = flights.iter().rev().take_while(|flight| flight.installation == last.installation).count();
    let count = if here < YOUNG { LAST } else { here.min(LAST) };
    let first = &flights[flights.len().saturating_sub(count)];
    let ratio = (last.hours - first.hours) / (prior.usage(last) - prior.usage(first));
    if ratio.is_finite() && ratio > 0.0 { ratio } else { 1.0 }
}

/// The pace of the last ninety days of flights; nothing when they show no hours.
fn pace(flights: &[Flight]) -> Option<Pace> {
    const DAY_US: f64 = 86_400e6;
    let last = flights.last()?;
    let from = flights.partition_point(|f| ((last.departure_us - f.departure_us) as f64) > 90.0 * DAY_US);
    let first = &flights[from];
    let (hours, days) = (last.hours - first.hours, (last.departure_us - first.departure_us) as f64 / DAY_US);
    (hours > 0.0 && days > 0.0).then(|| Pace {
        hours_per_day: hours / days,
        hours_per_flight: hours / (last.flights - first.flights),
    })
}
