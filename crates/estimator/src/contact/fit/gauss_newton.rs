//! Gauss–Newton iteration over the parameters that the force in the coupling depends on.

use crate::contact::blocks::block_means::BlockMeans;
use crate::contact::codes::Rejection;
use crate::contact::fit::design_matrix::{
    COLUMNS, DRIFT, DRY, DesignMatrix, FORCE, FORCE_DRIFT, GAP, LOAD_RATE, ORIGIN, PERIODIC, PLACE,
    RowSource, SHARE, SIDE_FORCE, SPEED, STRIBECK,
};
use crate::contact::fit::robust_regression::{GaussianPrior, RobustFit, fit};
use crate::contact::fit::scaling::{LATE_S, SPEED_M_PER_S, Scaling};
use crate::contact::friction::coupling_path::integrate;
use crate::contact::friction::friction_model::{Coupling, Friction, FrictionState};
use crate::contact::types::{MIN_CONTACT_S, REQUIRED_CONTACT_S};

/// Relative spread of 1/K about the part's.
const COMPLIANCE: f64 = 0.15;
/// Dry friction over the 95 % load, and the share of load lost: most likely value and spread.
const FRICTION_DRY: (f64, f64) = (0.02, 0.06);
/// See [`FRICTION_DRY`].
const FRICTION_SHARE: (f64, f64) = (0.03, 0.06);
/// Spread of the excess of friction at rest.
const STRIBECK_EXCESS: f64 = 0.3;
/// Spread of the delays between channels, s.
const SKEW_S: f64 = 5e-3;
/// The same where the output is locked: what is left to viscous friction, s.
const LOCKED_SKEW_S: f64 = 1e-4;
/// Spread of the drift within a flight, linear and quadratic, m.
const DRIFT_M: [f64; 2] = [50e-6, 20e-6];
/// Spread of the transducer's error at the ends of the stroke, m.
const PLACE_M: f64 = 60e-6;
/// Spread of errors periodic in position, m.
const PERIODIC_M: f64 = 20e-6;
/// Spread of the change of 1/K from the middle of a flight to its end, relative.
const COMPLIANCE_DRIFT: f64 = 0.03;
/// Spread of half the difference of the compliances of both flanks, relative.
const COMPLIANCE_SIDE: f64 = 0.05;
/// Stiffness moves by this factor at most in an iteration.
const MAX_STIFFNESS_STEP: f64 = 3.0;
/// Greatest friction over the load.
const MAX_FRICTION_SHARE: f64 = 0.5;
/// Greatest excess of friction at rest.
const MAX_STRIBECK: f64 = 1.2;
/// Longest delay of the load, s.
const MAX_LOAD_DELAY_S: f64 = 0.04;
/// Widest gap in wind-ups that the iteration assumes.
const MAX_GAP_WINDUPS: f64 = 20.0;

/// The last iteration: rows, coefficients, and the parameters they were made with and lead to.
#[derive(Debug)]
pub(crate) struct GaussNewtonResult {
    pub(crate) design: DesignMatrix,
    pub(crate) fit: RobustFit<COLUMNS>,
    /// Parameters of the design's rows.
    pub(crate) at: FrictionState,
    /// Parameters that the fit asks for.
    pub(crate) state: FrictionState,
}

/// Iterates from a state: rows of that state, a fit, and the state the fit asks for; each fit reweights its rows `rounds`
/// times.
///
/// # Errors
/// [`Rejection::NoLoadReversal`], [`Rejection::OneSideBrief`], [`Rejection::TooShort`].
pub(crate) fn search(
    (blocks, couplings): (&mut BlockMeans, &mut Vec<Coupling>),
    scaling: &Scaling,
    mut state: FrictionState,
    (iterations, rounds): (usize, usize),
) -> Result<GaussNewtonResult, Rejection> {
    let mut found = None;
    for _ in 0..iterations {
        blocks.apply_delays(&state);
        integrate(blocks, &state, scaling.motor_sense, couplings);
        let design = RowSource { blocks, scaling }.rows(couplings);
        rejection_of_contact(design.touched_s.0.min(design.touched_s.1))?;
        let fit = fit(&design.firm, &priors(scaling, &state), rounds).ok_or(Rejection::TooShort)?;
        let after = next(scaling, &state, &fit);
        found = Some(GaussNewtonResult { design, fit, at: state, state: after });
        state = after;
    }
    found.ok_or(Rejection::TooShort)
}

