//! The fit of both flanks: gap, stiffness and their standard errors.
//!
//! The gap is the distance of the two flanks, extrapolated along their stiff part to zero load. Flanks that are soft at
//! low load bend inwards there, so that a fit of higher loads alone reads a wider gap. The gap lies between those of a
//! fit of all loads and of one of higher loads. Where they differ by less than √2 jackknife errors of their difference,
//! it is nearer to that of all loads, which rests on more data; where they differ by more, to that of higher loads. Only a
//! preloaded nut, whose flanks overlap, is stiffer at low load: where higher loads read a gap that is narrower and above
//! zero, the logged load is less than the true one there. The gap is then that of all loads, and the difference joins its
//! error.

use std::ops::Range;

use crate::contact::block_means::{BlockMeans, SHORTEST_S};
use crate::contact::codes::Rejection;
use crate::contact::fit::design_matrix::{
    COLUMNS, DRY, DesignRow, FIRM_SHARE, FORCE, GAP, PERIODIC, PLACE, dot, less_pressed, less_pressed_blocks,
};
use crate::contact::fit::gauss_newton::{GaussNewtonResult, rejection_of_contact, search};
use crate::contact::fit::parameter_search::{ParameterSearch, SearchResult};
use crate::contact::fit::robust_regression::REWEIGHTINGS;
use crate::contact::fit::scaling::{SEARCH_ROW_S, Scaling, UNSEEN_GAP};
use crate::contact::fit::stroke_profile::{StrokeProfile, stroke_profile};
use crate::contact::friction::coupling_path::integrate;
use crate::contact::friction::friction_model::FrictionState;
use crate::contact::load_jump::load_jump_n;
use crate::contact::stats::{LOOKS, second_differences};
use crate::gap::load_band::reversals;
use crate::gap::midrange;
use crate::kalman::Filter;
use crate::model::{ActuatorModel, NoiseModel, SensorNoise};
use crate::samples::Samples;

/// Largest error of the load cell's zero that is to be expected, over the 95 % load.
const ZERO_ERROR: f64 = 0.45;
/// Blocks that the search begins with.
const EXCERPT_BLOCKS: usize = 6000;
/// Blocks up to which the filter, and another iteration, over the whole flight are cheap.
const SHORT_BLOCKS: usize = 10 * EXCERPT_BLOCKS;
/// Share of the 95 % load beyond which flanks are stiff.
const STIFF_SHARE: f64 = 0.3;
/// Rms of a position sensor's error along the stroke that no column describes, over the scatter about the fit.
const OWN_ERROR: f64 = 2.0;
/// Scatter about the fit, over half of the motor's travel and over the wind-up, beyond both of which an output is not locked.
const MOVES: (f64, f64) = (0.1, 5.0);
/// Groups of rows that the jackknife leaves out in turn.
const GROUPS: usize = 10;

/// Scratch memory of a regression, reused from flight to flight.
#[derive(Debug, Default)]
pub struct ContactWorkspace {
    pub(crate) whole: BlockMeans,
    excerpt: BlockMeans,
}

/// The fitted flanks.
#[derive(Debug)]
pub(crate) struct FlankFit {
    /// ΔS and its standard error, m.
    pub(crate) gap_m: (f64, f64),
    /// 1/K, m/N.
    pub(crate) compliance_m_per_n: f64,
    /// The gap along the stroke, where it varies.
    pub(crate) profile: Option<StrokeProfile>,
    /// Whether higher loads alone read a wider gap, by more than 2.3 jackknife errors.
    pub(crate) is_soft: bool,
    /// Whether they read a narrower one, by as much.
    pub(crate) load_bends: bool,
    /// Travel that neither gap nor wind-up accounts for, m: a part of the error of the gap and of the loop.
    pub(crate) unexplained_m: f64,
    /// Whether a jump of the load cell's reading at zero load contributes most to the error of the gap.
    pub(crate) load_jumps: bool,
    /// The fit of the whole flight with its rows, and the result of the search.
    pub(crate) search: SearchResult,
}

impl FlankFit {
    /// What δX holds in addition to gap and wind-up, m: drift, skew, transducer error and wrong friction.
    pub(crate) fn other_m(&self, row: &DesignRow<COLUMNS>) -> f64 {
        dot(&self.search.line.fit.beta[DRY..], &row.x[DRY..])
    }
}

