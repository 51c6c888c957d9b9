//! A load cell whose zero differs between tension and compression: its reading jumps at zero load.

use crate::contact::block_means::BlockMeans;
use crate::contact::stats::median_and_error;
use crate::samples::Samples;

/// By how much the reading of the load jumps where the load changes its side, N; 0 where it passes zero as smoothly as
/// other loads.
///
/// Such a cell reads each load too large, by half of the jump, so that both flanks seem to lie nearer to each other. The
/// median step between two samples that pass zero is compared with that at half of the 95 % load, `load_n`, on either
/// side: a load that is coarse, slow or fast steps as far there. Zero is the cell's, or where the flanks are left,
/// `load_zero_n`.
pub(crate) fn load_jump_n(samples: &Samples<'_>, excerpt: &BlockMeans, load_zero_n: f64, load_n: f64) -> f64 {
    let step_at = |level_n: f64| median_step_n(samples, excerpt, level_n);
    let larger = |a: Option<(f64, f64)>, b: Option<(f64, f64)>| {
        a.into_iter().chain(b).max_by(|a, b| a.0.total_cmp(&b.0))
    };
    let zero = larger(step_at(0.0), step_at(load_zero_n));
    let other = larger(step_at(load_zero_n + 0.5 * load_n), step_at(load_zero_n - 0.5 * load_n));
    let Some(((zero_n, zero_se_n), (other_n, other_se_n))) = zero.zip(other) else { return 0.0 };
    let jump_n = zero_n - other_n;
    if jump_n > 0.3 * other_n && jump_n > 4.0 * zero_se_n.hypot(other_se_n) { jump_n } else { 0.0 }
}

/// The median step from one sample to the next with which the load passes a level and its standard error, N; `None` for
/// fewer than five passes.
fn median_step_n(samples: &Samples<'_>, excerpt: &BlockMeans, level_n: f64) -> Option<(f64, f64)> {
    let each = (excerpt.period_s / samples.step_s).round();
    let first_of = |k: usize| (excerpt.time_s[k] / samples.step_s - 0.5 * (each - 1.0)).round() as usize;
    let passes = |[from_n, to_n]: &[f64; 2]| (from_n - level_n) * (to_n - level_n) < 0.0;
    let step = |k: usize| {
        let last = (first_of(k + 1) + each as usize).min(samples.load_n.len());
        let step = samples.load_n[first_of(k)..last].array_windows().find(|pair| passes(pair));
        step.map(|[from_n, to_n]| ((to_n - from_n).abs(), excerpt.stretch(k)))
    };
    median_and_error(excerpt.segments.iter().flat_map(|segment| {
        let pairs = segment.clone().zip(excerpt.logged_n[segment.clone()].array_windows());
        pairs.filter(|(_, pair)| passes(pair)).filter_map(|(k, _)| step(k))
    }))
}
