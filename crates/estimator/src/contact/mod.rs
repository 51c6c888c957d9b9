//! Contact regression: the gap as the distance of two fitted flanks, with a friction model for the coupling force.
//!
//! The published statistic is right when stiffness, load and clocks are right, and wrong by as much as they are wrong.
//! Here they are estimated from the flight itself. While the coupling presses on one flank,
//!
//! ```text
//! δX = δX₀ + s·ΔS/2 + c/K + d(t) + p(X₂) − τ·Ẋ₁        s = sgn c
//! ```
//! with c the force in the coupling (load less the zero of its cell and the screw's friction, see `friction_model`), d a
//! slow drift, p the transducer's error over the stroke and τ the skew between the two position channels. ΔS is the
//! coefficient of s/2 in a robust regression over blocks of 12 ms, or of 4 ms under a vibrating load, which would mix
//! both flanks in one longer mean.
//!
//! 1. `block_means` averages whole samples, without missing ones and spikes; `sign_check` rejects wrong mappings.
//! 2. `parameter_search` finds, in an excerpt of a long flight, what derivatives do not show: the zero of the load cell
//!    (in contact it merges with δX₀; it shows where the flank is left), and pre-sliding of the friction. Each candidate is
//!    refined by `gauss_newton`.
//! 3. `flank_fit` extrapolates the stiff part of both flanks to zero load and states the error.
//!
//! A toe below the loads that occur is, to the data, extra gap: `gap_m` is the distance of the stiff flanks extrapolated
//! to zero load, and `lost_motion_m` at a reference load is the number that does not depend on the extrapolation.

mod acceptance;
mod block_means;
mod codes;
mod fit;
mod friction;
mod line_joined;
mod load_jump;
mod lost_motion;
mod plot_data;
mod stats;
mod types;

pub use codes::{QualityFlag, Rejection};
pub use fit::flank_fit::ContactWorkspace;
pub use friction::friction_model::Friction;
pub use plot_data::{ContactPlot, Flank, Touch};
pub use types::{ContactEstimate, ContactOutcome, GapAtPlace, PartPrior};

use crate::error::Error;
use crate::gap::statistic::range;
use crate::{Samples, model};
use fit::design_matrix::{DRY, FORCE, LOAD_RATE, SHARE, SPEED};
use fit::flank_fit::{self, FlankFit};
use fit::gauss_newton::{GaussNewtonResult, LATEST_S};
use fit::scaling::{LATE_S, SPEED_M_PER_S, Scaling};
use fit::sign_check::{self, SignCheck};
use line_joined::line_length;

/// Longest step between samples, s: slower logs blur the moment at which a flank is left.
const LONGEST_STEP_S: f64 = 0.05;
/// Standard normal 95 % quantile.
const NORMAL_95: f64 = 1.644_853_626_951_472_2;
/// Standard errors by which no gap of a sound log is below zero; the second where it is also by [`IMPOSSIBLE_SHARE`].
const IMPOSSIBLE_SIGMA: [f64; 2] = [5.0, 2.0];
/// Share of the wind-up by which the error of a model may make a gap negative.
const IMPOSSIBLE_SHARE: f64 = 0.2;

/// Estimates the gap of one flight, over all its segments together, or returns the reason for its rejection. Flights that
/// are estimated one after the other share the scratch memory of a workspace.
///
/// Time is linear in the samples; memory is some twenty numbers for each block and a row of twenty for
/// each tenth of a second or more.
///
/// # Errors
/// [`Error::Lengths`] for channels that do not fit, [`Error::Parameter`] for a stiffness, a reference
/// load or an unknown force that is not positive.
pub fn estimate(
    samples: &Samples<'_>,
    prior: &PartPrior,
    workspace: &mut ContactWorkspace,
) -> Result<ContactOutcome, Error> {
    check(samples, prior)?;
    Ok(look(samples, prior, workspace)
        .map(|(scaling, contact)| Box::new(report(workspace, &scaling, prior, &contact))))
}