/// Fits the flanks.
///
/// # Errors
/// As [`search`]; [`Rejection::RateTooLow`] for a load that vibrates faster than it is sampled, so that neighbouring
/// samples lie on different flanks; and [`Rejection::MotionUnexplained`].
pub(crate) fn fit(
    samples: &Samples<'_>,
    workspace: &mut ContactWorkspace,
    scaling: &Scaling,
) -> Result<FlankFit, Rejection> {
    let search = coarse_to_fine(workspace, scaling)?;
    let windup_m = scaling.windup_m();
    let [squares, _, count] = second_differences(workspace.whole.load_n.iter().copied());
    let vibration_n = (squares / count.max(1.0)).sqrt();
    // The load reverses between samples, and the residuals show that blocks mix both flanks.
    if vibration_n > 0.3 * scaling.load_n && search.scale_m > 0.16 * windup_m {
        return Err(Rejection::RateTooLow);
    }
    // Positions of a locked output are explained by its load, or the output moves.
    if scaling.is_locked() && search.scale_m > (MOVES.0 * scaling.place_m.1).max(MOVES.1 * windup_m) {
        return Err(Rejection::MotionUnexplained);
    }
    let profile = stroke_profile(&search.line, &workspace.whole, scaling);
    let (gap_m, sigma) = gap_and_error_m(&search, profile.as_ref(), vibration_n, scaling, &workspace.whole);
    let mut fit = FlankFit {
        gap_m,
        profile,
        compliance_m_per_n: search.line.fit.beta[FORCE] / scaling.load_n,
        is_soft: sigma > 2.3,
        load_bends: sigma < -2.3 && gap_m.0 > 0.0,
        unexplained_m: 0.0,
        load_jumps: false,
        search,
    };
    if gap_m.0 < UNSEEN_GAP * windup_m {
        check_both_sides(&workspace.whole, scaling, false)?;
    }
    fit.unexplained_m = unexplained_m(&mut workspace.excerpt, scaling, &fit);
    // The load of a bench is no other actuator's: travel that no flank accounts for may be the gap's.
    if fit.unexplained_m > 0.0 && !scaling.is_locked() {
        return Err(Rejection::MotionUnexplained);
    }
    fit.gap_m.1 = fit.gap_m.1.hypot(fit.unexplained_m);
    // The fit moved both flanks inwards by half of a jump over the stiffness.
    let zero_n = fit.search.line.at.load_zero_n;
    let jump_m = fit.compliance_m_per_n * load_jump_n(samples, &workspace.excerpt, zero_n, scaling.load_n);
    fit.load_jumps = jump_m > fit.gap_m.1;
    fit.gap_m.1 = fit.gap_m.1.hypot(jump_m);
    Ok(fit)
}

/// Whether the logged load presses on both flanks for long enough.
///
/// Without a gap nothing in a flight shows the zero of its load cell. A flank then counts as pressed under loads that no
/// zero error explains: a load that only seems to change its side shows no gap either.
pub(crate) fn check_both_sides(
    blocks: &BlockMeans,
    scaling: &Scaling,
    shows_gap: bool,
) -> Result<(), Rejection> {
    let share = if shows_gap { FIRM_SHARE } else { ZERO_ERROR };
    let beyond = less_pressed_blocks(blocks.load_n.iter().copied(), share * scaling.load_n);
    rejection_of_contact(beyond * blocks.period_s)
}

/// The published mid-range statistic (equations 18–31) of the block means, m, with what the regression found: stiffness,
/// load zero and delays, drift and transducer error taken off. `None` if the filter fails.
///
/// One outlying stretch of S moves the mid-range: of the whole flight, where it is short, and of its excerpt the nearer
/// value to the gap is taken. Mass and damping of the screw move it by less than 0.1 %: those of a mode of 400 Hz serve.
pub(crate) fn midrange_at_fit_m(
    workspace: &ContactWorkspace,
    scaling: &Scaling,
    fit: &FlankFit,
) -> Option<f64> {
    let ContactWorkspace { whole, excerpt } = workspace;
    let of = |blocks: &BlockMeans| midrange_of_m(blocks, scaling, fit);
    let of_whole = if whole.len() < SHORT_BLOCKS { of(whole) } else { None };
    let of_excerpt = if whole.is_longer(EXCERPT_BLOCKS) { of(excerpt) } else { None };
    let off_m = |midrange_m: &f64| (midrange_m - fit.gap_m.0).abs();
    of_whole.into_iter().chain(of_excerpt).min_by(|a, b| off_m(a).total_cmp(&off_m(b)))
}

