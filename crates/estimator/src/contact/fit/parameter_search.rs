//! Search over the parameters that the regression cannot find by derivatives: where friction starts, the zero of the
//! load cell, the bristles, and whether a late load channel is delayed or filtered.
//!
//! Candidates are compared by their misfit of all complete blocks, in contact or within the gap: which blocks are in
//! contact depends on the candidate, so that a comparison over contact alone would compare different data.

use crate::contact::blocks::block_means::BlockMeans;
use crate::contact::codes::Rejection;
use crate::contact::fit::design_matrix::{
    COLUMNS, DRY, FORCE, FORCE_DRIFT, GAP, ORIGIN, RowSource, SHARE, SIDE_FORCE, STRIBECK,
};
use crate::contact::fit::gauss_newton::{GaussNewtonResult, search, start};
use crate::contact::fit::scaling::Scaling;
use crate::contact::friction::coupling_path::CouplingPath;
use crate::contact::friction::friction_model::{Friction, FrictionState};
use crate::contact::stats::{MAD, median};

/// The least scale of residuals, m.
const LEAST_SCALE_M: f64 = 1e-9;
/// Starts of the friction: dry over the 95 % load, and lost share.
const STARTS: [(f64, f64); 2] = [(0.02, 0.03), (0.10, 0.12)];
/// Iterations from a start, and from a candidate near the best.
const ITERATIONS: (usize, usize) = (4, 1);
/// Reweightings of the rows in each iteration.
const REWEIGHTINGS: usize = 1;
/// Compliances of the bristles over that of the coupling that are tried first.
const BRISTLES: [f64; 3] = [0.3, 1.0, 3.0];
/// Factors by which the best of them is refined.
const REFINEMENTS: [[f64; 2]; 2] = [[0.6, 1.6], [0.8, 1.25]];
/// First and last step of the load zero over the 95 % load; steps are halved in between.
const ZERO_STEPS: (f64, f64) = (0.04, 0.002);
/// Most steps of that search; first steps alone reach four times the 95 % load.
const MAX_ZERO_MOVES: usize = 100;
/// Step over the 95 % load for the curvature of the misfit by the load zero.
const ZERO_ERROR_STEP: f64 = 0.02;
/// Misfits of blocks are taken as independent after this time, s.
const INDEPENDENT_S: f64 = 0.1;
/// Shares of the load's delay that are tried as a first-order lag.
const LAG_SHARES: [f64; 2] = [1.0, 0.5];
/// A shorter delay of the load is not distinguishable from a lag, s.
const LEAST_DELAY_S: f64 = 2e-4;
/// Candidates this much above the least mean misfit count e⁻¹ in the spread of gaps.
const COST_SCALE: f64 = 0.01;

/// The best candidate.
pub(crate) struct SearchResult {
    pub(crate) found: GaussNewtonResult,
    /// Spread of the gaps of all candidates about the best one's, each weighted by its misfit, m.
    pub(crate) spread_m: f64,
    /// Scale of the residuals of single blocks, m.
    pub(crate) scale_m: f64,
    /// Standard error of the load zero, N.
    pub(crate) load_zero_se_n: f64,
}

/// The state of a search.
pub(crate) struct ParameterSearch<'a> {
    blocks: &'a mut BlockMeans,
    path: &'a mut CouplingPath,
    scaling: &'a Scaling,
    linear_m: Vec<f64>,
    /// Scale of the residuals, m.
    scale_m: f64,
    /// Misfit and gap of all candidates.
    tried: Vec<(f64, f64)>,
}

struct Candidate {
    found: GaussNewtonResult,
    misfit: f64,
}

impl<'a> ParameterSearch<'a> {
    pub(crate) fn new(blocks: &'a mut BlockMeans, path: &'a mut CouplingPath, scaling: &'a Scaling) -> Self {
        Self { blocks, path, scaling, linear_m: Vec::new(), scale_m: f64::INFINITY, tried: Vec::new() }
    }

    /// The best parameters of a flight.
    ///
    /// # Errors
    /// As [`search`], when no start leads anywhere.
    pub(crate) fn run(mut self) -> Result<SearchResult, Rejection> {
        let mut best = self.best_start()?;
        self.improve_zero(&mut best);
        let is_lagging = self.improve_lag(&mut best);
        let has_bristles = self.improve_bristles(&mut best);
        if is_lagging || has_bristles {
            self.improve_zero(&mut best);
        }
        if has_bristles {
            self.refine_bristles(&mut best, REFINEMENTS[1]);
        }
        let gap_m = best.found.fit.beta[GAP];
        let (mut total, mut squares) = (0.0, 0.0);
        for (misfit, other_m) in &self.tried {
            let weight = (-(misfit - best.misfit).max(0.0) / COST_SCALE).exp();
            total += weight;
            squares += weight * (other_m - gap_m).powi(2);
        }
        let load_zero_se_n = self.zero_error_n(&best);
        Ok(SearchResult {
            found: best.found,
            spread_m: (squares / total.max(f64::MIN_POSITIVE)).sqrt(),
            scale_m: self.scale_m,
            load_zero_se_n,
        })
    }

