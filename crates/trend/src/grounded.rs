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

/// A segment's mixture, and the prior it stands on.
pub(crate) struct Grounded<'a> {
    pub(crate) posterior: Posterior,
    pub(crate) prior: &'a FleetPrior,
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
pub(crate) fn grounded<'a>(
    segment: &Segment<'_>,
    prior: &'a FleetPrior,
    alone: &'a FleetPrior,
    offset_m2: f64,
) -> Result<Grounded<'a>, Groundless> {
    let mut why = Groundless::Empty;
    for prior in [prior, alone] {
        let Some(posterior) = posterior(segment, prior) else { return Err(Groundless::Empty) };
        let Check { level_m, recent_m, reach_m } = check(segment, &posterior, prior, offset_m2);
        // Also false where one of them is not a number.
        if (level_m - recent_m).abs() <= reach_m {
            return Ok(Grounded { posterior, prior });
        }
        why = Groundless::Unsupported { level_m, recent_m };
    }
    Err(why)
}

/// What the mixture says of the last estimates, and what they say.
struct Check {
    level_m: f64,
    recent_m: f64,
    reach_m: f64,
}

fn check(segment: &Segment<'_>, posterior: &Posterior, prior: &FleetPrior, offset_m2: f64) -> Check {
    let recent = &segment.estimates[segment.estimates.len().saturating_sub(RECENT)..];
    let weight: f64 = recent.iter().map(|e| e.weight).sum();
    let mean = |of: &dyn Fn(&Estimate) -> f64| recent.iter().map(|e| e.weight * of(e)).sum::<f64>() / weight;
    let since = segment.now - mean(&|e| e.usage);
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