fn midrange_of_m(blocks: &BlockMeans, scaling: &Scaling, fit: &FlankFit) -> Option<f64> {
    let beta = &fit.search.line.fit.beta;
    let dx_m: Vec<f64> = (0..blocks.len()).map(|k| blocks.without_slow_parts_m(scaling, k, beta)).collect();
    let load_n: Vec<f64> =
        blocks.load_n.iter().map(|load_n| load_n - fit.search.line.at.load_zero_n).collect();
    let stiffness_n_per_m = fit.compliance_m_per_n.recip();
    // A damping ratio of 0.7: a mode that rings between two samples would outlast them.
    let (damping, mode_rad_per_s) = (1.4, 2500.0);
    let actuator = ActuatorModel::linear(
        stiffness_n_per_m,
        damping * stiffness_n_per_m / mode_rad_per_s,
        stiffness_n_per_m / (mode_rad_per_s * mode_rad_per_s),
    );
    let noise = NoiseModel::Sensors(SensorNoise {
        screw_rms_m: fit.search.scale_m,
        unknown_force_n: scaling.unknown_force_n,
        bandwidth_hz: 10.0,
        ..SensorNoise::default()
    });
    let filter = Filter::new(&actuator.ok()?, blocks.period_s, &noise).ok()?;
    let samples = Samples {
        step_s: blocks.period_s,
        motor_m: &blocks.motor_m,
        dx_m: &dx_m,
        load_n: &load_n,
        segments: &blocks.segments,
    };
    midrange::estimate(&samples, &filter).ok().map(|found| found.gap.gap_m)
}

/// Searches with long rows, in an excerpt as long as it must be, and iterates over the whole with short rows from there.
fn coarse_to_fine(workspace: &mut ContactWorkspace, scaling: &Scaling) -> Result<SearchResult, Rejection> {
    let ContactWorkspace { whole, excerpt } = workspace;
    let coarse = Scaling { row_s: SEARCH_ROW_S, ..*scaling };
    let mut blocks = EXCERPT_BLOCKS;
    let best = loop {
        excerpt.excerpt_of(whole, scaling.load_n, blocks);
        excerpt.find_phases(scaling.per_period);
        let can_grow = blocks == EXCERPT_BLOCKS && whole.is_longer(blocks);
        match ParameterSearch::new(excerpt, &coarse, can_grow).run() {
            Ok(best) => break best,
            Err(why) if !whole.is_longer(blocks) => {
                return Err(rejection_without_rows(excerpt, scaling, why));
            }
            // Too little contact: a longer excerpt may show more.
            Err(_) => blocks *= 4,
        }
    };
    if is_periodic(&best.line) {
        whole.find_phases(scaling.per_period);
    }
    let iterations = if whole.len() < SHORT_BLOCKS { 2 } else { 1 };
    let line = search(whole, scaling, best.line.state, iterations, REWEIGHTINGS)?;
    Ok(SearchResult { line, ..best })
}

/// Why the rows of an excerpt do not show both flanks although both are pressed for two seconds: touches shorter than four
/// blocks give no row, nor do loads that pile up.
fn rejection_without_rows(blocks: &BlockMeans, scaling: &Scaling, why: Rejection) -> Rejection {
    let forces_n: Vec<f64> = blocks.couplings.iter().map(|coupling| coupling.force_n).collect();
    let least_n = FIRM_SHARE * scaling.load_n;
    let pressed = less_pressed_blocks(forces_n.iter().copied(), least_n);
    if pressed * blocks.period_s <= 2.0 {
        return why;
    }
    // Each reversal ends a touch; every other touch is of the less pressed flank.
    if pressed < 2.0 * reversals(&forces_n, least_n) as f64 {
        return Rejection::RateTooLow;
    }
    let complete = (0..blocks.len()).filter(|k| blocks.is_complete(*k)).count();
    if blocks.is_clipped() {
        Rejection::LoadHeld
    } else if (complete as f64) * blocks.period_s < SHORTEST_S {
        Rejection::TooShort
    } else {
        why
    }
}

/// Whether errors that repeat with the position are significant and larger than 0.2 µm.
fn is_periodic(found: &GaussNewtonResult) -> bool {
    [PERIODIC, PERIODIC + 1].into_iter().any(|column| {
        let size_m = found.fit.beta[column].abs();
        size_m > 2e-7 && size_m > 3.0 * found.fit.standard_error_m(&[(column, 1.0)], &found.design.firm)
    })
}

