//! What is kept of a unit from night to night, so that a flight more does not ask for all those before.

use crate::checkpoint::{self, Checkpoint, DAY_US, Judged, Known, Mark, PACE_DAYS, digest_of, entries_until};
use crate::crossing::Remaining;
use crate::error::Error;
use crate::level;
use crate::posterior::Posterior;
use crate::prior::FleetPrior;
use crate::series::{Booked, Flight, Meter, Observation, Series, in_order};
use crate::settings::Settings;
use crate::state::{Evidence, State, judge};
use crate::tail::Tail;
use crate::trend::{Change, ChangeKind, FEWEST_ESTIMATES, Pace, Trend, Wear};

/// A unit's flights until a checkpoint as they were judged, and those after it as they were flown.
///
/// A statement stands on both: the checkpoint's curves, weighed and moved on by the few estimates that
/// follow. Where those do not go on as was foretold (a step shows, an outlier was none, they lie too far
/// off) it stands on the whole history. Checkpoints follow from the count of flights alone, and
/// [`trend()`](crate::trend()) makes its statements in this way too: what is said from a state that was kept
/// is what is said from nothing, bit for bit, whatever the nights and the order of arrival.
#[derive(Debug, Clone, PartialEq)]
pub struct Kept {
    pub(crate) checkpoint: Checkpoint,
    /// The flights after it.
    pub(crate) tail: Vec<Flight>,
    /// The usage after the last flight; nothing where later flights were known when it was made.
    pub(crate) meter: Option<Meter>,
    pub(crate) unit_hours_at_start: Option<f64>,
    /// Of the prior it was judged by.
    pub(crate) prior: u64,
}

/// What the last segment says now, or the level that was not stated and what the last estimates say.
pub(crate) struct Standing {
    tail: Tail,
    judged: Result<(Posterior, bool), Option<(f64, f64)>>,
}

impl Kept {
    /// Judges a unit's flights until a day, by a prior learned from nothing later.
    ///
    /// For what [`trend()`](crate::trend()) says without a prior it is [`FleetPrior::vague`] of the limit.
    pub fn of(series: &Series, as_of_us: i64, prior: &FleetPrior) -> Self {
        Self::standing(series, as_of_us, prior).0
    }

    /// The same, and where the unit stands.
    pub(crate) fn standing(series: &Series, as_of_us: i64, prior: &FleetPrior) -> (Self, Standing) {
        let flights = series.until(as_of_us);
        let known = Known {
            flights,
            book: series.book_until(as_of_us),
            unit_hours_at_start: series.unit_hours_at_start(),
        };
        let kept = |checkpoint: Checkpoint| Self {
            tail: flights[checkpoint.flights..].to_vec(),
            checkpoint,
            meter: (flights.len() == series.flights().len()).then(|| series.meter()),
            unit_hours_at_start: series.unit_hours_at_start(),
            prior: prior.digest(),
        };
        let count = checkpoint::before(flights.len());
        if count < flights.len()
            && let Some((checkpoint, standing)) = stand(&known, count, prior)
        {
            return (kept(checkpoint), standing);
        }
        let (mut checkpoint, history) = Checkpoint::read(&known.first(flights.len()), prior);
        checkpoint.judge(&history, flights, prior);
        let standing = Standing::at(&checkpoint, prior);
        (kept(checkpoint), standing)
    }

    /// The same with flights that were made since, in any order; nothing where the history is needed: a
    /// flight is not later than all before, a checkpoint has been passed, or the state was made of a day
    /// before the last flight that was known.
    ///
    /// # Errors
    /// [`Error::Observation`] as [`Series::new`].
    pub fn after(&self, rows: impl IntoIterator<Item = Observation>) -> Result<Option<Self>, Error> {
        let rows = in_order(rows)?;
        let order = |departure_us: i64, installation: u32| (departure_us, installation);
        let last = self.last().map(|flight| order(flight.departure_us, flight.installation));
        let is_late = rows.first().is_some_and(|row| Some(order(row.departure_us, row.installation)) <= last);
        let count = self.checkpoint.flights + self.tail.len() + rows.len();
        let Some(mut meter) = self.meter.filter(|_| !is_late) else { return Ok(None) };
        if !rows.is_empty() && checkpoint::before(count) != self.checkpoint.flights {
            return Ok(None);
        }
        let mut tail = self.tail.clone();
        tail.extend(rows.iter().map(|row| meter.fly(row)));
        Ok(Some(Self { tail, meter: Some(meter), ..self.clone() }))
    }

