//! Search over the parameters that the regression cannot find by derivatives: the start values of friction, the load
//! zero, and the bristles.
//!
//! Candidates are compared by their misfit over all complete blocks, in contact or within the gap. Which blocks are in
//! contact depends on the candidate: over these alone, two candidates would be compared by different data.

use crate::contact::block_means::BlockMeans;
use crate::contact::codes::Rejection;
use crate::contact::fit::design_matrix::{FORCE, GAP, ORIGIN, SPEED, dot};
use crate::contact::fit::gauss_newton::{DRY_SHARE, GaussNewtonResult, search};
use crate::contact::fit::scaling::{Scaling, UNSEEN_GAP};
use crate::contact::fit::sign_check;
use crate::contact::friction::coupling_path::integrate;
use crate::contact::friction::friction_model::{Friction, FrictionState};
use crate::contact::stats::spread;

/// First and last step of the search for the load zero, as shares of the 95 % load; steps are halved in between.
const ZERO_STEPS: (f64, f64) = (0.04, 0.003);

/// By how much the misfit from a far load zero must be smaller than that from the logged zero.
const ZERO_GAIN: f64 = 0.5;
/// Share of the 95 % load beyond which a far load zero is accepted where no other start succeeds.
const ZERO_ALONE: f64 = 0.25;

/// Mean residual of the sign check with a far load zero, over that with the logged one, below which the far one is taken.
const ZERO_EXPLAINS: f64 = 0.9;

/// The best candidate.
#[derive(Debug)]
pub(crate) struct SearchResult {
    pub(crate) line: GaussNewtonResult,
    /// Spread of the gaps of all candidates about that of the best candidate, each weighted by its misfit, m.
    pub(crate) spread_m: f64,
    /// Scale of the residuals of single blocks, m.
    pub(crate) scale_m: f64,
    /// Standard error of the load zero, N.
    pub(crate) load_zero_se_n: f64,
    /// Standard error of the gap by what the priors leave open, m.
    pub(crate) priors_m: f64,
}