/// The gap and its standard error, m, and by how many errors the fit of higher loads reads it wider.
///
/// The error has three parts: the jackknife error; the spread of the candidates, which are those of the parameter search
/// and both fits as far as their difference is significant and no softer flank than a load cell may show; and what no
/// flight averages out: a share of the wind-up, and friction between two samples that the load's slow part does not show.
/// It grows with few changes of the flank, with heavy friction, and with a clipped load cell.
fn gap_and_error_m(
    search: &SearchResult,
    profile: Option<&StrokeProfile>,
    vibration_n: f64,
    scaling: &Scaling,
    whole: &BlockMeans,
) -> ((f64, f64), f64) {
    let line = &search.line;
    let rows = &line.design.firm;
    let groups = groups(rows);
    let refit = |least: f64| line.fit.leave_one_out(GAP, rows, &groups, (FORCE, least));
    let low = refit(FIRM_SHARE);
    // A fit of higher loads alone asks for enough rows of either flank.
    let stiff = rows.iter().filter(|row| row.x[FORCE].abs() >= STIFF_SHARE);
    let all: f64 = rows.iter().map(|row| row.blocks).sum();
    let high = if less_pressed(stiff, 1.0) > 0.05 * all { refit(STIFF_SHARE) } else { None };
    let jackknife_m = low.as_ref().map_or_else(
        || line.fit.standard_error_m(&[(GAP, 1.0)], rows),
        |(_, parts)| jackknife_error_m(parts.iter().copied()),
    );
    let (difference_m, error_m) = match (&low, &high) {
        (Some((low_m, lows)), Some((high_m, highs))) => {
            (high_m - low_m, jackknife_error_m(lows.iter().zip(highs).map(|(low_m, high_m)| high_m - low_m)))
        }
        _ => (0.0, 0.0),
    };
    // 50 nm are never significant. Fits that differ by √2 errors count alike.
    let sigma = difference_m / (error_m + 5e-8);
    let weight = sigma * sigma / (sigma * sigma + 2.0);
    let windup_m = scaling.windup_m();
    let FrictionState { stiffness_n_per_m, friction, stribeck, .. } = line.state;
    // The weights of the parts of the error, and the exponents of its growth, are fitted by maximum likelihood (Student's
    // t with five degrees of freedom) to 2,800 simulated flights of all classes, then widened until nearly every class
    // holds 80 % of its 90 % intervals. The weight of the bend is so large that a bent load cell counts.
    //
    // Errors by the choice between both fits, and by the bend of a load cell: a cell that is nonlinear by 3 % of its range
    // bends flanks by 1 % of the wind-up, and flanks that bend by more are soft.
    let choice = 2.6 * (1.0 - weight);
    let bend = 3.0 / (1.0 + (difference_m / (0.012 * windup_m)).powi(2));
    let vibration_m = friction.lost_share * vibration_n / stiffness_n_per_m;
    let changes = rows.array_windows().filter(|[before, row]| before.x[GAP] * row.x[GAP] < 0.0).count();
    // Friction counts up to 60 % of the load.
    let friction_share = (friction.at_n(scaling.load_n) / scaling.load_n).min(0.6);
    let growth = 1.5 / (changes.max(1) as f64).sqrt() + 0.8 * friction_share;
    // The friction model is driven by the reading of the load cell, also where that is at its end.
    let growth = growth.exp() * if whole.is_clipped() { 1.5 } else { 1.0 };
    let floor_m = (4.5e-4 * windup_m).hypot(0.4 * vibration_m);
    let (gap_m, jackknife_m, candidates_m) = profile.map_or_else(
        || {
            let (all_m, counted_m) = (line.fit.beta[GAP], weight * difference_m);
            let bends = counted_m < 0.0 && all_m + counted_m > 0.0;
            let doubt = choice.hypot(bend).max(if bends { 1.5 } else { 0.0 });
            let gap_m = if bends { all_m } else { all_m + counted_m };
            (gap_m, jackknife_m, (0.45 * search.spread_m).hypot(doubt * counted_m))
        },
        // The profile explains what one gap for the whole stroke could not.
        |profile| (profile.mean_m.0, profile.mean_m.1, 0.0),
    );
    // Where the load follows the place, as in calm air, a position sensor's error along the stroke looks like a gap. Where it
    // does not, the jackknife shows it.
    let tied = (2.0 * scaling.tied_share - 1.0).max(0.0);
    let place_m = tied * OWN_ERROR * search.scale_m * line.fit.error_along(GAP, PLACE, rows);
    // Rows that lie nearer to the other flank than to that of their load: the load is not the actuator's own there, and
    // makes the gap too small (errors in variables).
    let is_astray = |row: &&DesignRow<COLUMNS>| {
        row.x[GAP].signum() * line.fit.residual_m(row) < -0.5 * line.fit.beta[GAP].abs()
    };
    let astray: f64 = rows.iter().filter(is_astray).map(|row| row.blocks).sum();
    let attenuated_m = 2.0 * gap_m * astray / all;
    let error_m = (0.8 * jackknife_m).hypot(candidates_m).hypot(floor_m) * growth;
    // Where a load steps between a few levels, friction is not distinguishable from the gap: its prior decides.
    let priors_m = search.priors_m.max(line.fit.error_of_priors_m(GAP));
    // A screw that friction at rest holds within its gap for a part of the flight: the fit then takes friction for gap and
    // gap for friction. Fitted to 2,500 flights of a second simulator, whose loads are 0.7 to 10 times the friction.
    let held_share = ((1.0 + stribeck) * friction_share - 0.3).clamp(0.0, 0.7);
    let error_m = error_m.hypot(priors_m).hypot(place_m).hypot(attenuated_m) * (4.0 * held_share).exp();
    ((gap_m, error_m), sigma)
}

