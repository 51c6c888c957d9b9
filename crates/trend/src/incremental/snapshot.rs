//! Assessment of a unit from its last checkpoint and the flights after it.

use crate::data::series::DAY_US;
use crate::data::series::{Flight, MaintenanceEvent, Series};
use crate::incremental::checkpoint::{
    self, Checkpoint, HistoryView, SegmentPosterior, UTILIZATION_DAYS, UsageSample, events_until,
};
use crate::incremental::tail::Tail;
use crate::inference::posterior::Posterior;
use crate::prior::fleet_prior::FleetPrior;
use crate::settings::Settings;
use crate::statement::assessment::{Assessment, INTERVAL_HOURS};
use crate::statement::crossing::RulDistribution;
use crate::statement::level;
use crate::statement::state::{Evidence, State, alert_state};
use crate::statement::types::{ChangePoint, ChangePointKind, MIN_ESTIMATES, Utilization, WearStatus};

/// Assessed state of a unit: the result of its flights until a checkpoint, and the flights after it.
///
/// An assessment uses both: the checkpoint's mixture, updated by the few estimates that
/// follow. Where those do not follow the forecast (a step, an outlier that was none, a large
/// deviation), the assessment uses the whole history. Checkpoints follow from the count of flights alone, so
/// assessments at the dates of earlier flights share a checkpoint.
#[derive(Debug, Clone)]
pub(crate) struct UnitSnapshot {
    checkpoint: Checkpoint,
    /// The flights after it.
    tail: Vec<Flight>,
    unit_hours_at_start: Option<f64>,
}

/// Current posterior of the last segment, or the unsupported level and that of the last estimates.
pub(crate) struct CurrentFit {
    tail: Tail,
    fitted: Result<(Posterior, bool), Option<(f64, f64)>>,
}

impl UnitSnapshot {
    /// Computes the state of a unit at a date and its current fit, with a prior learned from earlier data.
    pub(crate) fn current(series: &Series, as_of_us: i64, prior: &FleetPrior) -> (Self, CurrentFit) {
        let flights = series.flights_until(as_of_us);
        let known = HistoryView {
            flights,
            maintenance: series.maintenance_until(as_of_us),
            unit_hours_at_start: series.unit_hours_at_start(),
        };
        let snapshot = |checkpoint: Checkpoint| Self {
            tail: flights[checkpoint.flights..].to_vec(),
            checkpoint,
            unit_hours_at_start: series.unit_hours_at_start(),
        };
        let count = checkpoint::before(flights.len());
        if count < flights.len()
            && let Some((checkpoint, current)) = fit_from_checkpoint(&known, count, prior)
        {
            return (snapshot(checkpoint), current);
        }
        let (mut checkpoint, history) = Checkpoint::read(&known.first(flights.len()), prior);
        checkpoint.fit_segments(&history, flights, prior);
        let current = CurrentFit::at(&checkpoint, prior);
        (snapshot(checkpoint), current)
    }

    /// The state at an earlier date since the checkpoint; nothing for a date before it.
    pub(crate) fn truncate(&self, as_of_us: i64) -> Option<Self> {
        let flown = self.tail.partition_point(|flight| flight.departure_us <= as_of_us);
        let is_later = self.checkpoint.last.is_some_and(|last| last.departure_us <= as_of_us);
        let count = self.checkpoint.flights + flown;
        (is_later && checkpoint::before(count) == self.checkpoint.flights)
            .then(|| Self { tail: self.tail[..flown].to_vec(), ..self.clone() })
    }

    /// Current fit of a truncated state; nothing where the last flights do not follow the forecast, so that the
    /// history is needed.
    pub(crate) fn fit(&self, prior: &FleetPrior) -> Option<CurrentFit> {
        if self.tail.is_empty() {
            return Some(CurrentFit::at(&self.checkpoint, prior));
        }
        let tail = Tail::read(&self.checkpoint, &self.tail, prior)?;
        CurrentFit::after(&self.checkpoint, tail, &self.tail, prior)
    }

    /// Assessment from the current fit; the maintenance is sorted, and ends on the date.
    pub(crate) fn statement(
        &self,
        current: CurrentFit,
        as_of_us: i64,
        maintenance: &[MaintenanceEvent],
        settings: &Settings,
        prior: &FleetPrior,
        previous: Option<State>,
    ) -> Assessment {
        let CurrentFit { tail, fitted } = current;
        let estimates = self.checkpoint.estimates + tail.len();
        let offset_m2 = self.checkpoint.offset_m2 + self.checkpoint.kind_m2;
        let single_unit = prior.single_unit();
        let unsupported = fitted.as_ref().err().copied().flatten();
        let changes = self.changes(maintenance, fitted.as_ref().ok().map(|(posterior, _)| posterior));
        let fitted = fitted.ok().filter(|_| estimates >= MIN_ESTIMATES);
        let prior = if fitted.as_ref().is_some_and(|(_, is_single_unit)| *is_single_unit) {
            &single_unit
        } else {
            prior
        };
        let fitted = fitted.map(|(posterior, _)| posterior);
        let growth_probability = fitted.as_ref().map(|p| level::growth_probability(p, prior.limit_m()));
        let wear = wear_status(growth_probability);
        let ratio = self.hours_per_usage(prior);
        let remaining = fitted.as_ref().map(|p| RulDistribution::new(p, prior, settings, ratio, offset_m2));
        let level = fitted.as_ref().map(|p| level::level(p, prior, offset_m2));
        let crossing = remaining.as_ref().map(RulDistribution::crossing);
        let last_gap_us = self.last_gap_us();
        let evidence =
            Evidence { last_gap_us, estimates, as_of_us, level, crossing, changes: &changes, unsupported };
        let (state, reason) = alert_state(&evidence, settings, previous);
        Assessment {
            as_of_us,
            flights: self.checkpoint.flights + self.tail.len(),
            estimates,
            unit_hours: self.unit_hours_at_start.zip(self.last()).map(|(start, last)| start + last.hours),
            level,
            rate: fitted.as_ref().map(|p| level::rate(p, ratio)),
            wear,
            growth_probability,
            law: fitted.as_ref().and_then(|p| level::law(p, wear == WearStatus::Wearing)),
            changes,
            crossing,
            check_probability: remaining.as_ref().map(|r| r.within(settings.check_interval_hours)),
            interval_chances: remaining.as_ref().map(|r| INTERVAL_HOURS.map(|hours| r.chance_by(hours))),
            utilization: self.utilization(),
            outliers_us: [&self.checkpoint.outliers_us[..], &tail.outliers_us[..]].concat(),
            noise_factor: self.checkpoint.scatter.noise_factor,
            stale_days: last_gap_us
                .map(|last_us| as_of_us.saturating_sub(last_us) as f64 / DAY_US as f64)
                .filter(|days| *days > settings.stale_after_days),
            state,
            reason,
        }
    }

