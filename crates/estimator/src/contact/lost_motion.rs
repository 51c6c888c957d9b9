//! Lost motion measured rather than extrapolated: at zero load, and at a reference load.

use crate::contact::block_means::BlockMeans;
use crate::contact::fit::design_matrix::{COLUMNS, DesignRow, FIRM_SHARE, FORCE, GAP};
use crate::contact::fit::flank_fit::FlankFit;
use crate::contact::fit::scaling::Scaling;
use crate::contact::stats::{median, median_and_error};

/// Speed of the motor from which the screw moves with it for certain, m/s.
const LEAST_SPEED_M_PER_S: f64 = 1e-3;

/// Force with which both flanks of a preloaded nut press under no load, and its standard error, N: half of the overlap of
/// the flanks times their stiffness.
///
/// While both flanks press, the coupling is twice as stiff. So the flanks, extrapolated from higher loads to zero load,
/// overlap; and contact under loads below the preload lies outwards of both, so that the loop closes at zero load. A preload
/// beyond the 95 % load would leave no flank to extrapolate; one of a few per cent may leave no rows below it.
pub(crate) fn preload_n(contact: &FlankFit, scaling: &Scaling) -> Option<(f64, f64)> {
    let (gap_m, gap_se_m) = contact.gap_m;
    let overlap_m = -gap_m;
    if overlap_m < (3.0 * gap_se_m).max(2e-6) {
        return None;
    }
    let force_n = |length_m: f64| 0.5 * length_m / contact.compliance_m_per_n;
    let share = force_n(overlap_m) / scaling.load_n;
    let rows = contact.search.line.design.light.iter().chain(&contact.search.line.design.firm);
    let closes = match travel_m(contact, 0.0, &rows.filter(|row| row.x[FORCE].abs() < share)) {
        // A closed loop overlaps by less than half of what the extrapolated flanks do.
        Some((travel_m, _)) => share < 1.0 && travel_m > -0.5 * overlap_m,
        None => share < FIRM_SHARE,
    };
    closes.then(|| (force_n(overlap_m), force_n(gap_se_m)))
}

/// Width of the loop of δX against the load at zero load and its standard error, m: what lies between the branch on which a
/// load from above falls to zero and the one on which a load from below rises to it. Gap and friction wind-up together.
///
/// Loads within 5 % of the 95 % load count, where the load changes by more than 10 % of it from 0.1 s before to 0.1 s after.
/// On such a branch the screw's friction must press the flank that the load leaves: a screw that moves the other way has left
/// it before. Each position is compared with the passage along the other branch before it, so that what moves both from loop
/// to loop is no width. A loop narrower than the gap is none: its branches were not seen.
pub(crate) fn loop_width_m(contact: &FlankFit, blocks: &BlockMeans, scaling: &Scaling) -> Option<(f64, f64)> {
    let reach = ((0.1 / blocks.period_s).round() as usize).max(1);
    let (near_n, turn_n) = (0.05 * scaling.load_n, 0.1 * scaling.load_n);
    // The side that the load comes from, and the position on its branch. Within a gap the load is noise about zero.
    let on_branch = |k: usize| {
        let [before_n, load_n, after_n] =
            [k - reach, k, k + reach].map(|k| blocks.load_n[k] - contact.search.line.at.load_zero_n);
        let side = load_n.signum();
        let turns = side * before_n > near_n && side * (after_n - before_n) < -turn_n;
        let is_pressed = || scaling.is_locked() || side * blocks.speed_m_per_s(k) < -LEAST_SPEED_M_PER_S;
        let position_m = || {
            blocks.without_slow_parts_m(scaling, k, &contact.search.line.fit.beta)
                - load_n * contact.compliance_m_per_n
        };
        let is_on_branch = load_n.abs() <= near_n && turns && is_pressed();
        is_on_branch.then(position_m).filter(|m| m.is_finite()).map(|m| (side, m, blocks.stretch(k)))
    };
    let positions: Vec<_> = (reach..blocks.len().saturating_sub(reach)).filter_map(on_branch).collect();
    let passages: Vec<_> = positions.chunk_by(|(before, ..), (side, ..)| before * side > 0.0).collect();
    let widths = passages.array_windows().flat_map(|[before, passage]| {
        let before_m = median(&mut before.iter().map(|(_, m, _)| *m).collect::<Vec<_>>());
        passage.iter().map(move |(side, m, stretch)| (side * (m - before_m), *stretch))
    });
    let (width_m, error_m) = median_and_error(widths)?;
    let error_m = error_m.hypot(contact.unexplained_m);
    let (gap_m, gap_se_m) = contact.gap_m;
    (width_m > gap_m - 3.0 * error_m.hypot(gap_se_m)).then_some((width_m, error_m))
}

/// Relative travel between + and − a load in the coupling and its standard error, m: rows within 25 % of it on either
/// flank, drift, skew and transducer error taken off, brought to the load itself along the fitted line.
pub(crate) fn lost_motion_m(contact: &FlankFit, scaling: &Scaling, load_n: f64) -> Option<(f64, f64)> {
    let load = load_n / scaling.load_n;
    let rows = contact.search.line.design.firm.iter().chain(&contact.search.line.design.light);
    travel_m(contact, load, &rows.filter(move |row| (row.x[FORCE].abs() - load).abs() < 0.25 * load))
}

/// Relative travel between plus and minus a load, given as a share of the 95 % load, and its standard error, m: travel of
/// the fitted line, and how far outwards of it the rows of either flank lie.
fn travel_m<'a>(
    contact: &FlankFit,
    load: f64,
    rows: &(impl Iterator<Item = &'a DesignRow<COLUMNS>> + Clone),
) -> Option<(f64, f64)> {
    let line = &contact.search.line.fit;
    let beyond_m = |side: f64| {
        let of_flank = rows.clone().filter(|row| row.x[GAP] * side > 0.0);
        median_and_error(of_flank.map(|row| (side * line.residual_m(row), row.stretch)))
    };
    let (upper, lower) = (beyond_m(1.0)?, beyond_m(-1.0)?);
    let line_m = line.beta[GAP] + 2.0 * load * line.beta[FORCE];
    // The uncertainty of the gap (drift, transducer, friction) applies here too; the scatter of the medians is added.
    Some((line_m + upper.0 + lower.0, contact.gap_m.1.hypot(upper.1.hypot(lower.1))))
}