    fn best_start(&mut self) -> Result<Candidate, Rejection> {
        let mut found = Vec::new();
        let mut rejection = Rejection::TooShort;
        for (dry, lost_share) in STARTS {
            let friction = Friction { dry_n: dry * self.scaling.load_n, lost_share };
            match self.search(FrictionState { friction, ..start(self.scaling) }, ITERATIONS.0) {
                Ok(result) => {
                    self.scale_m = self.scale_m.min(self.scale_m(&result));
                    found.push(result);
                }
                Err(why) => rejection = why,
            }
        }
        let mut best: Option<Candidate> = None;
        for found in found {
            let misfit = self.judge(&found);
            if best.as_ref().is_none_or(|best| misfit < best.misfit) {
                best = Some(Candidate { found, misfit });
            }
        }
        best.ok_or(rejection)
    }

    fn search(&mut self, state: FrictionState, iterations: usize) -> Result<GaussNewtonResult, Rejection> {
        search((self.blocks, self.path), self.scaling, state, (iterations, REWEIGHTINGS))
    }

    /// Takes a state's fit when it fits better.
    fn improve(&mut self, best: &mut Candidate, state: FrictionState) -> bool {
        let Ok(found) = self.search(state, ITERATIONS.1) else { return false };
        let misfit = self.judge(&found);
        let is_better = misfit < best.misfit;
        if is_better {
            *best = Candidate { found, misfit };
        }
        is_better
    }

    /// A pattern search for the zero of the load cell. In contact it merges with δX₀; it shows where the flank is left.
    fn improve_zero(&mut self, best: &mut Candidate) {
        self.prepare(&best.found);
        let (mut zero_n, mut least) = (best.found.at.load_zero_n, best.misfit);
        let mut step_n = ZERO_STEPS.0 * self.scaling.load_n;
        // A misfit that falls on and on, as without any load, has no minimum.
        for _ in 0..MAX_ZERO_MOVES {
            if step_n <= ZERO_STEPS.1 * self.scaling.load_n {
                break;
            }
            let before = least;
            for candidate_n in [zero_n - step_n, zero_n + step_n] {
                let misfit = self.misfit(&best.found, candidate_n);
                if misfit < least {
                    (zero_n, least) = (candidate_n, misfit);
                }
            }
            if least >= before {
                step_n *= 0.5;
            }
        }
        if least < best.misfit {
            self.improve(best, FrictionState { load_zero_n: zero_n, ..best.found.state });
        }
    }

    /// Standard error of the load zero from the curvature of the misfit, N, with blocks taken as independent after
    /// [`INDEPENDENT_S`]; the 95 % load where the misfit has no minimum.
    fn zero_error_n(&mut self, best: &Candidate) -> f64 {
        let step_n = ZERO_ERROR_STEP * self.scaling.load_n;
        let zero_n = best.found.at.load_zero_n;
        self.prepare(&best.found);
        let around =
            [zero_n - step_n, zero_n, zero_n + step_n].map(|zero_n| self.misfit(&best.found, zero_n));
        let curvature = (around[0] - 2.0 * around[1] + around[2]) / (step_n * step_n);
        let independent = self.blocks.len() as f64 * (self.blocks.period_s / INDEPENDENT_S).min(1.0);
        let variance_n2 = (curvature * independent).recip();
        let least_n = ZERO_STEPS.1 * self.scaling.load_n;
        if curvature > 0.0 {
            variance_n2.sqrt().clamp(least_n, self.scaling.load_n)
        } else {
            self.scaling.load_n
        }
    }

    fn improve_lag(&mut self, best: &mut Candidate) -> bool {
        let delay_s = best.found.state.load_delay_s;
        if delay_s < LEAST_DELAY_S {
            return false;
        }
        let mut is_better = false;
        for share in LAG_SHARES {
            let state = FrictionState {
                load_lag_s: share * delay_s,
                load_delay_s: (1.0 - share) * delay_s,
                ..best.found.state
            };
            is_better |= self.improve(best, state);
        }
        is_better
    }

    fn improve_bristles(&mut self, best: &mut Candidate) -> bool {
        let compliance_m_per_n = best.found.state.stiffness_n_per_m.recip();
        let mut is_better = false;
        for share in BRISTLES {
            let bristle_m_per_n = share * compliance_m_per_n;
            is_better |= self.improve(best, FrictionState { bristle_m_per_n, ..best.found.state });
        }
        if is_better {
            self.refine_bristles(best, REFINEMENTS[0]);
        }
        is_better
    }