    /// What was kept on an earlier day since the checkpoint; nothing for one before it.
    pub(crate) fn until(&self, as_of_us: i64) -> Option<Self> {
        let flown = self.tail.partition_point(|flight| flight.departure_us <= as_of_us);
        let is_later = self.checkpoint.last.is_some_and(|last| last.departure_us <= as_of_us);
        let count = self.checkpoint.flights + flown;
        (is_later && checkpoint::before(count) == self.checkpoint.flights).then(|| Self {
            tail: self.tail[..flown].to_vec(),
            meter: None,
            ..self.clone()
        })
    }

    /// States what is known of the unit on a day, as [`trend()`](crate::trend()) does from its whole history.
    ///
    /// `book` is all that the maintenance book says of the unit, in any order. Nothing where the history is
    /// needed: the last flights do not go on as was foretold, the day is before the last of them, or prior
    /// or book are not those that the state was made with.
    ///
    /// # Errors
    /// As [`trend()`](crate::trend()).
    pub fn says(
        &self,
        as_of_us: i64,
        book: &[Booked],
        settings: &Settings,
        prior: &FleetPrior,
        previous: Option<State>,
    ) -> Result<Option<Trend>, Error> {
        settings.check()?;
        let mut book = book.to_vec();
        book.sort_unstable_by_key(Booked::order);
        let book = entries_until(&book, as_of_us);
        let is_later = self.last().is_none_or(|last| last.departure_us <= as_of_us);
        let read = self.checkpoint.last.map_or(&[][..], |last| entries_until(book, last.departure_us));
        if !is_later || self.prior != prior.digest() || self.checkpoint.book != digest_of(read) {
            return Ok(None);
        }
        let standing = if self.tail.is_empty() {
            Some(Standing::at(&self.checkpoint, prior))
        } else {
            Tail::read(&self.checkpoint, &self.tail, prior)
                .and_then(|tail| Standing::after(&self.checkpoint, tail, &self.tail, prior))
        };
        Ok(standing.map(|standing| self.statement(standing, as_of_us, book, settings, prior, previous)))
    }

    /// What is said of where the unit stands; the book is ordered, and ends on the day.
    pub(crate) fn statement(
        &self,
        standing: Standing,
        as_of_us: i64,
        book: &[Booked],
        settings: &Settings,
        prior: &FleetPrior,
        previous: Option<State>,
    ) -> Trend {
        let Standing { tail, judged } = standing;
        let estimates = self.checkpoint.estimates + tail.len();
        let offset_m2 = self.checkpoint.offset_m2;
        let alone = prior.alone();
        let unsupported = judged.as_ref().err().copied().flatten();
        let changes = self.changes(book, judged.as_ref().ok().map(|(posterior, _)| posterior));
        let judged = judged.ok().filter(|_| estimates >= FEWEST_ESTIMATES);
        let prior = if judged.as_ref().is_some_and(|(_, is_alone)| *is_alone) { &alone } else { prior };
        let judged = judged.map(|(posterior, _)| posterior);
        let growth_probability = judged.as_ref().map(level::growth_probability);
        let ratio = self.hours_per_usage(prior);
        let remaining = judged.as_ref().map(|p| Remaining::new(p, prior, settings, ratio, offset_m2));
        let level = judged.as_ref().map(|p| level::level(p, prior, offset_m2));
        let crossing = remaining.as_ref().map(Remaining::crossing);
        let last_gap_us = self.last_gap_us();
        let evidence =
            Evidence { last_gap_us, estimates, as_of_us, level, crossing, changes: &changes, unsupported };
        let (state, reason) = judge(&evidence, settings, previous);
        Trend {
            as_of_us,
            flights: self.checkpoint.flights + self.tail.len(),
            estimates,
            unit_hours: self.unit_hours_at_start.zip(self.last()).map(|(start, last)| start + last.hours),
            level,
            rate: judged.as_ref().map(|p| level::rate(p, ratio)),
            wear: wear(growth_probability),
            growth_probability,
            law: judged.as_ref().and_then(level::law),
            changes,
            crossing,
            check_probability: remaining.as_ref().map(|r| r.within(settings.check_interval_hours)),
            pace: self.pace(),
            outliers_us: [&self.checkpoint.outliers_us[..], &tail.outliers_us[..]].concat(),
            noise_factor: self.checkpoint.scatter.noise_factor,
            state,
            reason,
        }
    }