/// Why a flight does not allow an estimate, as far as the channels show it without a regression: for the published
/// statistic, which rejects no flight itself.
///
/// It finds wrong signs and ratios, exchanged positions, a load that presses on one flank only, and the load of another
/// actuator. It does not find a screw that friction holds within its gap, nor a load that vibrates faster than it is
/// sampled.
///
/// # Errors
/// As [`estimate`].
pub fn find_rejection(
    samples: &Samples<'_>,
    prior: &PartPrior,
    workspace: &mut ContactWorkspace,
) -> Result<Option<Rejection>, Error> {
    check(samples, prior)?;
    let found = with_standstill_if_needed(workspace, |workspace, with_standstill| {
        let (scaling, signs) = prepare(samples, prior, workspace, with_standstill)?;
        flank_fit::check_both_sides(&workspace.whole, &scaling, signs.shows_gap)?;
        if signs.follows_load { Ok(()) } else { Err(Rejection::MotionUnexplained) }
    });
    Ok(found.err())
}

/// Plot data of an estimate: the intervals in contact and the flanks fitted through them. None where the flight was
/// rejected.
///
/// # Errors
/// As [`estimate`].
pub fn plot_data(samples: &Samples<'_>, prior: &PartPrior) -> Result<Option<ContactPlot>, Error> {
    check(samples, prior)?;
    let mut workspace = ContactWorkspace::default();
    let found = look(samples, prior, &mut workspace).ok();
    Ok(found.map(|(scaling, contact)| ContactPlot::of(workspace.whole.period_s, &scaling, &contact)))
}

/// Whether samples with this step, s, are too far apart; a clock may round the step.
pub fn is_too_slow(step_s: f64) -> bool {
    step_s > LONGEST_STEP_S * (1.0 + 1e-9)
}

fn check(samples: &Samples<'_>, prior: &PartPrior) -> Result<(), Error> {
    samples.check()?;
    model::positive("stiffness_n_per_m", prior.stiffness_n_per_m)?;
    prior.reference_load_n.map_or(Ok(()), |load_n| model::positive("reference_load_n", load_n))?;
    prior.unknown_force_n.map_or(Ok(()), |force_n| model::positive("unknown_force_n", force_n))?;
    prior.period_m.map_or(Ok(()), |period_m| model::positive("period_m", period_m))
}

/// Blocks and scales of a flight, and what its channels show at first sight.
fn prepare(
    samples: &Samples<'_>,
    prior: &PartPrior,
    workspace: &mut ContactWorkspace,
    with_standstill: bool,
) -> Result<(Scaling, SignCheck), Rejection> {
    // Single-precision positions are rounded by less than this.
    let (least_m, greatest_m) = range(samples.motor_m);
    let rounding_m = 5e-7 * greatest_m.max(-least_m).max(0.0);
    let is_slow = |values| {
        let own_step_s = line_length(values, rounding_m).map_or(1.0, |n| n as f64) * samples.step_s;
        is_too_slow(own_step_s)
    };
    if is_slow(samples.motor_m) && is_slow(samples.dx_m) {
        return Err(Rejection::RateTooLow);
    }
    workspace.whole.gather(samples, prior, with_standstill)?;
    let mut scaling = Scaling::of(&workspace.whole, prior)?;
    let signs = sign_check::check(&workspace.whole, &mut scaling)?;
    Ok((scaling, signs))
}

/// Looks at a flight without its standstill, and with it where nothing else reverses.
fn with_standstill_if_needed<T>(
    workspace: &mut ContactWorkspace,
    look: impl Fn(&mut ContactWorkspace, bool) -> Result<T, Rejection>,
) -> Result<T, Rejection> {
    match look(workspace, false) {
        Err(why) if workspace.whole.needs_standstill(why) => look(workspace, true),
        found => found,
    }
}

