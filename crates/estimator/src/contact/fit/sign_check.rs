//! Sign and ratio check of the channels, before the regression.

use crate::contact::blocks::block_means::BlockMeans;
use crate::contact::codes::Rejection;
use crate::contact::fit::design_matrix::DesignRow;
use crate::contact::fit::flank_fit::UNSEEN_GAP;
use crate::contact::fit::robust_regression::{GaussianPrior, fit};
use crate::contact::fit::scaling::{SPEED_M_PER_S, Scaling};
use crate::contact::stats::LOOKS;

/// Every fourth block is used, and at most [`LOOKS`] on long flights.
const STRIDE: usize = 4;
/// Slower than this the screw may stick, m/s.
const SLIP_M_PER_S: f64 = 1e-3;
/// The wind-up may be no less than this share of the part's against its sign before it counts as flipped.
const FLIPPED: f64 = 0.3;
/// Two positions of one screw have a slope of one; a lead or a unit that is off by more is a mapping error.
const RATIO: f64 = 0.01;
/// Less than this at the ends of the travel may be the transducer's own error, m.
const TRANSDUCER_M: f64 = 60e-6;

/// A fault of the mapping is stated beyond this many standard errors.
const SIGNIFICANT: f64 = 4.0;
/// A gap is seen beyond this many.
const SEEN: f64 = 3.0;
/// Rounds of reweighting.
const ROUNDS: usize = 4;

/// A stiffness of the part that is off by more than this factor is no start for the fit: it ends at a soft contact.
const STIFFNESS_FACTOR: f64 = 3.0;

const SIDE: usize = 1;
const LOAD: usize = 2;
const SLIP: usize = 3;
const SPEED: usize = 4;
const PLACE: usize = 5;
const COLUMNS: usize = 6;

/// What the check finds in channels that are mapped correctly.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SignCheck {
    /// A stiffness to start from, N/m, where the slope shows that the part's is off by more than a factor of three.
    pub(crate) stiffness_n_per_m: Option<f64>,
    /// Whether δX grows with the load by more than its error: it does not with the load of another actuator.
    pub(crate) follows_load: bool,
    /// Whether δX differs between the two sides of the load by more than its error and a tenth of the wind-up.
    pub(crate) shows_gap: bool,
}

impl SignCheck {
    /// Of channels that are not checked: nothing speaks against them.
    pub(crate) const NONE: Self = Self { stiffness_n_per_m: None, follows_load: true, shows_gap: true };
}

/// Regresses δX on the load, the side it presses to, the sign of the speed, speed and place.
///
/// δX must grow with the load. Where it falls, either the load's sign is flipped or the two positions
/// are swapped; friction separates the two cases, since it opposes the motion of the screw in either case.
///
/// # Errors
/// [`Rejection::PositionRatio`], [`Rejection::LoadSignFlipped`], [`Rejection::PositionsSwapped`].
pub(crate) fn check(blocks: &BlockMeans, frame: &Scaling) -> Result<SignCheck, Rejection> {
    let stride = STRIDE.max(blocks.len() / LOOKS);
    let rows: Vec<DesignRow<COLUMNS>> =
        (1..blocks.len()).step_by(stride).filter_map(|k| row(blocks, frame, k)).collect();
    let Some(found) = fit(&rows, &[GaussianPrior::NONE; COLUMNS], ROUNDS) else {
        return Ok(SignCheck::NONE);
    };
    let beta = &found.beta;
    let error_m = |column: usize| found.standard_error_m(column, &rows);
    let least_m = (RATIO * frame.place_m.1).max(TRANSDUCER_M);
    if beta[PLACE].abs() - SIGNIFICANT * error_m(PLACE) > least_m {
        return Err(Rejection::PositionRatio);
    }
    let windup_m = beta[SIDE] + beta[LOAD];
    let doubt_m = SIGNIFICANT * error_m(SIDE).hypot(error_m(LOAD));
    if windup_m + doubt_m > -FLIPPED * frame.windup_m() {
        return Ok(SignCheck {
            stiffness_n_per_m: other_stiffness(beta[LOAD], SIGNIFICANT * error_m(LOAD), frame),
            follows_load: windup_m > doubt_m,
            shows_gap: beta[SIDE] > (UNSEEN_GAP * frame.windup_m()).max(SEEN * error_m(SIDE)),
        });
    }
    let drag_m = beta[SLIP] + beta[SPEED];
    Err(if drag_m > 0.0 { Rejection::PositionsSwapped } else { Rejection::LoadSignFlipped })
}

/// The stiffness of a wind-up at the 95 % load, m, that is known to `doubt_m`, where the part's is another.
fn other_stiffness(windup_m: f64, doubt_m: f64, frame: &Scaling) -> Option<f64> {
    let is_softer = windup_m - doubt_m > STIFFNESS_FACTOR * frame.windup_m();
    let is_stiffer = windup_m > doubt_m && windup_m + doubt_m < frame.windup_m() / STIFFNESS_FACTOR;
    (is_softer || is_stiffer).then(|| frame.load_n / windup_m)
}

fn row(blocks: &BlockMeans, frame: &Scaling, k: usize) -> Option<DesignRow<COLUMNS>> {
    let (load, speed) = (blocks.load_n[k] / frame.load_n, blocks.speed_m_per_s(k));
    let place = (blocks.motor_m[k] - frame.place_m.0) / frame.place_m.1;
    let slip = if speed.abs() > SLIP_M_PER_S { speed.signum() } else { 0.0 };
    let x = [1.0, 0.5 * load.signum(), load, slip, speed / SPEED_M_PER_S, place];
    let row = DesignRow { x, y_m: blocks.dx_m[k], blocks: 1.0, stretch: blocks.stretch(k) };
    (row.y_m + speed + load + place).is_finite().then_some(row)
}