    /// Every change, by departure.
    fn changes(&self, book: &[Booked], judged: Option<&Posterior>) -> Vec<Change> {
        let mut changes = self.checkpoint.changes.clone();
        changes.extend(self.recorded(book));
        changes.extend(judged.and_then(|posterior| self.checkpoint.onset(posterior)));
        changes.sort_by_key(|change| change.departure_us);
        changes
    }

    /// Entries of the book in the tail, where the gap shows no step, at the first flight after each.
    fn recorded(&self, book: &[Booked]) -> impl Iterator<Item = Change> {
        let known = self.checkpoint.last.map_or(0, |last| entries_until(book, last.departure_us).len());
        book[known..].iter().filter_map(|entry| {
            let first = self.tail.iter().find(|flight| flight.departure_us >= entry.utc_us)?;
            let departure_us = first.departure_us;
            Some(Change { departure_us, kind: ChangeKind::Recorded, step_m: 0.0, se_m: 0.0, certainty: 1.0 })
        })
    }

    fn last(&self) -> Option<&Flight> {
        self.tail.last().or(self.checkpoint.last.as_ref())
    }

    /// Departure of the last flight with a gap.
    pub(crate) fn last_gap_us(&self) -> Option<i64> {
        let seen = self.tail.iter().rev().find(|flight| flight.gap.is_some());
        seen.map(|flight| flight.departure_us).or(self.checkpoint.last_gap_us)
    }

    /// Flight hours per hour's worth of usage where the unit flies now.
    pub(crate) fn hours_per_usage(&self, prior: &FleetPrior) -> f64 {
        let (Some(before), Some(last)) = (&self.checkpoint.last, self.last()) else { return 1.0 };
        let moved = before.installation != last.installation;
        self.checkpoint.used.hours_per_usage(last, &self.tail, moved, prior)
    }

    /// The pace of the last ninety days of flights; nothing when they show no hours.
    fn pace(&self) -> Option<Pace> {
        let last = Mark::of(self.last()?);
        let marks = self.checkpoint.days.iter().copied().chain(self.tail.iter().map(Mark::of));
        let days = |mark: &Mark| (last.departure_us - mark.departure_us) as f64 / DAY_US as f64;
        let first = marks.into_iter().find(|mark| days(mark) <= PACE_DAYS as f64)?;
        let (hours, days) = (last.hours - first.hours, days(&first));
        (hours > 0.0 && days > 0.0).then(|| Pace {
            hours_per_day: hours / days,
            hours_per_flight: hours / (last.flights - first.flights),
        })
    }
}

/// The checkpoint at a count of flights and where the unit stands after the rest; nothing where the rest
/// does not go on as was foretold.
fn stand(known: &Known<'_>, count: usize, prior: &FleetPrior) -> Option<(Checkpoint, Standing)> {
    let (before, after) = known.flights.split_at(count);
    let (mut checkpoint, history) = Checkpoint::read(&known.first(count), prior);
    let tail = Tail::read(&checkpoint, after, prior)?;
    checkpoint.judge(&history, before, prior);
    let standing = Standing::after(&checkpoint, tail, after, prior)?;
    Some((checkpoint, standing))
}

impl Standing {
    /// At a checkpoint.
    fn at(checkpoint: &Checkpoint, prior: &FleetPrior) -> Self {
        let judged = match &checkpoint.judged {
            Judged::Nothing => Err(None),
            Judged::Unsupported { level_m, recent_m } => Err(Some((*level_m, *recent_m))),
            Judged::By(mixture) => Ok((mixture.posterior(prior), mixture.is_alone)),
        };
        Self { tail: Tail::default(), judged }
    }

    /// What the last segment says, and whether without the fleet.
    pub(crate) fn judged(&self) -> Option<(&Posterior, bool)> {
        self.judged.as_ref().ok().map(|(posterior, is_alone)| (posterior, *is_alone))
    }

    /// After some flights more.
    fn after(checkpoint: &Checkpoint, tail: Tail, flights: &[Flight], prior: &FleetPrior) -> Option<Self> {
        let Judged::By(mixture) = &checkpoint.judged else { return None };
        let alone = prior.alone();
        let prior = if mixture.is_alone { &alone } else { prior };
        let judged = tail.follow(checkpoint, mixture, flights, prior)?;
        Some(Self { tail, judged: Ok((judged, mixture.is_alone)) })
    }
}

fn wear(growth_probability: Option<f64>) -> Wear {
    match growth_probability {
        Some(probability) if probability > 0.95 => Wear::Wearing,
        Some(_) => Wear::Steady,
        None => Wear::Unknown,
    }
}
