//! Consistency check: the posterior level must agree with the unit's latest estimates.
//!
//! A confident prior can outweigh the data of a unit: a fleet without wear, with equal new gaps,
//! leaves no candidate for a unit near its limit. Then the unit is assessed with the single-unit prior,
//! and where that does not agree either, it is not assessed.

use crate::data::outliers::WeightedGap;
use crate::data::segment::Segment;
use crate::inference::posterior::{Component, Posterior, posterior};
use crate::prior::fleet_prior::FleetPrior;

/// Number of latest estimates of the check.
const RECENT: usize = 12;

/// Standard errors beyond which the level is not theirs.
const REACH: f64 = 5.0;

/// A segment's mixture, and whether it uses the single-unit prior.
pub(crate) struct ConsistentPosterior {
    pub(crate) posterior: Posterior,
    pub(crate) is_single_unit: bool,
}

/// Why a segment has no mixture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Inconsistency {
    /// It has no estimate, or no usage.
    Empty,
    /// Neither the fleet nor the unit alone explains its last estimates.
    Unsupported { level_m: f64, recent_m: f64 },
}

/// Judges a segment by its fleet's prior, or else by the one of a unit `single_unit`, as the last estimates allow.
///
/// Offsets that were undone leave `offset_m2` in the level.
pub(crate) fn fit_consistent(
    segment: &Segment<'_>,
    prior: &FleetPrior,
    single_unit: &FleetPrior,
    offset_m2: f64,
) -> Result<ConsistentPosterior, Inconsistency> {
    let mut why = Inconsistency::Empty;
    for (is_single_unit, prior) in [(false, prior), (true, single_unit)] {
        let Some(posterior) = posterior(segment, prior) else { return Err(Inconsistency::Empty) };
        let level_check =
            level_check(recent_estimates(segment.estimates), segment.now, &posterior, prior, offset_m2);
        if level_check.holds() {
            return Ok(ConsistentPosterior { posterior, is_single_unit });
        }
        why = Inconsistency::Unsupported { level_m: level_check.level_m, recent_m: level_check.recent_m };
    }
    Err(why)
}

/// Level of the mixture, and level of the latest estimates.
pub(crate) struct LevelCheck {
    level_m: f64,
    recent_m: f64,
    reach_m: f64,
}

impl LevelCheck {
    /// Whether the level is theirs; also false where a figure is not a number.
    pub(crate) fn holds(&self) -> bool {
        (self.level_m - self.recent_m).abs() <= self.reach_m
    }
}

/// The latest estimates, which the check uses.
pub(crate) fn recent_estimates(estimates: &[WeightedGap]) -> &[WeightedGap] {
    &estimates[estimates.len().saturating_sub(RECENT)..]
}

/// Holds the mixture's level at a usage against a segment's last estimates.
pub(crate) fn level_check(
    recent: &[WeightedGap],
    now: f64,
    posterior: &Posterior,
    prior: &FleetPrior,
    offset_m2: f64,
) -> LevelCheck {
    let weight: f64 = recent.iter().map(|e| e.weight).sum();
    let mean =
        |of: &dyn Fn(&WeightedGap) -> f64| recent.iter().map(|e| e.weight * of(e)).sum::<f64>() / weight;
    let since = now - mean(&|e| e.usage);
    let season = |e: &WeightedGap| prior.season.mean_m * prior.season.wave(e.departure_us as f64);
    let then = |component: &Component| {
        let grown = component.law.value(component.age_now) - component.law.value(component.age_now - since);
        component.weight * (component.level_m - component.amplitude_m * grown)
    };
    let systematic_m2 = prior.bias_sd_m.powi(2) + prior.season.sd_m.powi(2) + offset_m2;
    let recent_m = mean(&|e| e.gap_m - season(e));
    // Stated errors that are too large would accept any level: the scatter is a second criterion.
    let scatter_m2 = mean(&|e| (e.gap_m - season(e) - recent_m).powi(2));
    let error_m2 = weight.recip().min(scatter_m2);
    LevelCheck {
        level_m: posterior.components.iter().map(then).sum(),
        recent_m,
        reach_m: REACH * (error_m2 + systematic_m2).sqrt(),
    }
}
