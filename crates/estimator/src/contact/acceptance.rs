//! Acceptance of an estimate: its quality flags.

use super::codes::QualityFlag;
use super::fit::scaling::Scaling;
use super::types::ContactEstimate;

/// Number of standard errors that a gap must exceed to count as seen.
const SEEN: f64 = 2.0;
/// Load over friction below which friction dominates the relative position.
const HEAVY: f64 = 3.0;
/// A gap under this share of the wind-up at the 95 % load is smaller than the errors of the model.
const DETECTION_SHARE: f64 = 0.01;
/// Largest relative standard error of a useful gap, in wind-ups.
const VAGUE: f64 = 0.1;

/// Flags of an estimate of a part whose stiffness, N/m, is known.
pub(crate) fn flags(
    found: &ContactEstimate,
    scaling: &Scaling,
    part_stiffness_n_per_m: f64,
    is_soft: bool,
) -> Vec<QualityFlag> {
    let agrees = agrees_with_midrange(found, scaling.unknown_force_n);
    let least_m = (SEEN * found.gap_se_m).max(DETECTION_SHARE * scaling.windup_m());
    let is_negative = found.gap_m < -SEEN * found.gap_se_m;
    let compliance = part_stiffness_n_per_m / found.stiffness_n_per_m;
    let is_preloaded = found.preload_n.is_some();
    let doubts = [
        (QualityFlag::Preloaded, is_preloaded),
        (QualityFlag::GapNegative, is_negative),
        (QualityFlag::BelowDetection, found.gap_m < least_m && !is_negative && agrees && !is_preloaded),
        (QualityFlag::EstimatorsDisagree, !agrees && !is_preloaded),
        (QualityFlag::GapVaries, !found.gap_profile.is_empty()),
        // Three spreads of 15 %.
        (QualityFlag::StiffnessImplausible, (compliance - 1.0).abs() > 0.45),
        (QualityFlag::FrictionHeavy, found.load_p95_n < HEAVY * found.friction_n()),
        (QualityFlag::SoftContact, is_soft && !is_preloaded),
        (QualityFlag::Imprecise, found.gap_se_m > VAGUE * scaling.windup_m()),
    ];
    doubts.into_iter().filter_map(|(flag, holds)| holds.then_some(flag)).collect()
}

/// Whether the published statistic at the fitted parameters agrees with the gap as far as its own errors go.
///
/// That statistic takes friction for backlash, about twice F_f/K, gives the unknown force over K for a gap of zero, and is
/// up to a third too low under vibration of the load.
fn agrees_with_midrange(found: &ContactEstimate, unknown_force_n: f64) -> bool {
    let Some(midrange_m) = found.midrange_at_fit_m else { return true };
    let larger_m = midrange_m.abs().max(found.gap_m.abs());
    let force_n = found.friction_n() + 2.0 * unknown_force_n;
    let allowed_m = 0.35 * larger_m + 2.0 * force_n / found.stiffness_n_per_m + 3.0 * found.gap_se_m;
    (midrange_m - found.gap_m).abs() <= allowed_m
}
