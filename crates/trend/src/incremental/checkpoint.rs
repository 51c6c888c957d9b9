//! Checkpoint: the result of a unit's flights up to a count, sufficient for later assessments.
//!
//! Checkpoints follow from the count of flights, so an incremental snapshot and a computation
//! from the whole history use the same flights.

use crate::data::outliers::{NoiseScale, WeightedGap};
use crate::data::segment::Segment;
use crate::data::series::DAY_US;
use crate::data::series::{Flight, MaintenanceEvent};
use crate::data::steps;
use crate::inference::consistency::{self, ConsistentPosterior, Inconsistency, fit_consistent};
use crate::inference::mixture::Mixture;
use crate::inference::posterior::Posterior;
use crate::prior::fleet_prior::FleetPrior;
use crate::statement::history::{self, History};
use crate::statement::level;
use crate::statement::types::{ChangePoint, ChangePointKind};

/// Flights of the shortest history that is assessed from a checkpoint.
const SHORTEST: usize = 64;

/// Checkpoints are at multiples of the largest power of two in this share of the history, within
/// bounds. With twice the share, laws with two knees are found too late: 90 % intervals held 1 to 2 % less.
const SHARE: usize = 32;
const SHORTEST_STRIDE: usize = 4;
const LONGEST_STRIDE: usize = 64;

/// Flights of the present installation below which it is young, and the last ones that show the use.
const YOUNG: usize = 20;
const LAST: usize = 300;

/// Number of last days that give the utilisation.
pub(crate) const UTILIZATION_DAYS: i64 = 90;

/// Number of days of which one flight is kept for the utilisation.
const MARK_DAYS: i64 = 5;

/// Flights up to the last checkpoint of a history with `flights` flights.
pub(crate) fn before(flights: usize) -> usize {
    if flights < SHORTEST {
        return flights;
    }
    let stride = (1 << (flights / SHARE).ilog2()).clamp(SHORTEST_STRIDE, LONGEST_STRIDE);
    flights / stride * stride
}

/// Result of the flights until a checkpoint.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Checkpoint {
    pub(crate) flights: usize,
    pub(crate) estimates: usize,
    /// Its last flight, and the departure of the last one with a gap.
    pub(crate) last: Option<Flight>,
    pub(crate) last_gap_us: Option<i64>,
    /// The changes until then, but for an onset in the last segment.
    pub(crate) changes: Vec<ChangePoint>,
    pub(crate) outliers_us: Vec<i64>,
    pub(crate) scatter: NoiseScale,
    /// Variance that undone offsets leave in the level and that of what the steps were, m², and what has been
    /// taken off the gaps, metres.
    pub(crate) offset_m2: f64,
    pub(crate) kind_m2: f64,
    pub(crate) undone_m: f64,
    /// Estimates of the last segment.
    pub(crate) in_segment: usize,
    /// The last estimates since the last step, by hours, in single precision.
    pub(crate) near: Vec<StepWindowEntry>,
    /// The last few estimates of the segment, by usage.
    pub(crate) recent: Vec<WeightedGap>,
    pub(crate) fitted: SegmentPosterior,
    /// The starts of the mixture's onsets, and the first flight after each.
    pub(crate) onsets: Vec<(f64, i64)>,
    /// The first flight of the pace's days, and the first one of every few days among them.
    pub(crate) days: Vec<UsageSample>,
    pub(crate) used: RecentUsage,
}

/// An estimate as the search for steps needs it: its offset undone, metres and m⁻².
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct StepWindowEntry {
    pub(crate) hours: f32,
    pub(crate) gap_m: f32,
    pub(crate) weight: f32,
}

/// A flight as the pace needs it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct UsageSample {
    pub(crate) departure_us: i64,
    pub(crate) hours: f64,
    pub(crate) flights: f64,
}

impl UsageSample {
    pub(crate) fn of(flight: &Flight) -> Self {
        let Flight { departure_us, hours, flights, .. } = *flight;
        Self { departure_us, hours, flights }
    }
}

