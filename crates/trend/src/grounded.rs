//! No statement against the unit's own eyes: the level must be where the last estimates are.
//!
//! A prior can be so sure of itself that it outvotes a unit: a fleet of which nothing wears, with new gaps
//! alike to the micrometre, leaves no curve for a unit near its limit. Then the unit is judged by itself,
//! and where that does not fit either, not at all.

use crate::clean::Estimate;
use crate::posterior::{Node, Posterior, Segment, posterior};
use crate::prior::FleetPrior;

/// Last estimates that are asked.
const RECENT: usize = 12;

/// Standard errors beyond which the level is not theirs.
const REACH: f64 = 5.0;

/// A segment's mixture, and whether it stands on the prior of a unit alone.
pub(crate) struct Grounded {
    pub(crate) posterior: Posterior,
    pub(crate) is_alone: bool,
}

/// Why a segment has no mixture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Groundless {
    /// It has no estimate, or no usage.
    Empty,
    /// Neither the fleet nor the unit alone explains its last estimates.
    Unsupported { level_m: f64, recent_m: f64 },
}

/// Judges a segment by its fleet's prior, or else by the one of a unit `alone`, as the last estimates allow.
///
/// Offsets that were undone leave `offset_m2` in the level.
pub(crate) fn grounded(
    segment: &Segment<'_>,
    prior: &FleetPrior,
    alone: &FleetPrior,
    offset_m2: f64,
) -> Result<Grounded, Groundless> {
    let mut why = Groundless::Empty;
    for (is_alone, prior) in [(false, prior), (true, alone)] {
        let Some(posterior) = posterior(segment, prior) else { return Err(Groundless::Empty) };
        let check = check(last(segment.estimates), segment.now, &posterior, prior, offset_m2);
        if check.holds() {
            return Ok(Grounded { posterior, is_alone });
        }
        why = Groundless::Unsupported { level_m: check.level_m, recent_m: check.recent_m };
    }
    Err(why)
}

/// What the mixture says of the last estimates, and what they say.
pub(crate) struct Check {
    level_m: f64,
    recent_m: f64,
    reach_m: f64,
}

impl Check {
    /// Whether the level is theirs; also false where a figure is not a number.
    pub(crate) fn holds(&self) -> bool {
        (self.level_m - self.recent_m).abs() <= self.reach_m
    }
}

/// The last estimates, which are asked.
pub(crate) fn last(estimates: &[Estimate]) -> &[Estimate] {
    &estimates[estimates.len().saturating_sub(RECENT)..]
}

/// Holds the mixture's level at a usage against a segment's last estimates.
pub(crate) fn check(
    recent: &[Estimate],
    now: f64,
    posterior: &Posterior,
    prior: &FleetPrior,
    offset_m2: f64,
) -> Check {
    let weight: f64 = recent.iter().map(|e| e.weight).sum();
    let mean = |of: &dyn Fn(&Estimate) -> f64| recent.iter().map(|e| e.weight * of(e)).sum::<f64>() / weight;
    let since = now - mean(&|e| e.usage);
    let season = |e: &Estimate| prior.season.mean_m * prior.season.wave(e.departure_us as f64);
    let then = |node: &Node| {
        let grown = node.law.height(node.age_now) - node.law.height(node.age_now - since);
        node.weight * (node.level_m - node.amplitude_m * grown)
    };
    let systematic_m2 = prior.bias_sd_m.powi(2) + prior.season.sd_m.powi(2) + offset_m2;
    let recent_m = mean(&|e| e.gap_m - season(e));
    // Errors that were stated too large would let anything pass: the scatter is asked, too.
    let scatter_m2 = mean(&|e| (e.gap_m - season(e) - recent_m).powi(2));
    let error_m2 = weight.recip().min(scatter_m2);
    Check {
        level_m: posterior.nodes.iter().map(then).sum(),
        recent_m,
        reach_m: REACH * (error_m2 + systematic_m2).sqrt(),
    }
}