    /// Every change, by departure.
    fn changes(&self, maintenance: &[MaintenanceEvent], fitted: Option<&Posterior>) -> Vec<ChangePoint> {
        let mut changes = self.checkpoint.changes.clone();
        changes.extend(self.recorded(maintenance));
        changes.extend(fitted.and_then(|posterior| self.checkpoint.onset(posterior)));
        changes.sort_by_key(|change| change.departure_us);
        changes
    }

    /// Maintenance entries after the checkpoint where the gap shows no step, at the first flight after each.
    fn recorded(&self, maintenance: &[MaintenanceEvent]) -> impl Iterator<Item = ChangePoint> {
        let known = self.checkpoint.last.map_or(0, |last| events_until(maintenance, last.departure_us).len());
        maintenance[known..].iter().filter_map(|entry| {
            let first = self.tail.iter().find(|flight| flight.departure_us >= entry.utc_us)?;
            let departure_us = first.departure_us;
            Some(ChangePoint {
                departure_us,
                kind: ChangePointKind::Recorded,
                step_m: 0.0,
                se_m: 0.0,
                certainty: 1.0,
            })
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
    fn utilization(&self) -> Option<Utilization> {
        let last = UsageSample::of(self.last()?);
        let marks = self.checkpoint.days.iter().copied().chain(self.tail.iter().map(UsageSample::of));
        let days =
            |mark: &UsageSample| last.departure_us.saturating_sub(mark.departure_us) as f64 / DAY_US as f64;
        let first = marks.into_iter().find(|mark| days(mark) <= UTILIZATION_DAYS as f64)?;
        let (hours, days) = (last.hours - first.hours, days(&first));
        let flights = last.flights - first.flights;
        (hours > 0.0 && days > 0.0).then(|| Utilization {
            hours_per_day: hours / days,
            hours_per_day_se: hours / days / flights.max(1.0).sqrt(),
            flights_per_day: flights / days,
            hours_per_flight: hours / flights,
        })
    }
}

/// The checkpoint at a count of flights and the fit after the remaining flights; nothing where those
/// do not follow the forecast.
fn fit_from_checkpoint(
    known: &HistoryView<'_>,
    count: usize,
    prior: &FleetPrior,
) -> Option<(Checkpoint, CurrentFit)> {
    let (before, append) = known.flights.split_at(count);
    let (mut checkpoint, history) = Checkpoint::read(&known.first(count), prior);
    let tail = Tail::read(&checkpoint, append, prior)?;
    checkpoint.fit_segments(&history, before, prior);
    let current = CurrentFit::after(&checkpoint, tail, append, prior)?;
    Some((checkpoint, current))
}

impl CurrentFit {
    /// At a checkpoint.
    fn at(checkpoint: &Checkpoint, prior: &FleetPrior) -> Self {
        let fitted = match &checkpoint.fitted {
            SegmentPosterior::Nothing => Err(None),
            SegmentPosterior::Unsupported { level_m, recent_m } => Err(Some((*level_m, *recent_m))),
            SegmentPosterior::By(mixture) => Ok((mixture.posterior(prior), mixture.is_single_unit)),
        };
        Self { tail: Tail::default(), fitted }
    }

    /// Posterior of the last segment, and whether it uses the single-unit prior.
    pub(crate) fn fitted(&self) -> Option<(&Posterior, bool)> {
        self.fitted.as_ref().ok().map(|(posterior, is_single_unit)| (posterior, *is_single_unit))
    }

    /// After some flights more.
    fn after(checkpoint: &Checkpoint, tail: Tail, flights: &[Flight], prior: &FleetPrior) -> Option<Self> {
        let SegmentPosterior::By(mixture) = &checkpoint.fitted else { return None };
        let single_unit = prior.single_unit();
        let prior = if mixture.is_single_unit { &single_unit } else { prior };
        let fitted = tail.follow(checkpoint, mixture, flights, prior)?;
        Some(Self { tail, fitted: Ok((fitted, mixture.is_single_unit)) })
    }
}

/// Between one half and 95 % neither growth nor its absence is reported.
fn wear_status(growth_probability: Option<f64>) -> WearStatus {
    match growth_probability {
        Some(probability) if probability > 0.95 => WearStatus::Wearing,
        Some(probability) if probability < 0.5 => WearStatus::Steady,
        _ => WearStatus::Unknown,
    }
}
