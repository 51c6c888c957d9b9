//! The gap along the stroke: a screw wears where it works.
//!
//! Where the residuals of the fit with one gap show that the gap depends on the place, the regression is repeated with
//! two more terms at each knot along the stroke: of the gap and of the transducer's error, linear between knots.

use crate::contact::block_means::BlockMeans;
use crate::contact::fit::design_matrix::{COLUMNS, DesignRow, GAP, PLACE, dot};
use crate::contact::fit::gauss_newton::{self, GaussNewtonResult};
use crate::contact::fit::robust_regression::{GaussianPrior, REWEIGHTINGS, fit};
use crate::contact::fit::scaling::Scaling;
use crate::contact::types::GapAtPlace;

/// Number of knots, evenly spaced over the range of screw positions in the flight.
const KNOTS: usize = 9;
/// Columns with a gap and an error at each knot.
const ALL: usize = COLUMNS + 2 * KNOTS;
/// Standard errors by which the largest gap must exceed the mean, and by which no gap is below zero.
const CERTAIN: f64 = 4.0;
/// Share of the flight's time that the screw must spend near a knot for the knot to count.
const VISITED: f64 = 0.05;

/// A gap that varies along the stroke.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct StrokeProfile {
    /// Mean over the time that the screw spent at each place, and its standard error, m.
    pub(crate) mean_m: (f64, f64),
    /// Gaps at the knots where the screw spent at least [`VISITED`] of the time.
    pub(crate) places: Vec<GapAtPlace>,
    /// By how much the gap at each knot exceeds that of the fit with one gap, m.
    beyond_m: [f64; KNOTS],
}

impl StrokeProfile {
    /// By how much the gap at a place from −1 to 1 exceeds that of the fit with one gap, m.
    pub(crate) fn beyond_m(&self, place: f64) -> f64 {
        dot(&self.beyond_m, &hats(place))
    }
}

/// The profile of a flight; `None` unless its largest gap exceeds the mean by [`CERTAIN`] standard errors and by 10 %.
pub(crate) fn stroke_profile(
    line: &GaussNewtonResult,
    blocks: &BlockMeans,
    scaling: &Scaling,
) -> Option<StrokeProfile> {
    if scaling.per_place == 0.0 || !is_suspect(line) {
        return None;
    }
    let rows: Vec<DesignRow<ALL>> = line.design.firm.iter().map(with_knots).collect();
    let known = gauss_newton::priors(scaling, &line.at);
    // Prior standard deviation of the gap, and of the transducer's error, at a knot about the value of the whole stroke, m.
    let priors: [GaussianPrior; ALL] = std::array::from_fn(|column| match column {
        0..COLUMNS => known[column],
        _ if column < COLUMNS + KNOTS => GaussianPrior::zero(60e-6),
        _ => GaussianPrior::zero(10e-6),
    });
    let found = fit(&rows, &priors, REWEIGHTINGS, true)?;
    let shares = time_shares(blocks, scaling);
    let value_m = |weights: &[f64; KNOTS]| -> f64 { found.beta[GAP] + dot(weights, &found.beta[COLUMNS..]) };
    let error_m = |gap: f64, weights: &[f64; KNOTS]| {
        let knots = (COLUMNS..).zip(weights.iter().copied());
        let terms: Vec<(usize, f64)> = knots.chain(std::iter::once((GAP, gap))).collect();
        found.standard_error_m(&terms, &rows)
    };
    let only = |knot: usize| -> [f64; KNOTS] { std::array::from_fn(|k| f64::from(u8::from(k == knot))) };
    let mean_m = value_m(&shares);
    let visited = || (0..KNOTS).filter(|&k| shares[k] >= VISITED);
    let at = visited().map(only).max_by(|a, b| value_m(a).total_cmp(&value_m(b)))?;
    let excess: [f64; KNOTS] = std::array::from_fn(|k| at[k] - shares[k]);
    let excess_m = value_m(&at) - mean_m;
    let is_certain = excess_m > CERTAIN * error_m(0.0, &excess) && excess_m > 0.1 * mean_m.abs();
    let place = |knot: usize| GapAtPlace {
        at_m: scaling.place_m.0 + scaling.place_m.1 * (2.0 * knot as f64 / (KNOTS - 1) as f64 - 1.0),
        gap_m: value_m(&only(knot)),
        gap_se_m: error_m(1.0, &only(knot)),
    };
    let places: Vec<GapAtPlace> = visited().map(place).collect();
    // Where the load follows the place, each place shows one flank only: a gap far below zero is then an error of the fit.
    let is_possible = places.iter().all(|at| at.gap_m > -CERTAIN * at.gap_se_m);
    (is_certain && is_possible).then(|| StrokeProfile {
        mean_m: (mean_m, error_m(1.0, &shares)),
        places,
        beyond_m: std::array::from_fn(|knot| value_m(&only(knot)) - line.fit.beta[GAP]),
    })
}

/// Whether the rows near some knot lie outwards, or inwards, of both flanks by more than 1 µm and 2 % of the gap.
fn is_suspect(line: &GaussNewtonResult) -> bool {
    let (mut sums_m, mut blocks) = ([0.0; KNOTS], [0.0; KNOTS]);
    for row in &line.design.firm {
        let outward_m = row.x[GAP].signum() * line.fit.residual_m(row);
        for (knot, share) in hats(row.x[PLACE]).into_iter().enumerate() {
            sums_m[knot] += share * row.blocks * outward_m;
            blocks[knot] += share * row.blocks;
        }
    }
    let (all, gap_m) = (blocks.iter().sum::<f64>(), line.fit.beta[GAP].abs());
    let is_off = |k: &usize| sums_m[*k].abs() > (1e-6 + 0.02 * gap_m) * blocks[*k];
    (0..KNOTS).filter(|&k| blocks[k] > VISITED * all).any(|k| is_off(&k))
}

/// A row extended by the columns of gap and transducer error at each knot.
fn with_knots(row: &DesignRow<COLUMNS>) -> DesignRow<ALL> {
    let mut x = [0.0; ALL];
    x[..COLUMNS].copy_from_slice(&row.x);
    for (knot, share) in hats(row.x[PLACE]).into_iter().enumerate() {
        x[COLUMNS + knot] = share * row.x[GAP];
        x[COLUMNS + KNOTS + knot] = share;
    }
    DesignRow { x, y_m: row.y_m, blocks: row.blocks, stretch: row.stretch }
}

/// Interpolation weight of each knot at a place from −1 to 1: linear between neighbours.
fn hats(place: f64) -> [f64; KNOTS] {
    let at = (0.5 * (place.clamp(-1.0, 1.0) + 1.0)) * (KNOTS - 1) as f64;
    std::array::from_fn(|knot| (1.0 - (at - knot as f64).abs()).max(0.0))
}

/// Share of the time that the screw spent near each knot.
fn time_shares(blocks: &BlockMeans, scaling: &Scaling) -> [f64; KNOTS] {
    let mut shares = [0.0; KNOTS];
    let mut all = 0.0;
    for (motor_m, dx_m) in blocks.motor_m.iter().zip(&blocks.dx_m) {
        let place = scaling.place_share(motor_m + dx_m);
        if place.is_finite() {
            shares.iter_mut().zip(hats(place)).for_each(|(sum, share)| *sum += share);
            all += 1.0;
        }
    }
    shares.map(|sum| sum / f64::max(all, 1.0))
}