/// The fitted flanks, where they can be those of an actuator.
fn look(
    samples: &Samples<'_>,
    prior: &PartPrior,
    workspace: &mut ContactWorkspace,
) -> Result<(Scaling, FlankFit), Rejection> {
    let (scaling, contact) = with_standstill_if_needed(workspace, |workspace, with_standstill| {
        let (scaling, _) = prepare(samples, prior, workspace, with_standstill)?;
        flank_fit::fit(samples, workspace, &scaling).map(|contact| (scaling, contact))
    })?;
    let (gap_m, gap_se_m) = contact.gap_m;
    let gives_way = contact.compliance_m_per_n > 0.0;
    let [certain_m, likely_m] = IMPOSSIBLE_SIGMA.map(|sigma| sigma * gap_se_m);
    let impossible_m = certain_m.min(likely_m.max(IMPOSSIBLE_SHARE * scaling.windup_m()));
    let is_possible = gap_m >= -impossible_m || lost_motion::preload_n(&contact, &scaling).is_some();
    // A load that is later still moves the gap.
    let is_in_time = contact.search.line.state.load_delay_s.abs() < LATEST_S;
    // Channels of absurd size overflow the sums of the fit.
    if gap_m.is_finite() && gap_se_m.is_finite() && gives_way && is_possible && is_in_time {
        Ok((scaling, contact))
    } else {
        Err(Rejection::MotionUnexplained)
    }
}

fn report(
    workspace: &ContactWorkspace,
    scaling: &Scaling,
    prior: &PartPrior,
    contact: &FlankFit,
) -> ContactEstimate {
    let preload_n = lost_motion::preload_n(contact, scaling);
    let gap_m = if preload_n.is_some() { 0.0 } else { contact.gap_m.0 };
    let gap_se_m = contact.gap_m.1;
    let compliance = contact.compliance_m_per_n;

    let GaussNewtonResult { design, fit, state, .. } = &contact.search.line;
    let error_m = |terms: &[(usize, f64)]| fit.standard_error_m(terms, &design.firm);
    // A coefficient of friction is what F_d lacks over K, or η at the 95 % load.
    let friction_error_n = |terms: &[(usize, f64)]| error_m(terms) / compliance;
    let mut found = ContactEstimate {
        gap_m,
        gap_se_m,
        gap_bounds_m: (gap_m - NORMAL_95 * gap_se_m, gap_m + NORMAL_95 * gap_se_m),
        stiffness_n_per_m: compliance.recip(),
        stiffness_se_n_per_m: error_m(&[(FORCE, 1.0)]) / scaling.load_n / (compliance * compliance),
        skew_s: state.skew_s,
        skew_se_s: error_m(&[(SPEED, 1.0)]) / SPEED_M_PER_S,
        load_zero_n: state.load_zero_n,
        load_zero_se_n: contact.search.load_zero_se_n,
        load_delay_s: state.load_delay_s,
        load_delay_se_s: error_m(&[(LOAD_RATE, 1.0)]) * LATE_S / fit.beta[FORCE],
        friction: state.friction,
        friction_se: Friction {
            dry_n: friction_error_n(&[(DRY, 1.0)]),
            lost_share: friction_error_n(&[(SHARE, 1.0)]) / scaling.load_n,
        },
        friction_p95_se_n: friction_error_n(&[(DRY, 1.0), (SHARE, 1.0)]),
        gap_profile: contact.profile.as_ref().map(|profile| profile.places.clone()).unwrap_or_default(),
        preload_n,
        loop_width_m: lost_motion::loop_width_m(contact, &workspace.whole, scaling),
        lost_motion_m: prior.reference_load_n.and_then(|n| lost_motion::lost_motion_m(contact, scaling, n)),
        load_p95_n: scaling.load_n,
        midrange_at_fit_m: flank_fit::midrange_at_fit_m(workspace, scaling, contact),
        flags: Vec::new(),
    };
    found.flags = acceptance::flags(&found, scaling, prior.stiffness_n_per_m, contact);
    found
}
