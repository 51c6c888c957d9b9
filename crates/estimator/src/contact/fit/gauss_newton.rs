//! Gauss–Newton iteration over the parameters that the force in the coupling depends on.

use crate::contact::block_means::BlockMeans;
use crate::contact::codes::Rejection;
use crate::contact::fit::design_matrix::{
    BEFORE, COLUMNS, DRIFT, DRY, DesignMatrix, FIRM_SHARE, FORCE, FORCE_DRIFT, FORCE_PLACE, GAP, LOAD_RATE,
    ORIGIN, PERIODIC, PLACE, SHARE, SIDE_FORCE, SPEED, STRIBECK, less_pressed, less_pressed_blocks,
};
use crate::contact::fit::robust_regression::{GaussianPrior, RobustFit, fit};
use crate::contact::fit::scaling::{LATE_S, SPEED_M_PER_S, Scaling};
use crate::contact::friction::coupling_path::integrate;
use crate::contact::friction::friction_model::{Friction, FrictionState};

/// Each flank must be touched this long, s.
const REQUIRED_CONTACT_S: f64 = 1.0;
/// The longest delay of the load that is allowed for, s.
pub(crate) const LATEST_S: f64 = 0.04;
/// Time for which a flank must be pressed firmly before a block gives a row, s: four time constants of a lag of 10 ms.
const SETTLING_S: f64 = 0.04;
/// Least share of the firm blocks of the less pressed flank that must be left.
const SETTLED_SHARE: f64 = 0.5;
/// Below this a flank was not touched at all, s.
const MIN_CONTACT_S: f64 = 0.1;

/// Most likely dry friction over the 95 % load, and its standard deviation.
pub(crate) const DRY_SHARE: (f64, f64) = (0.02, 0.06);

/// The last iteration: rows, coefficients, and the parameters they were made with and lead to.
#[derive(Debug)]
pub(crate) struct GaussNewtonResult {
    pub(crate) design: DesignMatrix,
    pub(crate) fit: RobustFit<COLUMNS>,
    /// Parameters of the design's rows.
    pub(crate) at: FrictionState,
    /// Parameters that the fit leads to.
    pub(crate) state: FrictionState,
}

/// Iterates from a state: rows of that state, a fit, and the state the fit asks for; each fit reweights its rows `rounds`
/// times.
///
/// # Errors
/// [`Rejection::NoLoadReversal`], [`Rejection::OneSideBrief`], [`Rejection::TooShort`].
pub(crate) fn search(
    blocks: &mut BlockMeans,
    scaling: &Scaling,
    mut state: FrictionState,
    mut iterations: usize,
    rounds: usize,
) -> Result<GaussNewtonResult, Rejection> {
    loop {
        blocks.apply_delays(&state);
        integrate(blocks, &state, scaling.motor_sense);
        let design = settled_rows(blocks, scaling);
        rejection_of_contact(less_pressed(design.firm.iter(), blocks.period_s))?;
        let fit = fit(&design.firm, &priors(scaling, &state), rounds, true).ok_or(Rejection::TooShort)?;
        let after = next(scaling, &state, &fit);
        iterations -= 1;
        if iterations == 0 {
            return Ok(GaussNewtonResult { design, fit, at: state, state: after });
        }
        state = after;
    }
}

/// Rows of blocks before which their flank was pressed firmly for [`SETTLING_S`]: after a change of the flank, a channel that
/// lags has not settled on the other one. Where the load vibrates, so that too few of the firm blocks would be left, rows of
/// all blocks.
fn settled_rows(blocks: &BlockMeans, scaling: &Scaling) -> DesignMatrix {
    let settling = (SETTLING_S / blocks.period_s).round() as usize;
    if settling > BEFORE {
        let settled = blocks.rows(scaling, settling);
        let forces_n = blocks.couplings.iter().map(|coupling| coupling.force_n);
        let firm = less_pressed_blocks(forces_n, FIRM_SHARE * scaling.load_n);
        if less_pressed(settled.firm.iter(), 1.0) > SETTLED_SHARE * firm {
            return settled;
        }
    }
    blocks.rows(scaling, 0)
}

