//! A unit's history read: outliers out, offsets of the measurement undone, cut where it was reset.

use crate::data::bins::Segment;
use crate::data::outliers::{WeightedGap, mark_outliers};
use crate::data::series::{Flight, MaintenanceEvent};
use crate::data::steps::{StepChange, detect_steps};
use crate::math::distributions;
use crate::prior::fleet_prior::FleetPrior;
use crate::statement::types::{ChangePoint, ChangePointKind};

/// A step larger than this share of the limit is never a matter of rigging: a fall made the unit new, a rise is
/// damage.
const MAX_RIGGING_STEP: f64 = 0.15;

/// Flights from a change of installation within which a step is the books' own.
pub(crate) const RECORD_FLIGHTS: usize = 3;

/// What a unit's flights show, apart from wear.
#[derive(Debug, Clone)]
pub(crate) struct History {
    pub(crate) estimates: Vec<WeightedGap>,
    pub(crate) outliers: Vec<usize>,
    /// Variance found between flights over the variance stated.
    pub(crate) noise_factor: f64,
    pub(crate) changes: Vec<ChangePoint>,
    /// Variance that the sizes of undone offsets leave in the level, m².
    pub(crate) offset_m2: f64,
    begins: Vec<SegmentStart>,
    /// What has been taken off the last estimates, metres. The forecast adds a rise again: only the law is without it.
    pub(crate) undone_m: f64,
    now: f64,
    known_age: Option<f64>,
}

/// Where a segment begins.
#[derive(Debug, Clone, Copy)]
struct SegmentStart {
    estimate: usize,
    usage: f64,
    /// As good as new.
    fresh: bool,
}

/// Reads the flights along the axis that wear follows.
pub(crate) fn read_history(
    flights: &[Flight],
    maintenance: &[MaintenanceEvent],
    known_age: Option<f64>,
    prior: &FleetPrior,
) -> History {
    let (estimates, outliers, noise_factor) = mark_outliers(flights, prior.limit_m());
    let found = detect_steps(&estimates, prior.limit_m());
    let mut history = History {
        estimates,
        outliers,
        noise_factor,
        changes: Vec::new(),
        offset_m2: 0.0,
        begins: vec![SegmentStart { estimate: 0, usage: 0.0, fresh: false }],
        undone_m: 0.0,
        now: 0.0,
        known_age,
    };
    for step in &found {
        history.apply(step, flights, maintenance, prior);
    }
    history.changes.extend(events_without_step(flights, maintenance, &found, &history.estimates));
    history.set_axis(flights, prior);
    history
}

impl History {
    /// The same with the usage of another axis.
    pub(crate) fn on_axis(&self, flights: &[Flight], prior: &FleetPrior) -> Self {
        let mut history = self.clone();
        history.set_axis(flights, prior);
        history
    }

    /// Turns every usage to that of the prior's axis.
    fn set_axis(&mut self, flights: &[Flight], prior: &FleetPrior) {
        for estimate in &mut self.estimates {
            estimate.usage = prior.usage(&flights[estimate.flight]);
        }
        for begin in self.begins.iter_mut().skip(1) {
            begin.usage = self.estimates[begin.estimate - 1].usage;
        }
        self.now = flights.last().map_or(0.0, |f| prior.usage(f));
    }

    /// Names a step and undoes it, or begins a segment with it.
    fn apply(
        &mut self,
        step: &StepChange,
        flights: &[Flight],
        maintenance: &[MaintenanceEvent],
        prior: &FleetPrior,
    ) {
        let flight = self.estimates[step.at].flight;
        let kind = if is_recorded(flights, maintenance, flight) {
            ChangePointKind::Recorded
        } else if self.reset_probability(step, prior) > 0.5 {
            ChangePointKind::Reset
        } else {
            ChangePointKind::Step
        };
        let departure_us = flights[flight].departure_us;
        let certainty = match kind {
            ChangePointKind::Recorded => 1.0,
            _ => distributions::cdf(step.step_m.abs() / step.se_m),
        };
        let is_renewal = |entry: &MaintenanceEvent| entry.renews && is_near(entry, flights, flight);
        let renewed = step.step_m < 0.0 && maintenance.iter().any(is_renewal);
        let begins_anew = kind == ChangePointKind::Reset || renewed;
        let (step_m, se_m) =
            if begins_anew { (step.jump_m, step.jump_se_m) } else { (step.step_m, step.se_m) };
        self.changes.push(ChangePoint { departure_us, kind, step_m, se_m, certainty });
        if begins_anew {
            self.begin(step.at, true);
        } else if self.undone_m + step.step_m > MAX_RIGGING_STEP * prior.limit_m() {
            // To undo what may be damage would hide it.
            let hidden_m = std::mem::take(&mut self.undone_m);
            self.shift(step.at, hidden_m);
            self.begin(step.at, false);
        } else {
            self.undone_m += step.step_m;
            self.shift(step.at, -step.step_m);
            self.offset_m2 += step.se_m * step.se_m;
        }
    }

