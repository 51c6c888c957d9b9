//! Sign and ratio check of the channels, before the regression.

use crate::contact::block_means::BlockMeans;
use crate::contact::codes::Rejection;
use crate::contact::fit::design_matrix::DesignRow;
use crate::contact::fit::robust_regression::{GaussianPrior, RobustFit, fit};
use crate::contact::fit::scaling::{SPEED_M_PER_S, Scaling, UNSEEN_GAP};
use crate::contact::stats::LOOKS;

/// A fault of the mapping is stated beyond this many standard errors.
const SIGNIFICANT: f64 = 4.0;

/// What the check finds in channels that are mapped correctly.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SignCheck {
    /// Whether δX grows with the load by more than its error: it does not with the load of another actuator.
    pub(crate) follows_load: bool,
    /// Whether δX differs between the two sides of the load by more than its error and a tenth of the wind-up.
    pub(crate) shows_gap: bool,
}

impl SignCheck {
    /// Of channels that are not checked: nothing speaks against them.
    pub(crate) const NONE: Self = Self { follows_load: true, shows_gap: true };
}

/// Regresses δX on the load, the side it presses to, the sign of the speed, speed, place and time.
///
/// δX must grow with the load. Where it falls, either the load's sign is flipped or the two positions
/// are swapped; friction separates the two cases, since it opposes the motion of the screw in either case. Where the slope
/// shows that the part's stiffness is off by more than a factor of three, the fit starts from the stiffness of the slope:
/// from the part's it would end at a soft contact.
///
/// # Errors
/// [`Rejection::PositionRatio`], [`Rejection::LoadSignFlipped`], [`Rejection::PositionsSwapped`].
pub(crate) fn check(blocks: &BlockMeans, scaling: &mut Scaling) -> Result<SignCheck, Rejection> {
    // The motor's own load, on a bench, shows nothing of the mapping.
    if scaling.is_locked() {
        return Ok(SignCheck::NONE);
    }
    let Some((found, rows)) = regress(blocks, scaling, 0.0) else { return Ok(SignCheck::NONE) };
    let [_, side_m, load_m, slip_m, speed_m, place_m, _] = found.beta;
    let [side_se_m, load_se_m, place_se_m] =
        [1, 2, 5].map(|column| found.standard_error_m(&[(column, 1.0)], &rows));
    // Two positions of one screw have a slope of one. A slope that differs by 1 % means another lead or unit; a difference
    // of less than 60 µm at the ends of the travel may be the transducer's own error. Where the load follows the place, as
    // in calm air, errors that the regression does not know move this slope by more, the less of the place is its own.
    let own_share = found.own_share(5, &rows);
    scaling.tied_share = 1.0 - own_share;
    let own_error_m = 60e-6 / own_share.sqrt();
    if place_m.abs() - SIGNIFICANT * place_se_m > (0.01 * scaling.place_m.1).max(own_error_m) {
        return Err(Rejection::PositionRatio);
    }
    let windup_m = side_m + load_m;
    let doubt_m = SIGNIFICANT * side_se_m.hypot(load_se_m);
    // A wind-up that is negative for certain, by 30 % of the part's, is that of flipped or exchanged channels; but not where
    // δX grows with the load on one side, and touches of the other are few.
    if windup_m + doubt_m > -0.3 * scaling.windup_m() || load_m > SIGNIFICANT * load_se_m {
        let shows_gap = side_m > (UNSEEN_GAP * scaling.windup_m()).max(3.0 * side_se_m);
        let (load_doubt_m, part_m) = (SIGNIFICANT * load_se_m, scaling.windup_m());
        let is_softer = load_m - load_doubt_m > 3.0 * part_m;
        let is_stiffer = load_m > load_doubt_m && load_m + load_doubt_m < part_m / 3.0;
        if is_softer || is_stiffer {
            scaling.stiffness_n_per_m = scaling.load_n / load_m;
        }
        return Ok(SignCheck { follows_load: windup_m > doubt_m, shows_gap });
    }
    Err(if slip_m + speed_m > 0.0 { Rejection::PositionsSwapped } else { Rejection::LoadSignFlipped })
}

/// Mean size of the residuals of the regression with the sides of a load zero, m: it is least where δX jumps, which is at the
/// zero of the load cell.
pub(crate) fn misfit_m(blocks: &BlockMeans, scaling: &Scaling, load_zero_n: f64) -> f64 {
    regress(blocks, scaling, load_zero_n).map_or(f64::INFINITY, |(found, rows)| {
        rows.iter().map(|row| found.residual_m(row).abs()).sum::<f64>() / rows.len() as f64
    })
}

/// The regression and its rows. Every fourth block is used, and fewer of long flights.
fn regress(
    blocks: &BlockMeans,
    scaling: &Scaling,
    load_zero_n: f64,
) -> Option<(RobustFit<7>, Vec<DesignRow<7>>)> {
    let stride = (blocks.len() / LOOKS).max(4);
    let looks = (1..blocks.len()).step_by(stride);
    let rows: Vec<_> = looks.filter_map(|k| row(blocks, scaling, load_zero_n, k)).collect();
    Some((fit(&rows, &[GaussianPrior::NONE; 7], 4, false)?, rows))
}

fn row(blocks: &BlockMeans, scaling: &Scaling, load_zero_n: f64, k: usize) -> Option<DesignRow<7>> {
    let (load, speed) = ((blocks.load_n[k] - load_zero_n) / scaling.load_n, blocks.speed_m_per_s(k));
    let place = (blocks.motor_m[k] - scaling.place_m.0) / scaling.place_m.1;
    // Slower than 1 mm/s the screw may stick.
    let slip = if speed.abs() > 1e-3 { speed.signum() } else { 0.0 };
    let time = scaling.time_share(blocks.time_s[k]);
    let x = [1.0, 0.5 * load.signum(), load, slip, speed / SPEED_M_PER_S, place, time];
    let row = DesignRow { x, y_m: blocks.dx_m[k], blocks: 1.0, stretch: blocks.stretch(k) };
    (row.y_m + speed + load + place).is_finite().then_some(row)
}