/// The start of a search: the part's stiffness, a usual friction, no gap and no delays.
pub(crate) fn start(scaling: &Scaling) -> FrictionState {
    FrictionState {
        stiffness_n_per_m: scaling.stiffness_n_per_m,
        friction: Friction { dry_n: FRICTION_DRY.0 * scaling.load_n, lost_share: FRICTION_SHARE.0 },
        ..FrictionState::default()
    }
}

/// The reason of a flight whose less pressed flank is pressed for a time, s.
pub(crate) fn rejection_of_contact(least_s: f64) -> Result<(), Rejection> {
    if least_s < MIN_CONTACT_S {
        Err(Rejection::NoLoadReversal)
    } else if least_s < REQUIRED_CONTACT_S {
        Err(Rejection::OneSideBrief)
    } else {
        Ok(())
    }
}

pub(crate) fn priors(scaling: &Scaling, state: &FrictionState) -> [GaussianPrior; COLUMNS] {
    let windup_m = scaling.windup_m();
    let here_m = scaling.load_n / state.stiffness_n_per_m;
    let lack = |(usual, spread): (f64, f64), now: f64| GaussianPrior {
        mean: (usual - now) * here_m,
        sd: spread * here_m,
    };
    let zero = |sd: f64| GaussianPrior { mean: 0.0, sd };
    std::array::from_fn(|column| match column {
        ORIGIN | GAP => GaussianPrior::NONE,
        FORCE => GaussianPrior { mean: windup_m, sd: COMPLIANCE * windup_m },
        DRY => lack(FRICTION_DRY, state.friction.dry_n / scaling.load_n),
        SHARE => lack(FRICTION_SHARE, state.friction.lost_share),
        STRIBECK => lack((0.0, STRIBECK_EXCESS), state.stribeck),
        // The delays that remain once the channels are realigned.
        // A screw that is locked has no delay.
        SPEED if scaling.is_locked() => zero(LOCKED_SKEW_S * SPEED_M_PER_S),
        SPEED => GaussianPrior { mean: state.skew_s * SPEED_M_PER_S, sd: SKEW_S * SPEED_M_PER_S },
        LOAD_RATE => {
            GaussianPrior { mean: -state.load_delay_s / LATE_S * here_m, sd: SKEW_S / LATE_S * here_m }
        }
        SIDE_FORCE => zero(COMPLIANCE_SIDE * windup_m),
        FORCE_DRIFT => zero(COMPLIANCE_DRIFT * windup_m),
        _ if column < PLACE => zero(DRIFT_M[column - DRIFT]),
        _ if column >= PERIODIC => zero(PERIODIC_M),
        _ => zero(PLACE_M),
    })
}

fn next(scaling: &Scaling, state: &FrictionState, fit: &RobustFit<COLUMNS>) -> FrictionState {
    let beta = &fit.beta;
    let windup_m = scaling.windup_m();
    let stiffness =
        scaling.load_n / beta[FORCE].clamp(windup_m / MAX_STIFFNESS_STEP, windup_m * MAX_STIFFNESS_STEP);
    let lacking = |column: usize| beta[column] * stiffness / scaling.load_n;
    let late_s = lacking(LOAD_RATE) * LATE_S;
    FrictionState {
        stiffness_n_per_m: stiffness,
        gap_m: beta[GAP].clamp(0.0, MAX_GAP_WINDUPS * windup_m),
        friction: Friction {
            dry_n: scaling.load_n
                * (state.friction.dry_n / scaling.load_n + lacking(DRY)).clamp(0.0, MAX_FRICTION_SHARE),
            lost_share: (state.friction.lost_share + lacking(SHARE)).clamp(0.0, MAX_FRICTION_SHARE),
        },
        stribeck: (state.stribeck + lacking(STRIBECK)).clamp(0.0, MAX_STRIBECK),
        load_delay_s: (state.load_delay_s + late_s).clamp(-MAX_LOAD_DELAY_S, MAX_LOAD_DELAY_S),
        skew_s: state.skew_s - beta[SPEED] / SPEED_M_PER_S,
        ..*state
    }
}
