//! Lost motion measured rather than extrapolated: at zero load, and at a reference load.

use crate::contact::blocks::block_means::BlockMeans;
use crate::contact::fit::design_matrix::{COLUMNS, DesignRow, FORCE, GAP, RowSource};
use crate::contact::fit::flank_fit::FlankFit;
use crate::contact::fit::scaling::Scaling;
use crate::contact::friction::flank::Flank;
use crate::contact::stats::{MAD, median};

/// Rows this near to the reference load count, as a share of it.
const NEAR: f64 = 0.25;
/// The branches of the loop at zero load: loads this near to zero, as a share of the 95 % load, where the load changes by
/// more than another share of it within this time on either side, s.
const NEAR_ZERO: f64 = 0.05;
const LEAST_TURN: f64 = 0.1;
const TURN_S: f64 = 0.1;
/// A median of a normal sample scatters so much more than its mean: √(π/2).
const MEDIAN: f64 = 1.253_314_137_315_5;
/// Rows on each flank below which a median carries no information.
const FEWEST_ROWS: usize = 5;

/// Standard errors, and metres, by which the flanks of a preloaded nut overlap.
const PRELOAD_SIGMA: f64 = 3.0;
const LEAST_OVERLAP_M: f64 = 2e-6;
/// The loop at zero load of a preloaded nut overlaps by a smaller share than its extrapolated flanks do.
const CLOSED: f64 = 0.5;

/// Force with which both flanks of a preloaded nut press under no load, and its standard error, N: half of the overlap of
/// the flanks times their stiffness.
///
/// While both flanks press, the coupling is twice as stiff. So the flanks, extrapolated from higher loads to zero load,
/// overlap; and lightly loaded contact lies outwards of both, so that the loop closes at zero load.
pub(crate) fn preload_n(contact: &FlankFit) -> Option<(f64, f64)> {
    let (gap_m, gap_se_m) = contact.gap_m;
    let overlap_m = -gap_m;
    let force_n = |length_m: f64| 0.5 * length_m / contact.compliance_m_per_n.0;
    let is_overlap = overlap_m > PRELOAD_SIGMA * gap_se_m && overlap_m > LEAST_OVERLAP_M;
    let closes = || lightly_loaded_m(contact).is_some_and(|loop_m| loop_m > -CLOSED * overlap_m);
    (is_overlap && closes()).then(|| (force_n(overlap_m), force_n(gap_se_m)))
}

/// Width of the loop of δX against the load at zero load and its standard error, m: what lies between the branch on which a
/// load from above falls to zero and the one on which a load from below rises to it. Gap and friction wind-up together.
pub(crate) fn loop_width_m(contact: &FlankFit, blocks: &BlockMeans, scaling: &Scaling) -> Option<(f64, f64)> {
    let reach = ((TURN_S / blocks.period_s).round() as usize).max(1);
    let (near_n, turn_n) = (NEAR_ZERO * scaling.load_n, LEAST_TURN * scaling.load_n);
    let state = &contact.line.at;
    let (mut falling, mut rising) = (Branch::default(), Branch::default());
    for k in reach..blocks.len().saturating_sub(reach) {
        let load_n = blocks.load_n[k] - state.load_zero_n;
        let turned_n = blocks.load_n[k + reach] - blocks.load_n[k - reach];
        let branch = match () {
            () if load_n.abs() > near_n || !blocks.is_complete(k) => continue,
            () if load_n >= 0.0 && turned_n < -turn_n => &mut falling,
            () if load_n <= 0.0 && turned_n > turn_n => &mut rising,
            () => continue,
        };
        let wound_m = load_n * contact.compliance_m_per_n.0;
        branch.add(
            RowSource { blocks, scaling }.without_slow_parts_m(k, &contact.line.fit.beta) - wound_m,
            blocks.stretch(k),
        );
    }
    let (upper, lower) = (falling.median_m()?, rising.median_m()?);
    Some((upper.0 - lower.0, upper.1.hypot(lower.1)))
}

/// Positions on one branch of the loop, and the stretches in which they were seen.
#[derive(Default)]
struct Branch {
    positions_m: Vec<f64>,
    stretches: Vec<u32>,
}

impl Branch {
    fn add(&mut self, position_m: f64, stretch: u32) {
        self.positions_m.push(position_m);
        if self.stretches.last() != Some(&stretch) {
            self.stretches.push(stretch);
        }
    }

    /// Their median, and its standard error with the positions of one stretch taken as one.
    fn median_m(mut self) -> Option<(f64, f64)> {
        (self.positions_m.len() >= FEWEST_ROWS)
            .then(|| median_and_error_m(&mut self.positions_m, self.stretches.len()))
    }
}

/// Lost motion at zero load, friction taken off, from the lightly loaded rows, which the straight fit never saw, m.
fn lightly_loaded_m(contact: &FlankFit) -> Option<f64> {
    let light = &contact.line.design.light;
    let beyond_m = |flank| beyond_m(contact, light.iter(), flank);
    Some(contact.line.fit.beta[GAP] + beyond_m(Flank::Upper)?.0 + beyond_m(Flank::Lower)?.0)
}

/// Relative travel between + and − a load in the coupling and its standard error, m: rows near it on either
/// flank, drift, skew and transducer error taken off, brought to the load itself along the fitted line.
pub(crate) fn lost_motion_m(contact: &FlankFit, frame: &Scaling, load_n: f64) -> Option<(f64, f64)> {
    let load = load_n / frame.load_n;
    let near = |row: &&DesignRow<COLUMNS>| (row.x[FORCE].abs() - load).abs() < NEAR * load;
    let rows = &contact.line.design;
    let beyond_m = |flank| beyond_m(contact, rows.firm.iter().chain(&rows.light).filter(near), flank);
    let beta = &contact.line.fit.beta;
    let line_m = beta[GAP] + 2.0 * load * beta[FORCE];
    Some(put_together(contact, line_m, beyond_m(Flank::Upper)?, beyond_m(Flank::Lower)?))
}

/// Lost motion: a travel along the fitted line, and the distances of both flanks beyond it. The uncertainty of the gap
/// (drift, transducer, friction) applies here too; the scatter of the medians is added.
fn put_together(contact: &FlankFit, line_m: f64, upper: (f64, f64), lower: (f64, f64)) -> (f64, f64) {
    (line_m + upper.0 + lower.0, contact.gap_m.1.hypot(upper.1.hypot(lower.1)))
}

/// How far outwards of the fitted line the rows of a flank lie, m: their median, and its standard error with
/// the rows of one stretch taken as one.
fn beyond_m<'a>(
    contact: &FlankFit,
    rows: impl Iterator<Item = &'a DesignRow<COLUMNS>>,
    flank: Flank,
) -> Option<(f64, f64)> {
    let (mut outward_m, mut stretches): (Vec<f64>, Vec<u32>) = rows
        .filter(|row| row.x[GAP] * flank.sign() > 0.0)
        .map(|row| (flank.sign() * contact.line.fit.residual_m(row), row.stretch))
        .unzip();
    if outward_m.len() < FEWEST_ROWS {
        return None;
    }
    stretches.sort_unstable();
    stretches.dedup();
    Some(median_and_error_m(&mut outward_m, stretches.len()))
}

/// The median of some values and its standard error for a number of independent ones, m.
fn median_and_error_m(values_m: &mut [f64], independent: usize) -> (f64, f64) {
    let median_m = median(values_m);
    values_m.iter_mut().for_each(|e| *e = (*e - median_m).abs());
    (median_m, MEDIAN * MAD * median(values_m) / (independent as f64).sqrt())
}
