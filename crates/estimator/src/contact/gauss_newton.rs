//! Gauss–Newton over what the force in the coupling depends on: friction, stiffness, gap and skew.

use super::acceptance::Rejection;
use super::block_means::BlockMeans;
use super::coupling_path::CouplingPath;
use super::design_matrix::{
    self, BEND, CURVED, DRIFT, DRY, DesignMatrix, FORCE, GAP, LATE_S, LOAD_RATE, ORIGIN, PLACE, RowSource,
    SHARE, SPEED, SPEED_M_PER_S, Scaling,
};
use super::friction_model::{Friction, FrictionState};
use super::robust_regression::{GaussianPrior, RobustFit, fit};
use super::{BRIEF_S, TOUCH_S};

/// What the design of any actuator says: 1/K within 15 % of the part's.
const COMPLIANCE: f64 = 0.15;
/// Dry friction over the 95 % load, and the share of load lost: most likely value and spread.
const FRICTION_DRY: (f64, f64) = (0.02, 0.06);
/// See [`FRICTION_DRY`].
const FRICTION_SHARE: (f64, f64) = (0.03, 0.06);
/// Spread of the skews between channels, s.
const SKEW_S: f64 = 5e-3;
/// Spread of the drift within a flight, straight and bent, m.
const DRIFT_M: [f64; 2] = [50e-6, 20e-6];
/// Spread of the transducer's error at the ends of the stroke, m.
const PLACE_M: f64 = 60e-6;
/// Spread of the deflections that soft flanks add, m.
const BEND_M: f64 = 50e-6;
/// Stiffness may move by this factor between turns, lest one bad turn ruins the next.
const STRETCH: f64 = 3.0;
/// Friction beyond this share of the load leaves nothing to see.
const MOST_FRICTION: f64 = 0.5;
/// A gap wider than this many wind-ups is kept from misleading the search.
const WIDEST: f64 = 20.0;
/// A turn that moves the state by less than this share of the gap's standard error is the last: the next one would
/// seldom move the gap by more than a fifth of that.
const SETTLED: f64 = 0.05;
/// Rounds of reweighting within a turn.
const ROUNDS: usize = 5;

/// The last turn: rows, coefficients, and the state they were made with.
#[derive(Debug)]
pub(super) struct Found<const N: usize> {
    pub(super) design: DesignMatrix<N>,
    pub(super) fit: RobustFit<N>,
    pub(super) state: FrictionState,
}

/// IterationLimits from a state: rows of that state, a fit, and the state the fit asks for.
///
/// # Errors
/// [`Rejection::NoLoadReversal`], [`Rejection::OneSideBrief`], [`Rejection::TooShort`].
pub(super) fn search<const N: usize>(
    (blocks, course): (&mut BlockMeans, &mut CouplingPath),
    frame: &Scaling,
    mut state: FrictionState,
    turns: usize,
) -> Result<Found<N>, Rejection> {
    let mut found = None;
    for turn in 1..=turns {
        blocks.realign(state.skew_s);
        let mut design = design_matrix::rows(RowSource { blocks, frame }, &state, course);
        touched(&design)?;
        if N == CURVED {
            design.firm.append(&mut design.light);
        }
        let fit = fit(&design.firm, &beliefs(frame, &state), ROUNDS).ok_or(Rejection::TooShort)?;
        let after = next(frame, &state, &fit);
        let moved_m = frame.windup_m() * step(frame, blocks.period_s, &state, &after);
        let is_last = turn == turns || moved_m < SETTLED * fit.standard_error_m(GAP, &design.firm);
        state = after;
        found = Some(Found { design, fit, state });
        if is_last {
            break;
        }
    }
    found.ok_or(Rejection::TooShort)
}