/// How the unit was used of late: flights of its present installation, and hours and usage where the last
/// flights began, and where those of the installation did.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct RecentUsage {
    pub(crate) here: usize,
    pub(crate) last: (f64, f64),
    pub(crate) since_here: (f64, f64),
}

/// Posterior of the last segment at its end.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum SegmentPosterior {
    /// Nothing: it has no estimate, or no usage.
    Nothing,
    /// Nothing that its last estimates support.
    Unsupported {
        level_m: f64,
        recent_m: f64,
    },
    By(Mixture),
}

/// Flights, and recorded maintenance.
#[derive(Debug, Clone, Copy)]
pub(crate) struct HistoryView<'a> {
    pub(crate) flights: &'a [Flight],
    pub(crate) maintenance: &'a [MaintenanceEvent],
    pub(crate) unit_hours_at_start: Option<f64>,
}

impl HistoryView<'_> {
    /// The view after the given number of flights.
    pub(crate) fn first(&self, flights: usize) -> Self {
        let flights = &self.flights[..flights];
        let maintenance =
            flights.last().map_or(&[][..], |last| events_until(self.maintenance, last.departure_us));
        Self { flights, maintenance, ..*self }
    }
}

/// Entries of an ordered maintenance log up to a departure.
pub(crate) fn events_until(maintenance: &[MaintenanceEvent], departure_us: i64) -> &[MaintenanceEvent] {
    &maintenance[..maintenance.partition_point(|entry| entry.utc_us <= departure_us)]
}

impl Checkpoint {
    /// Reads the flights; nothing is assessed yet.
    pub(crate) fn read(known: &HistoryView<'_>, prior: &FleetPrior) -> (Self, History) {
        let HistoryView { flights, maintenance, unit_hours_at_start } = *known;
        let history = history::read_history(flights, maintenance, unit_hours_at_start, prior);
        let in_segment = history.segments().last().map_or(0, |segment| segment.estimates.len());
        let at = history.estimates.len() - in_segment;
        let checkpoint = Self {
            flights: flights.len(),
            estimates: history.estimates.len(),
            last: flights.last().map(|flight| Flight { gap: None, ..*flight }),
            last_gap_us: flights.iter().rev().find(|f| f.gap.is_some()).map(|f| f.departure_us),
            changes: history.changes.clone(),
            outliers_us: history.outliers.iter().map(|&flight| flights[flight].departure_us).collect(),
            scatter: history.scatter.clone(),
            offset_m2: history.offset_m2,
            kind_m2: history.kind_m2,
            undone_m: history.undone_m,
            in_segment,
            near: step_window(&history, flights),
            recent: consistency::recent_estimates(&history.estimates[at..]).to_vec(),
            fitted: SegmentPosterior::Nothing,
            onsets: Vec::new(),
            days: days(flights),
            used: RecentUsage::of(flights, prior),
        };
        (checkpoint, history)
    }

    /// Judges what was read.
    pub(crate) fn fit_segments(&mut self, history: &History, flights: &[Flight], prior: &FleetPrior) {
        let single_unit = prior.single_unit();
        let mut fitted = Err(Inconsistency::Empty);
        for segment in history.segments() {
            // The segment before has ended: its onset is settled.
            let ended: Option<&ConsistentPosterior> = fitted.as_ref().ok();
            self.changes.extend(ended.and_then(|ended| self.onset(&ended.posterior)));
            fitted = fit_consistent(&segment, prior, &single_unit, history.offset_m2);
            let starts = fitted.as_ref().map(|fitted| starts(&fitted.posterior)).unwrap_or_default();
            let place = |start| Some((start, departure_after(start, &segment, flights, prior)?));
            self.onsets = starts.into_iter().filter_map(place).collect();
            self.fitted = SegmentPosterior::of(&fitted, segment.now - segment.begin);
        }
    }