/// Rejects a flight whose less pressed flank is pressed for too short a time, s.
pub(crate) fn rejection_of_contact(least_s: f64) -> Result<(), Rejection> {
    if least_s < MIN_CONTACT_S {
        Err(Rejection::NoLoadReversal)
    } else if least_s < REQUIRED_CONTACT_S {
        Err(Rejection::OneSideBrief)
    } else {
        Ok(())
    }
}

/// Priors of the coefficients, before the flight is seen, m.
pub(crate) fn priors(scaling: &Scaling, state: &FrictionState) -> [GaussianPrior; COLUMNS] {
    let windup_m = scaling.windup_m();
    let here_m = scaling.load_n / state.stiffness_n_per_m;
    let lack = |(usual, spread): (f64, f64), now: f64| GaussianPrior {
        mean: (usual - now) * here_m,
        sd: spread * here_m,
    };
    std::array::from_fn(|column| match column {
        ORIGIN | GAP => GaussianPrior::NONE,
        // 1/K is the part's to 15 %; the flanks differ by twice 5 %, and it drifts by 3 % from the middle to the end.
        FORCE => GaussianPrior { mean: windup_m, sd: 0.15 * windup_m },
        SIDE_FORCE => GaussianPrior::zero(0.05 * windup_m),
        FORCE_DRIFT => GaussianPrior::zero(0.03 * windup_m),
        // It differs by 4 % between the middle of the stroke and an end.
        FORCE_PLACE..SPEED => GaussianPrior::zero(0.04 * windup_m),
        DRY => lack(DRY_SHARE, state.friction.dry_n / scaling.load_n),
        // Most likely value and spread of the lost share, and of the excess friction at rest.
        SHARE => lack((0.03, 0.06), state.friction.lost_share),
        STRIBECK => lack((0.0, 0.3), state.stribeck),
        // A screw that is locked has no delay: what is left is viscous friction, 0.1 ms.
        SPEED if scaling.is_locked() => GaussianPrior::zero(1e-4 * SPEED_M_PER_S),
        // The delays that remain once the channels are realigned: 5 ms.
        SPEED => GaussianPrior { mean: state.skew_s * SPEED_M_PER_S, sd: 5e-3 * SPEED_M_PER_S },
        // On a bench one recorder takes both: under a load of one frequency, friction and gap look like a delay.
        LOAD_RATE => {
            let sd_s = if scaling.is_locked() { 1e-4 } else { 5e-3 };
            GaussianPrior { mean: -state.load_delay_s / LATE_S * here_m, sd: sd_s / LATE_S * here_m }
        }
        // The drift within a flight, linear and quadratic.
        DRIFT => GaussianPrior::zero(50e-6),
        _ if column < PLACE => GaussianPrior::zero(20e-6),
        // The transducer's error at the ends of the stroke, and errors that repeat with the position.
        PLACE..PERIODIC => GaussianPrior::zero(60e-6),
        _ => GaussianPrior::zero(20e-6),
    })
}

/// The state that a fit leads to, within the bounds of a sensible iteration.
fn next(scaling: &Scaling, state: &FrictionState, fit: &RobustFit<COLUMNS>) -> FrictionState {
    let beta = &fit.beta;
    let windup_m = scaling.windup_m();
    // A factor of three from the scale's stiffness at most.
    let stiffness = scaling.load_n / beta[FORCE].clamp(windup_m / 3.0, windup_m * 3.0);
    let lacking = |column: usize| beta[column] * stiffness / scaling.load_n;
    // Either part of the friction takes half of the load at most.
    let share = |value: f64| value.clamp(0.0, 0.5);
    FrictionState {
        stiffness_n_per_m: stiffness,
        // Twenty wind-ups at most.
        gap_m: beta[GAP].clamp(0.0, 20.0 * windup_m),
        friction: Friction {
            dry_n: scaling.load_n * share(state.friction.dry_n / scaling.load_n + lacking(DRY)),
            lost_share: share(state.friction.lost_share + lacking(SHARE)),
        },
        // Friction at rest is 2.2 times that in motion at most.
        stribeck: (state.stribeck + lacking(STRIBECK)).clamp(0.0, 1.2),
        load_delay_s: (state.load_delay_s + lacking(LOAD_RATE) * LATE_S).clamp(-LATEST_S, LATEST_S),
        skew_s: state.skew_s - beta[SPEED] / SPEED_M_PER_S,
        ..*state
    }
}