/// Groups of about equally many rows, in order of time; no stretch is divided.
fn groups(rows: &[DesignRow<COLUMNS>]) -> Vec<Range<usize>> {
    let mut groups = Vec::with_capacity(GROUPS);
    let mut first = 0;
    for number in 1..=GROUPS {
        let mut end = (rows.len() * number / GROUPS).max(first);
        while end > first && end < rows.len() && rows[end].stretch == rows[end - 1].stretch {
            end += 1;
        }
        if end > first {
            groups.push(first..end);
            first = end;
        }
    }
    groups
}

/// Jackknife error of a statistic from its values with one group left out (Tukey 1958).
fn jackknife_error_m(parts_m: impl Iterator<Item = f64> + Clone) -> f64 {
    let count = parts_m.clone().count() as f64;
    let mean_m = parts_m.clone().sum::<f64>() / count;
    ((count - 1.0) / count * parts_m.map(|part_m| (part_m - mean_m).powi(2)).sum::<f64>()).sqrt()
}

/// By how much δX travels further than gap and wind-up do, from the 5 % to the 95 % quantile, m; 0 where noise may explain
/// it. The gap counts as that of each place, where it varies. The cause may be a screw that friction holds within its gap, or
/// the load of another actuator.
fn unexplained_m(blocks: &mut BlockMeans, scaling: &Scaling, fit: &FlankFit) -> f64 {
    let GaussNewtonResult { design, fit: line, at, .. } = &fit.search.line;
    blocks.apply_delays(at);
    integrate(blocks, at, scaling.motor_sense);
    let looks = (0..blocks.len()).step_by(blocks.len().div_ceil(LOOKS).max(1));
    let sound = looks.filter(|&k| blocks.is_complete(k) && blocks.couplings[k].force_n.is_finite());
    let rows = sound.map(|k| blocks.row(scaling, k));
    let of_place_m = |row: &DesignRow<COLUMNS>| {
        fit.profile.as_ref().map_or(0.0, |profile| row.x[GAP] * profile.beyond_m(row.x[PLACE]))
    };
    let expected_m = |row: &DesignRow<COLUMNS>| dot(&line.beta[..DRY], &row.x[..DRY]) + of_place_m(row);
    let (seen_m, expected_m): (Vec<f64>, Vec<f64>) =
        rows.map(|row| (row.y_m - fit.other_m(&row), expected_m(&row))).unzip();
    let (seen_m, expected_m) = (span_m(seen_m), span_m(expected_m));
    let noise_m = span_m(design.firm.iter().map(|row| line.residual_m(row)).collect());
    // A bad fit leaves noise enough to explain anything, so noise counts up to half of the expected travel.
    let blurred_m = expected_m.hypot(noise_m.min(0.5 * expected_m));
    // Travel may exceed the expected one by a quarter. Over some 300 simulated flights that show their gap, it did so by
    // 3 % at most, with positions that freeze for seconds by 15 %; flights with a wrong gap exceeded it by 50 % and more.
    if seen_m - blurred_m > 0.25 * expected_m { seen_m - expected_m } else { 0.0 }
}

fn span_m(mut values: Vec<f64>) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let mut at = |share: f64| {
        let k = ((values.len() - 1) as f64 * share) as usize;
        *values.select_nth_unstable_by(k, f64::total_cmp).1
    };
    at(0.95) - at(0.05)
}