    /// The onset of wear that a mixture found in the last segment, as a change point.
    pub(crate) fn onset(&self, posterior: &Posterior) -> Option<ChangePoint> {
        let (start, certainty) = level::onset(posterior)?;
        let (_, departure_us) = *self.onsets.iter().find(|(known, _)| *known >= start)?;
        Some(ChangePoint { departure_us, kind: ChangePointKind::Onset, step_m: 0.0, se_m: 0.0, certainty })
    }
}

impl SegmentPosterior {
    fn of(fitted: &Result<ConsistentPosterior, Inconsistency>, span: f64) -> Self {
        match fitted {
            Ok(ConsistentPosterior { posterior, is_single_unit, .. }) => {
                Self::By(Mixture::of(posterior, span, *is_single_unit))
            }
            Err(Inconsistency::Empty) => Self::Nothing,
            Err(Inconsistency::Unsupported { level_m, recent_m }) => {
                Self::Unsupported { level_m: *level_m, recent_m: *recent_m }
            }
        }
    }
}

/// The starts of a mixture's onsets, each once.
fn starts(posterior: &Posterior) -> Vec<f64> {
    let mut starts: Vec<f64> = posterior.components.iter().filter_map(level::onset_usage).collect();
    starts.sort_unstable_by(f64::total_cmp);
    starts.dedup();
    starts
}

/// The first departure after some usage of a segment.
fn departure_after(start: f64, segment: &Segment<'_>, flights: &[Flight], prior: &FleetPrior) -> Option<i64> {
    let first = flights.partition_point(|flight| prior.usage(flight) < segment.begin + start);
    Some(flights.get(first)?.departure_us)
}

/// As many of the last estimates as a later step can depend on.
fn step_window(history: &History, flights: &[Flight]) -> Vec<StepWindowEntry> {
    let estimates = &history.estimates;
    let from = history.last_step.max(estimates.len().saturating_sub(2 * steps::FARTHEST));
    let near = |e: &WeightedGap| StepWindowEntry {
        hours: flights[e.flight].hours as f32,
        gap_m: e.gap_m as f32,
        weight: e.weight as f32,
    };
    estimates[from..].iter().map(near).collect()
}

/// The first flight of the pace's days, and the first one of every few days among them.
fn days(flights: &[Flight]) -> Vec<UsageSample> {
    let Some(last) = flights.last() else { return Vec::new() };
    let flights = &flights[flights
        .partition_point(|f| last.departure_us.saturating_sub(f.departure_us) > UTILIZATION_DAYS * DAY_US)..];
    let days = |flight: &Flight| flight.departure_us.div_euclid(MARK_DAYS * DAY_US);
    flights.chunk_by(|a, b| days(a) == days(b)).map(|of_days| UsageSample::of(&of_days[0])).collect()
}

impl RecentUsage {
    fn of(flights: &[Flight], prior: &FleetPrior) -> Self {
        let Some(last) = flights.last() else { return Self::default() };
        let here = flights.iter().rev().take_while(|f| f.installation == last.installation).count();
        let mark = |back: usize| {
            let flight = &flights[flights.len().saturating_sub(back)];
            (flight.hours, prior.usage(flight))
        };
        Self { here, last: mark(LAST), since_here: mark(here.min(LAST)) }
    }

    /// Flight hours per hour's worth of usage where the unit flies after a tail: over its present
    /// installation, or over its last flights while that is young.
    pub(crate) fn hours_per_usage(
        &self,
        last: &Flight,
        tail: &[Flight],
        moved: bool,
        prior: &FleetPrior,
    ) -> f64 {
        let here = tail.iter().rev().take_while(|f| f.installation == last.installation).count();
        let (hours, usage) = if moved && here >= YOUNG {
            let first = &tail[tail.len() - here];
            (first.hours, prior.usage(first))
        } else if !moved && self.here + here >= YOUNG {
            self.since_here
        } else {
            self.last
        };
        let ratio = (last.hours - hours) / (prior.usage(last) - usage);
        if ratio.is_finite() && ratio > 0.0 { ratio } else { 1.0 }
    }
}