/// How far a turn moved the state, over what each of its numbers is about.
fn step(frame: &Scaling, period_s: f64, before: &FrictionState, after: &FrictionState) -> f64 {
    let (was, is) = (&before.friction, &after.friction);
    [
        after.stiffness_n_per_m / before.stiffness_n_per_m - 1.0,
        (after.gap_m - before.gap_m) / frame.windup_m(),
        (is.dry_n - was.dry_n) / frame.load_n,
        is.lost_share - was.lost_share,
        (after.skew_s - before.skew_s) / period_s,
    ]
    .into_iter()
    .fold(0.0, |most, part| part.abs().max(most))
}

/// Where a search starts: the part's stiffness, usual friction, no gap and no skew.
pub(super) fn start(frame: &Scaling) -> FrictionState {
    FrictionState {
        stiffness_n_per_m: frame.stiffness_n_per_m,
        gap_m: 0.0,
        friction: Friction { dry_n: FRICTION_DRY.0 * frame.load_n, lost_share: FRICTION_SHARE.0 },
        skew_s: 0.0,
    }
}

fn touched<const N: usize>(design: &DesignMatrix<N>) -> Result<(), Rejection> {
    let least_s = design.touched_s.0.min(design.touched_s.1);
    if least_s < BRIEF_S {
        Err(Rejection::NoLoadReversal)
    } else if least_s < TOUCH_S {
        Err(Rejection::OneSideBrief)
    } else {
        Ok(())
    }
}

fn beliefs<const N: usize>(frame: &Scaling, state: &FrictionState) -> [GaussianPrior; N] {
    let windup_m = frame.windup_m();
    let lack = |(usual, spread): (f64, f64), now: f64| {
        let windup_m = frame.load_n / state.stiffness_n_per_m;
        GaussianPrior { mean: (usual - now) * windup_m, sd: spread * windup_m }
    };
    let zero = |sd: f64| GaussianPrior { mean: 0.0, sd };
    let compliance = if N == CURVED { 2.0 * COMPLIANCE } else { COMPLIANCE };
    std::array::from_fn(|column| match column {
        ORIGIN | GAP => GaussianPrior::NONE,
        FORCE => GaussianPrior { mean: windup_m, sd: compliance * windup_m },
        DRY => lack(FRICTION_DRY, state.friction.dry_n / frame.load_n),
        SHARE => lack(FRICTION_SHARE, state.friction.lost_share),
        // What is left of the skew once the channels are realigned.
        SPEED => GaussianPrior { mean: state.skew_s * SPEED_M_PER_S, sd: SKEW_S * SPEED_M_PER_S },
        LOAD_RATE => zero(SKEW_S / LATE_S * windup_m),
        _ if column < PLACE => zero(DRIFT_M[column - DRIFT]),
        _ if column < LOAD_RATE => zero(PLACE_M),
        _ => zero(BEND_M),
    })
}

fn next<const N: usize>(frame: &Scaling, state: &FrictionState, fit: &RobustFit<N>) -> FrictionState {
    let beta = &fit.beta;
    // The secant at the 95 % load: bends included, or a soft flank would make the force too stiff.
    let secant_m: f64 =
        beta[FORCE] + beta.iter().skip(BEND).zip(design_matrix::bends(1.0)).map(|(b, x)| b * x).sum::<f64>();
    let stiffness = frame.load_n / secant_m.clamp(frame.windup_m() / STRETCH, frame.windup_m() * STRETCH);
    let lacking = |column: usize| beta[column] * stiffness / frame.load_n;
    FrictionState {
        stiffness_n_per_m: stiffness,
        gap_m: beta[GAP].clamp(0.0, WIDEST * frame.windup_m()),
        friction: Friction {
            dry_n: frame.load_n
                * (state.friction.dry_n / frame.load_n + lacking(DRY)).clamp(0.0, MOST_FRICTION),
            lost_share: (state.friction.lost_share + lacking(SHARE)).clamp(0.0, MOST_FRICTION),
        },
        skew_s: state.skew_s - beta[SPEED] / SPEED_M_PER_S,
    }
}
