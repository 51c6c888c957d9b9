//! A unit's history read: outliers out, offsets of the measurement undone, cut where it was reset.

use crate::data::bins::Segment;
use crate::data::outliers::{WeightedGap, mark_outliers};
use crate::data::series::{Flight, MaintenanceEvent, UnitData};
use crate::data::steps::{StepChange, detect_steps};
use crate::math::normal_cdf;
use crate::prior::FleetPrior;
use crate::statement::types::{ChangePoint, ChangePointKind};

/// A step larger than this share of the limit is never a matter of rigging: a fall made the unit new, a rise is
/// damage.
const MAX_RIGGING_STEP: f64 = 0.15;

/// Number of flights around a change of installation within which a step belongs to that change.
pub(crate) const RECORD_FLIGHTS: usize = 3;

/// What a unit's flights show, apart from wear.
#[derive(Debug, Clone)]
pub(crate) struct History<'a> {
    pub(crate) data: UnitData<'a>,
    pub(crate) estimates: Vec<WeightedGap>,
    pub(crate) outliers: Vec<usize>,
    /// Variance found between flights over the variance stated.
    pub(crate) noise_factor: f64,
    pub(crate) changes: Vec<ChangePoint>,
    /// Variance that the sizes of undone offsets leave in the level, m².
    pub(crate) offset_m2: f64,
    starts: Vec<SegmentStart>,
    /// Offset that was removed from the last estimates, metres: laws are fitted without a rise, but the forecast adds it again.
    pub(crate) undone_m: f64,
    /// Usage at the last flight.
    pub(crate) now: f64,
}

#[derive(Debug, Clone, Copy)]
struct SegmentStart {
    estimate: usize,
    known_age: Option<f64>,
}

impl<'a> History<'a> {
    /// Reads the flights along the axis that wear follows, of a unit whose age at its first flight may be known.
    pub(crate) fn read(data: UnitData<'a>, known_age: Option<f64>, prior: &FleetPrior) -> Self {
        let (estimates, outliers, noise_factor) = mark_outliers(data.flights, prior.limit_m());
        let found = detect_steps(&estimates, prior.limit_m());
        let mut history = Self {
            data,
            estimates,
            outliers,
            noise_factor,
            changes: Vec::new(),
            offset_m2: 0.0,
            starts: vec![SegmentStart { estimate: 0, known_age }],
            undone_m: 0.0,
            now: 0.0,
        };
        for step in &found {
            history.apply(step, prior);
        }
        let with_step: Vec<&MaintenanceEvent> =
            found.iter().flat_map(|step| data.maintenance_near(history.estimates[step.at].flight)).collect();
        // Maintenance that no step shows counts at the first flight after it.
        let without_step = data.maintenance.iter().filter(|entry| !with_step.contains(entry));
        history.changes.extend(without_step.filter_map(|entry| {
            let first = data.flights.get(data.flight_at(entry.utc_us))?;
            let (departure_us, kind) = (first.departure_us, ChangePointKind::Recorded);
            Some(ChangePoint { departure_us, kind, step_m: 0.0, se_m: 0.0, certainty: 1.0 })
        }));
        history.on_axis(prior)
    }

    /// The same with the usage of the prior's axis.
    pub(crate) fn on_axis(mut self, prior: &FleetPrior) -> Self {
        let flights = self.data.flights;
        for estimate in &mut self.estimates {
            estimate.usage = prior.usage(&flights[estimate.flight]);
        }
        self.now = flights.last().map_or(0.0, |f| prior.usage(f));
        self
    }

    /// Names a step and undoes it, or begins a segment with it.
    fn apply(&mut self, step: &StepChange, prior: &FleetPrior) {
        let (data, flight) = (self.data, self.estimates[step.at].flight);
        let kind = if data.is_recorded(flight) {
            ChangePointKind::Recorded
        } else if self.reset_probability(step, prior) > 0.5 {
            ChangePointKind::Reset
        } else {
            ChangePointKind::Step
        };
        let departure_us = data.flights[flight].departure_us;
        let certainty = match kind {
            ChangePointKind::Recorded => 1.0,
            _ => normal_cdf(step.step_m.abs() / step.se_m),
        };
        let renewed = step.step_m < 0.0 && data.maintenance_near(flight).any(|entry| entry.renews);
        let begins_anew = kind == ChangePointKind::Reset || renewed;
        let (step_m, se_m) =
            if begins_anew { (step.jump_m, step.jump_se_m) } else { (step.step_m, step.se_m) };
        self.changes.push(ChangePoint { departure_us, kind, step_m, se_m, certainty });
        if begins_anew {
            self.begin(step.at, Some(0.0));
        } else if (self.undone_m + step.step_m).abs() > MAX_RIGGING_STEP * prior.limit_m() {
            // To undo a rise that may be damage would hide it; to undo a large fall would forecast a gap that is gone.
            let hidden_m = std::mem::take(&mut self.undone_m);
            self.shift(step.at, hidden_m);
            self.begin(step.at, None);
        } else {
            self.undone_m += step.step_m;
            self.shift(step.at, -step.step_m);
            self.offset_m2 += step.se_m * step.se_m;
        }
    }

    /// Begins a segment, which knows nothing of what was undone before.
    fn begin(&mut self, estimate: usize, known_age: Option<f64>) {
        self.starts.push(SegmentStart { estimate, known_age });
        self.offset_m2 = 0.0;
    }

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
        let usage_before = |estimate: usize| estimate.checked_sub(1).map_or(0.0, |k| self.estimates[k].usage);
        self.starts.iter().enumerate().map(move |(i, start)| {
            let next = self.starts.get(i + 1).map(|next| next.estimate);
            Segment {
                estimates: &self.estimates[start.estimate..next.unwrap_or(self.estimates.len())],
                begin: usage_before(start.estimate),
                now: next.map_or(self.now, usage_before),
                known_age: start.known_age,
            }
        })
    }
}

impl<'a> UnitData<'a> {
    /// The first flight at or after a departure.
    pub(crate) fn flight_at(self, departure_us: i64) -> usize {
        self.flights.partition_point(|flight| flight.departure_us < departure_us)
    }

    /// Whether installations or maintenance explain a change at a flight.
    pub(crate) fn is_recorded(self, flight: usize) -> bool {
        let is_moved = |pair: &[Flight]| pair[0].installation != pair[1].installation;
        self.maintenance_near(flight).next().is_some() || self.near(flight).windows(2).any(is_moved)
    }

    /// Flights near a step: as far as a few measured flights before and after it. Flights without a record lie between them.
    fn near(self, flight: usize) -> &'a [Flight] {
        let is_measured = |at: &usize| self.flights[*at].gap.is_some();
        let from = (0..flight).rev().filter(is_measured).nth(RECORD_FLIGHTS).unwrap_or(0);
        let to = (flight..self.flights.len()).filter(is_measured).nth(RECORD_FLIGHTS);
        &self.flights[from..=to.unwrap_or(self.flights.len() - 1)]
    }

    /// Maintenance within a few measured flights of a step.
    pub(crate) fn maintenance_near(self, flight: usize) -> impl Iterator<Item = &'a MaintenanceEvent> {
        let near = self.near(flight);
        let dates_us = near[0].departure_us..=near[near.len() - 1].departure_us;
        self.maintenance.iter().filter(move |entry| dates_us.contains(&entry.utc_us))
    }
}