    /// Begins a segment, which knows nothing of what was undone before.
    fn begin(&mut self, estimate: usize, fresh: bool) {
        self.begins.push(SegmentStart { estimate, usage: self.estimates[estimate - 1].usage, fresh });
        self.offset_m2 = 0.0;
    }

    /// Moves every estimate from one on.
    fn shift(&mut self, from: usize, by_m: f64) {
        for estimate in &mut self.estimates[from..] {
            estimate.gap_m += by_m;
        }
    }

    /// Probability that a step made the unit new: how likely the gap after it is a new unit's, against a step of
    /// an arbitrary size within rigging's reach.
    fn reset_probability(&self, step: &StepChange, prior: &FleetPrior) -> f64 {
        let largest_m = MAX_RIGGING_STEP * prior.limit_m();
        if step.step_m >= 0.0 {
            return 0.0;
        }
        if step.step_m < -largest_m {
            return 1.0;
        }
        let after = &self.estimates[step.at..self.estimates.len().min(step.at + 20)];
        let level_m = after.iter().map(|e| e.gap_m).sum::<f64>() / after.len() as f64;
        let sd_m = prior.new_sd_m.hypot(step.se_m);
        let z = (level_m - prior.new_m) / sd_m;
        let new = (-0.5 * z * z).exp() / (sd_m * (2.0 * std::f64::consts::PI).sqrt());
        new / (new + 0.5 / largest_m)
    }

    /// The segments, oldest first.
    pub(crate) fn segments(&self) -> impl Iterator<Item = Segment<'_>> {
        self.begins.iter().enumerate().map(|(i, begin)| {
            let next = self.begins.get(i + 1);
            let end = next.map_or(self.estimates.len(), |next| next.estimate);
            Segment {
                estimates: &self.estimates[begin.estimate..end],
                begin: begin.usage,
                now: next.map_or(self.now, |next| next.usage),
                fresh: begin.fresh,
                known_age: self.known_age.filter(|_| i == 0),
            }
        })
    }
}

/// Whether installations or maintenance explain a change at a flight.
pub(crate) fn is_recorded(flights: &[Flight], maintenance: &[MaintenanceEvent], flight: usize) -> bool {
    maintenance.iter().any(|entry| is_near(entry, flights, flight))
        || flights[near(flights, flight)].windows(2).any(|pair| pair[0].installation != pair[1].installation)
}

/// Flights near a step: as far as a few measured flights before and after it. Flights without a record lie between them.
fn near(flights: &[Flight], flight: usize) -> std::ops::RangeInclusive<usize> {
    let is_measured = |at: &usize| flights[*at].gap.is_some();
    let from = (0..flight).rev().filter(is_measured).nth(RECORD_FLIGHTS).unwrap_or(0);
    let to = (flight..flights.len()).filter(is_measured).nth(RECORD_FLIGHTS).unwrap_or(flights.len() - 1);
    from..=to
}

/// Whether a maintenance entry lies within a few measured flights of a step.
fn is_near(entry: &MaintenanceEvent, flights: &[Flight], flight: usize) -> bool {
    let near = near(flights, flight);
    (flights[*near.start()].departure_us..=flights[*near.end()].departure_us).contains(&entry.utc_us)
}

/// Maintenance entries without a step in the gap, at the first flight after each.
fn events_without_step<'a>(
    flights: &'a [Flight],
    maintenance: &'a [MaintenanceEvent],
    found: &'a [StepChange],
    estimates: &'a [WeightedGap],
) -> impl Iterator<Item = ChangePoint> + 'a {
    let has_step = |entry: &MaintenanceEvent| {
        found.iter().any(|step| is_near(entry, flights, estimates[step.at].flight))
    };
    maintenance.iter().filter(move |entry| !has_step(entry)).filter_map(|entry| {
        let first = flights.get(flights.partition_point(|f| f.departure_us < entry.utc_us))?;
        let (departure_us, kind) = (first.departure_us, ChangePointKind::Recorded);
        Some(ChangePoint { departure_us, kind, step_m: 0.0, se_m: 0.0, certainty: 1.0 })
    })
}