/// The state of a search.
pub(crate) struct ParameterSearch<'a> {
    blocks: &'a mut BlockMeans,
    scaling: &'a Scaling,
    /// Whether the search may fail where only the start from a far load zero fails: the caller then takes a longer excerpt.
    can_grow: bool,
    /// δX of each block minus the fitted terms that do not depend on the force in the coupling, m.
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
    pub(crate) fn new(blocks: &'a mut BlockMeans, scaling: &'a Scaling, can_grow: bool) -> Self {
        Self { blocks, scaling, can_grow, linear_m: Vec::new(), scale_m: f64::INFINITY, tried: Vec::new() }
    }

    /// The best parameters of a flight.
    ///
    /// # Errors
    /// A rejection, if [`search`] fails from every start, or from that of a far load zero where the excerpt can grow.
    pub(crate) fn run(mut self) -> Result<SearchResult, Rejection> {
        let mut best = self.best_start()?;
        self.improve_zero(&mut best);
        // Bristles about as compliant as the coupling are tried first, then bristles about as compliant as the best of them.
        let compliance_m_per_n = best.found.state.stiffness_n_per_m.recip();
        if self.try_bristles(&mut best, &[0.3, 1.0, 3.0], compliance_m_per_n) {
            let found_m_per_n = best.found.at.bristle_m_per_n;
            self.try_bristles(&mut best, &[0.6, 1.6], found_m_per_n);
        }
        let gap_m = best.found.fit.beta[GAP];
        let (mut total, mut squares) = (0.0, 0.0);
        // A candidate whose misfit is larger by 0.01 has the weight e⁻¹.
        for (misfit, other_m) in &self.tried {
            let weight = (-(misfit - best.misfit).max(0.0) / 0.01).exp();
            total += weight;
            squares += weight * (other_m - gap_m).powi(2);
        }
        let load_zero_se_n = self.zero_error_n(&best.found);
        let priors_m = self.error_of_priors_m(&best.found);
        Ok(SearchResult {
            priors_m,
            line: best.found,
            spread_m: (squares / total.max(f64::MIN_POSITIVE)).sqrt(),
            scale_m: self.scale_m,
            load_zero_se_n,
        })
    }

    fn best_start(&mut self) -> Result<Candidate, Rejection> {
        // Dry friction as a share of the 95 % load, and lost share of the load: usual friction, then heavy friction.
        let [usual, heavy] = [self.start((0.02, 0.03), 0.0), self.start((0.10, 0.12), 0.0)];
        // From a zero of the load cell that is far off, no small step leads to the true one.
        let zero_n = self.blocks.far_zero_n(self.scaling.load_n);
        let far = zero_n.map(|zero_n| self.start((0.02, 0.03), zero_n));
        if let Some(Err(why)) = &far
            && self.can_grow
        {
            return Err(*why);
        }
        let rejection = heavy.as_ref().err().or(usual.as_ref().err()).copied().unwrap_or(Rejection::TooShort);
        let near = self.best_of(usual.into_iter().chain(heavy));
        let far = self.best_of(far.into_iter().flatten());
        // Without a gap, and without a load on both sides, any load zero fits. Under a load that presses one flank only
        // briefly, δX passes its middle in contact: a load zero there fits no better than the logged one.
        let off_m = |zero_n| sign_check::misfit_m(self.blocks, self.scaling, zero_n);
        let is_sure = |far: &Candidate| {
            zero_n.is_some_and(|n| {
                n.abs() > ZERO_ALONE * self.scaling.load_n && off_m(n) < ZERO_EXPLAINS * off_m(0.0)
            }) && far.found.fit.beta[GAP] > 2.0 * UNSEEN_GAP * self.scaling.windup_m()
        };
        match (near, far) {
            (Some(near), Some(far)) if far.misfit + ZERO_GAIN < near.misfit => Ok(far),
            (Some(near), _) => Ok(near),
            (None, far) => far.filter(is_sure).ok_or(rejection),
        }
    }

    /// Iterates from usual parameters with this friction and load zero.
    fn start(
        &mut self,
        (dry, lost_share): (f64, f64),
        load_zero_n: f64,
    ) -> Result<GaussNewtonResult, Rejection> {
        let state = FrictionState {
            stiffness_n_per_m: self.scaling.stiffness_n_per_m,
            friction: Friction { dry_n: dry * self.scaling.load_n, lost_share },
            load_zero_n,
            ..FrictionState::default()
        };
        let result = self.search(state, 3)?;
        let mut residuals_m: Vec<f64> = Vec::new();
        self.each_residual(&result, result.at.load_zero_n, |e_m| residuals_m.push(e_m));
        self.scale_m = self.scale_m.min(spread(residuals_m.into_iter()).max(1e-9));
        Ok(result)
    }

    fn best_of(&mut self, found: impl Iterator<Item = GaussNewtonResult>) -> Option<Candidate> {
        let judged = found.map(|found| {
            self.prepare(&found);
            let misfit = self.misfit_at(&found, found.at.load_zero_n);
            self.candidate(found, misfit)
        });
        judged.min_by(|a, b| a.misfit.total_cmp(&b.misfit))
    }

    /// Iterates from a state; afterwards, blocks, couplings and linear parts are those of the result.
    fn search(&mut self, state: FrictionState, iterations: usize) -> Result<GaussNewtonResult, Rejection> {
        let found = search(self.blocks, self.scaling, state, iterations, 1)?;
        self.take_linear_parts(&found);
        Ok(found)
    }

    fn take_linear_parts(&mut self, found: &GaussNewtonResult) {
        let Self { blocks, scaling, linear_m, .. } = self;
        let beta = &found.fit.beta;
        linear_m.clear();
        linear_m
            .extend((0..blocks.len()).map(|k| blocks.without_slow_parts_m(scaling, k, beta) - beta[ORIGIN]));
    }

    /// Iterates once from a state. True if the result fits better than the best one, which it then replaces.
    fn improve(&mut self, best: &mut Candidate, state: FrictionState) -> bool {
        let Ok(found) = self.search(state, 1) else { return false };
        let misfit = self.misfit(&found, found.at.load_zero_n);
        let new = self.candidate(found, misfit);
        let is_better = new.misfit < best.misfit;
        if is_better {
            *best = new;
        }
        is_better
    }

    fn candidate(&mut self, found: GaussNewtonResult, misfit: f64) -> Candidate {
        self.tried.push((misfit, found.fit.beta[GAP]));
        Candidate { found, misfit }
    }

    /// Pattern search for the load zero. In contact it acts as δX₀ does: only the ends of contact tell them apart.
    fn improve_zero(&mut self, best: &mut Candidate) {
        self.prepare(&best.found);
        let (mut zero_n, mut least) = (best.found.at.load_zero_n, best.misfit);
        let mut step_n = ZERO_STEPS.0 * self.scaling.load_n;
        // Without load, the misfit may fall without end: a hundred first steps reach four times the 95 % load.
        for _ in 0..100 {
            if step_n <= ZERO_STEPS.1 * self.scaling.load_n {
                break;
            }
            let before = least;
            for candidate_n in [zero_n - step_n, zero_n + step_n] {
                let misfit = self.misfit_at(&best.found, candidate_n);
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
    /// 0.1 s; the 95 % load where the misfit has no minimum.
    fn zero_error_n(&mut self, found: &GaussNewtonResult) -> f64 {
        self.prepare(found);
        let step_n = 0.02 * self.scaling.load_n;
        let [low, middle, high] =
            [-step_n, 0.0, step_n].map(|by_n| self.misfit_at(found, found.at.load_zero_n + by_n));
        let curvature = (low - 2.0 * middle + high) / (step_n * step_n);
        let independent = self.blocks.len() as f64 * (self.blocks.period_s / 0.1).min(1.0);
        let error_n = (curvature * independent).recip().sqrt();
        let least_n = ZERO_STEPS.1 * self.scaling.load_n;
        if curvature > 0.0 { error_n.clamp(least_n, self.scaling.load_n) } else { self.scaling.load_n }
    }

    /// Standard error of the gap by the priors, m, under the fitted friction plus the standard deviation of its prior:
    /// under almost no friction, noise of the load makes the screw slip to and fro, so that the data seem to determine
    /// the friction.
    fn error_of_priors_m(&mut self, found: &GaussNewtonResult) -> f64 {
        let mut state = found.state;
        state.friction.dry_n += DRY_SHARE.1 * self.scaling.load_n;
        let probe = search(self.blocks, self.scaling, state, 1, 1);
        probe.map_or(0.0, |probe| probe.fit.error_of_priors_m(GAP))
    }

    /// Tries bristles with each factor times one compliance, m/N. True if one of them fits better.
    fn try_bristles(&mut self, best: &mut Candidate, factors: &[f64], of_m_per_n: f64) -> bool {
        let mut is_better = false;
        for factor in factors {
            let state = FrictionState { bristle_m_per_n: factor * of_m_per_n, ..best.found.state };
            is_better |= self.improve(best, state);
        }
        is_better
    }

    /// Mean of ln(1 + (e/s)²) over all complete blocks of a [prepared](Self::prepare) fit with another load zero: a bounded
    /// influence for each block (Cauchy's likelihood).
    fn misfit(&self, found: &GaussNewtonResult, load_zero_n: f64) -> f64 {
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

    /// The misfit of a prepared fit with another load zero, for which the couplings are integrated.
    fn misfit_at(&mut self, found: &GaussNewtonResult, load_zero_n: f64) -> f64 {
        let state = FrictionState { load_zero_n, ..found.at };
        integrate(self.blocks, &state, self.scaling.motor_sense);
        self.misfit(found, load_zero_n)
    }

    /// Removes a fit's delays from the channels and its linear parts from δX; neither depends on the load zero.
    fn prepare(&mut self, found: &GaussNewtonResult) {
        self.blocks.apply_delays(&found.at);
        self.take_linear_parts(found);
    }

    /// Passes the residual of each complete block, m, to `take`, for a fit with another load zero.
    fn each_residual(&self, found: &GaussNewtonResult, load_zero_n: f64, mut take: impl FnMut(f64)) {
        let beta = &found.fit.beta;
        // In contact, a load zero is an offset of δX.
        let shift_m = (load_zero_n - found.at.load_zero_n) * beta[FORCE] * self.scaling.per_load;
        for (k, (linear_m, coupling)) in self.linear_m.iter().zip(&self.blocks.couplings).enumerate() {
            let inside_m = if coupling.force_n == 0.0 { coupling.relative_m } else { 0.0 };
            let coupling_m = dot(&beta[GAP..SPEED], &self.blocks.coupling_columns(self.scaling, k));
            let residual_m = linear_m - shift_m - inside_m - coupling_m;
            if residual_m.is_finite() {
                take(residual_m);
            }
        }
    }
}
