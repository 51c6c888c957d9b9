//! Acceptance of an estimate: its quality flags.

use super::codes::QualityFlag;
use super::fit::flank_fit::FlankFit;
use super::fit::scaling::Scaling;
use super::types::ContactEstimate;

/// Number of standard errors that a gap must exceed to count as seen.
const SEEN: f64 = 2.0;
/// Load over friction below which friction dominates the relative position.
const HEAVY: f64 = 3.0;
/// A gap under this share of the wind-up at the 95 % load is smaller than the errors of the model.
const DETECTION_SHARE: f64 = 0.01;
/// Largest standard error of a useful gap, in wind-ups.
const VAGUE: f64 = 0.1;
/// Shares of the wind-up and of the gap that a useful gap's standard error does not both exceed.
const VAGUE_OF_GAP: (f64, f64) = (0.05, 0.15);
/// Factor between fitted and configured stiffness that three spreads of 15 % explain.
const UNLIKE: f64 = 1.45;
/// Scatter about the fit, as shares of the wind-up and of the gap, from which the load may be another actuator's.
const POOR: (f64, f64) = (0.3, 0.25);

/// Flags of an estimate of a part whose stiffness, N/m, is known.
pub(crate) fn flags(
    found: &ContactEstimate,
    scaling: &Scaling,
    part_stiffness_n_per_m: f64,
    contact: &FlankFit,
) -> Vec<QualityFlag> {
    // A flank that is softer than any flank of the part is no reason for a difference.
    let stiffness_n_per_m = found.stiffness_n_per_m.max(part_stiffness_n_per_m / UNLIKE);
    let agrees = agrees_with_midrange(found, scaling.unknown_force_n, stiffness_n_per_m);
    let least_m = (SEEN * found.gap_se_m).max(DETECTION_SHARE * scaling.windup_m());
    let is_negative = found.gap_m < -SEEN * found.gap_se_m;
    let compliance = part_stiffness_n_per_m / found.stiffness_n_per_m;
    let windup_m = scaling.windup_m();
    let exceeds = |length_m: f64, (of_windup, of_gap): (f64, f64)| {
        length_m > of_windup * windup_m && length_m > of_gap * found.gap_m
    };
    // A gap that varies along the stroke explains scatter.
    let is_poor = found.gap_profile.is_empty() && exceeds(contact.search.scale_m, POOR);
    let is_preloaded = found.preload_n.is_some();
    let doubts = [
        (QualityFlag::Preloaded, is_preloaded),
        (QualityFlag::GapNegative, is_negative),
        (QualityFlag::BelowDetection, found.gap_m < least_m && !is_negative && agrees && !is_preloaded),
        (QualityFlag::EstimatorsDisagree, !agrees),
        (QualityFlag::GapVaries, !found.gap_profile.is_empty()),
        (QualityFlag::StiffnessImplausible, compliance.max(compliance.recip()) > UNLIKE),
        (QualityFlag::FitPoor, is_poor),
        (QualityFlag::LoadJumps, contact.load_jumps),
        (QualityFlag::FrictionHeavy, found.load_p95_n < HEAVY * found.friction_n()),
        (QualityFlag::LoadBends, contact.load_bends),
        (QualityFlag::SoftContact, contact.is_soft && !is_preloaded),
        (QualityFlag::Imprecise, found.gap_se_m > VAGUE * windup_m || exceeds(found.gap_se_m, VAGUE_OF_GAP)),
    ];
    doubts.into_iter().filter_map(|(flag, holds)| holds.then_some(flag)).collect()
}

/// Whether the published statistic at the fitted parameters agrees with the gap as far as its own errors go.
///
/// That statistic takes friction for backlash, about twice F_f/K, gives the unknown force over K for a gap of zero, and is
/// up to a third too low under vibration of the load.
fn agrees_with_midrange(found: &ContactEstimate, unknown_force_n: f64, stiffness_n_per_m: f64) -> bool {
    let Some(midrange_m) = found.midrange_at_fit_m else { return true };
    let larger_m = midrange_m.abs().max(found.gap_m.abs());
    let force_n = found.friction_n() + 2.0 * unknown_force_n;
    let allowed_m = 0.35 * larger_m + 2.0 * force_n / stiffness_n_per_m + 3.0 * found.gap_se_m;
    (midrange_m - found.gap_m).abs() <= allowed_m
}
