//! Lost motion measured rather than extrapolated: at zero load, and at a reference load.

use crate::contact::fit::design_matrix::{COLUMNS, DesignRow, FORCE, GAP};
use crate::contact::fit::flank_fit::FlankFit;
use crate::contact::fit::scaling::Scaling;
use crate::contact::friction::flank::Flank;
use crate::contact::stats::{MAD, median};

/// Rows this near to the reference load count, as a share of it.
const NEAR: f64 = 0.25;
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
    let closes = || loop_width_m(contact).is_some_and(|(loop_m, _)| loop_m > -CLOSED * overlap_m);
    (is_overlap && closes()).then(|| (force_n(overlap_m), force_n(gap_se_m)))
}

/// Lost motion at zero load and its standard error, m, from the lightly loaded rows, which the straight fit
/// never saw.
pub(crate) fn loop_width_m(contact: &FlankFit) -> Option<(f64, f64)> {
    let light = &contact.line.design.light;
    let beyond_m = |flank| beyond_m(contact, light.iter(), flank);
    Some(put_together(contact, contact.line.fit.beta[GAP], beyond_m(Flank::Upper)?, beyond_m(Flank::Lower)?))
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
    let median_m = median(&mut outward_m);
    outward_m.iter_mut().for_each(|e| *e = (*e - median_m).abs());
    let spread_m = MAD * median(&mut outward_m);
    Some((median_m, MEDIAN * spread_m / (stretches.len() as f64).sqrt()))
}