    fn refine_bristles(&mut self, best: &mut Candidate, factors: [f64; 2]) {
        let found_m_per_n = best.found.at.bristle_m_per_n;
        for factor in factors {
            let bristle_m_per_n = factor * found_m_per_n;
            self.improve(best, FrictionState { bristle_m_per_n, ..best.found.state });
        }
    }

    /// Median size of a candidate's residuals, as a standard deviation, m.
    fn scale_m(&mut self, found: &GaussNewtonResult) -> f64 {
        self.prepare(found);
        let mut sizes_m: Vec<f64> = Vec::new();
        self.each_residual(found, found.at.load_zero_n, |e_m| sizes_m.push(e_m.abs()));
        (MAD * median(&mut sizes_m)).max(LEAST_SCALE_M)
    }

    /// The misfit of a candidate that is judged for the first time.
    fn judge(&mut self, found: &GaussNewtonResult) -> f64 {
        self.prepare(found);
        let misfit = self.misfit(found, found.at.load_zero_n);
        self.tried.push((misfit, found.fit.beta[GAP]));
        misfit
    }

    /// Mean of ln(1 + (e/s)²) over all complete blocks of the [prepared](Self::prepare) candidate: a bounded influence
    /// for each (Cauchy's likelihood).
    fn misfit(&mut self, found: &GaussNewtonResult, load_zero_n: f64) -> f64 {
        let per_scale = self.scale_m.recip();
        let (mut product, mut logarithms, mut blocks) = (1.0, 0.0, 0_usize);
        self.each_residual(found, load_zero_n, |e_m| {
            let e = e_m * per_scale;
            product *= 1.0 + e * e;
            blocks += 1;
            if product > 1e200 {
                logarithms += f64::ln(product);
                product = 1.0;
            }
        });
        (logarithms + product.ln()) / blocks.max(1) as f64
    }

    /// Takes a candidate's delays off the channels, and its linear parts off δX: what no load zero changes.
    fn prepare(&mut self, found: &GaussNewtonResult) {
        let Self { blocks, scaling, linear_m, .. } = self;
        blocks.apply_delays(found.at.skew_s, found.at.load_delay_s, found.at.load_lag_s);
        linear_parts(RowSource { blocks, scaling }, &found.fit.beta, linear_m);
    }

    /// What the [prepared](Self::prepare) candidate with another load zero leaves of δX in every complete block, m.
    fn each_residual(&mut self, found: &GaussNewtonResult, load_zero_n: f64, mut take: impl FnMut(f64)) {
        let Self { blocks, path, scaling, linear_m, .. } = self;
        path.integrate(blocks, &FrictionState { load_zero_n, ..found.at }, scaling.motor_sense);
        let beta = &found.fit.beta;
        // In contact a zero is an offset of δX.
        let shift_m = (load_zero_n - found.at.load_zero_n) * beta[FORCE] / scaling.load_n;
        let (force, force_drift) = (beta[FORCE] / scaling.load_n, beta[FORCE_DRIFT] / scaling.load_n);
        let side_force = beta[SIDE_FORCE] / scaling.load_n;
        let (share, stribeck) = (beta[SHARE] / scaling.load_n, beta[STRIBECK] / scaling.load_n);
        for (k, (linear_m, coupling)) in linear_m.iter().zip(&path.couplings).enumerate() {
            let force_n = coupling.force_n;
            let side = if force_n == 0.0 { 0.0 } else { 0.5 * force_n.signum() };
            let inside_m = if force_n == 0.0 { coupling.relative_m } else { 0.0 };
            let time = scaling.time_share(blocks.time_s[k]);
            let coupling_m = side * beta[GAP]
                + force_n * (force + force_drift * time)
                + force_n.abs() * side_force
                + beta[DRY] * coupling.dforce_ddry
                + share * coupling.dforce_dloss_n
                + stribeck * coupling.dforce_dstribeck_n;
            let residual_m = linear_m - shift_m - inside_m - coupling_m;
            if residual_m.is_finite() {
                take(residual_m);
            }
        }
    }
}

/// δX less all that does not depend on the force in the coupling, for every block; NaN where something is missing.
fn linear_parts(source: RowSource<'_>, beta: &[f64; COLUMNS], parts_m: &mut Vec<f64>) {
    let part_m = |k| {
        let is_complete = source.blocks.is_complete(k);
        if is_complete { source.without_slow_parts_m(k, beta) - beta[ORIGIN] } else { f64::NAN }
    };
    parts_m.clear();
    parts_m.extend((0..source.blocks.len()).map(part_m));
}
