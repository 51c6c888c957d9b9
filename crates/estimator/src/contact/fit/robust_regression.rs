//! Robust regression with Gaussian priors, and standard errors for dependent residuals.

use std::ops::Range;

use multiversion::multiversion;
use nalgebra::{Cholesky, Const, SMatrix, SVector};

use crate::contact::fit::design_matrix::{DesignRow, dot};
use crate::contact::stats::spread;

/// Residuals beyond this many times their spread lose weight (Huber).
const HUBER: f64 = 2.0;
/// Residuals beyond this many spreads weigh zero: they are faults, and not noise.
const WILD: f64 = 10.0;
/// Rounds of reweighting of a fit of the whole flight.
pub(crate) const REWEIGHTINGS: usize = 3;
/// The least spread of residuals, m; below any sensor's, it keeps exact data from dividing by zero.
const LEAST_SPREAD_M: f64 = 1e-12;

/// Gaussian prior of a coefficient, m.
#[derive(Debug, Clone, Copy)]
pub(crate) struct GaussianPrior {
    pub(crate) mean: f64,
    /// Infinite without prior knowledge.
    pub(crate) sd: f64,
}

impl GaussianPrior {
    pub(crate) const NONE: Self = Self::zero(f64::INFINITY);

    /// A prior with mean zero and this standard deviation, m.
    pub(crate) const fn zero(sd: f64) -> Self {
        Self { mean: 0.0, sd }
    }
}

/// A fit: coefficients, m, weights of the rows, and priors.
#[derive(Debug, Clone)]
pub(crate) struct RobustFit<const N: usize> {
    pub(crate) beta: [f64; N],
    inverse: SMatrix<f64, N, N>,
    weights: Vec<f64>,
    /// Weight of each prior, in units of the rows' weights.
    lent: [f64; N],
    priors: [GaussianPrior; N],
}

/// Reweighted least squares: `rounds` rounds from even weights; `None` for too few rows. Outliers are rejected in the last
/// round where `rejects` is set.
///
/// The weight of a prior is the variance of residuals over its own, times the factor by which dependence within
/// stretches inflates the variance of a mean; otherwise thousands of dependent rows would outweigh it.
pub(crate) fn fit<const N: usize>(
    rows: &[DesignRow<N>],
    priors: &[GaussianPrior; N],
    mut rounds: usize,
    rejects: bool,
) -> Option<RobustFit<N>> {
    if rows.len() <= N {
        return None;
    }
    let mean_blocks = rows.iter().map(|r| r.blocks).sum::<f64>() / rows.len() as f64;
    let even: Vec<f64> = rows.iter().map(|r| r.blocks / mean_blocks).collect();
    // Before the noise is known, priors weigh next to nothing: they only separate dependent columns.
    let hint = priors.map(|p| if p.sd.is_finite() { 1e-9 } else { 0.0 });
    let (mut weights, mut lent) = (even.clone(), hint);
    loop {
        let (normal, right) = normal_equations(rows, &weights);
        let (beta, factor) = solve_normal(normal, right, priors, &lent)?;
        let found =
            RobustFit { beta: beta.into(), inverse: factor.inverse(), weights, lent, priors: *priors };
        if rounds == 0 {
            return Some(found);
        }
        rounds -= 1;
        let residuals_m: Vec<f64> = rows.iter().map(|r| found.residual_m(r)).collect();
        let spread_m = spread(residuals_m.iter().copied()).max(LEAST_SPREAD_M);
        let trusts = residuals_m.iter().map(|e| trust(e.abs() / spread_m, rejects && rounds == 0));
        weights = even.iter().zip(trusts).map(|(w, trust)| w * trust).collect();
        let noise = variance_of_a_row(rows, &weights, &residuals_m);
        lent = priors.map(|p| if p.sd.is_finite() { noise / (p.sd * p.sd) } else { 0.0 });
    }
}

/// Weight of a residual. Outliers are rejected only in the last round: before, a bad start could reject a
/// whole flank.
fn trust(deviation: f64, last: bool) -> f64 {
    if last && deviation > WILD {
        0.0
    } else if deviation > HUBER {
        HUBER / deviation
    } else {
        1.0
    }
}

/// Residual variance of a row of weight one, inflated by dependence within stretches.
fn variance_of_a_row<const N: usize>(rows: &[DesignRow<N>], weights: &[f64], residuals_m: &[f64]) -> f64 {
    let (together, _) = squares_of_stretches(rows, weights.iter().zip(residuals_m).map(|(w, e)| w * e));
    let (mut alone, mut total, mut size) = (0.0, 0.0, 0.0);
    for (w, e) in weights.iter().zip(residuals_m) {
        alone += w * w * e * e;
        total += w;
        size += w * e * e;
    }
    let inflation = if alone > 0.0 { (together / alone).max(1.0) } else { 1.0 };
    (size / total).max(LEAST_SPREAD_M * LEAST_SPREAD_M) * inflation
}

/// Σ over stretches of the square of Σ of the numbers of a stretch's rows, and how many stretches there are.
fn squares_of_stretches<const N: usize>(
    rows: &[DesignRow<N>],
    numbers: impl Iterator<Item = f64>,
) -> (f64, usize) {
    let (mut total, mut sum, mut stretches, mut stretch) = (0.0, 0.0, 0, None);
    for (row, number) in rows.iter().zip(numbers) {
        if stretch != Some(row.stretch) {
            total += sum * sum;
            (stretch, sum) = (Some(row.stretch), 0.0);
            stretches += 1;
        }
        sum += number;
    }
    (total + sum * sum, stretches)
}

/// Number of rows that stay in the first-level cache while all columns add them.
const CHUNK: usize = 64;

/// Σ w x xᵀ and Σ w x y: whole columns, since vectors compute the part above the diagonal at no cost.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq", "x86_64+avx2"))]
fn normal_equations<const N: usize>(
    rows: &[DesignRow<N>],
    weights: &[f64],
) -> (SMatrix<f64, N, N>, SVector<f64, N>) {
    let (mut squares, mut right) = ([[0.0; N]; N], [0.0; N]);
    for (rows, weights) in rows.chunks(CHUNK).zip(weights.chunks(CHUNK)) {
        for (i, (square, right)) in squares.iter_mut().zip(right.iter_mut()).enumerate() {
            let mut sums = *square;
            for (row, weight) in rows.iter().zip(weights) {
                let weighted = weight * row.x[i];
                *right += weighted * row.y_m;
                for (sum, x) in sums.iter_mut().zip(row.x) {
                    *sum += weighted * x;
                }
            }
            *square = sums;
        }
    }
    (SMatrix::from_fn(|i, j| squares[i][j]), SVector::from(right))
}

/// The coefficients of normal equations to which the priors are added.
#[allow(clippy::type_complexity, reason = "a vector and the factor it came from")]
fn solve_normal<const N: usize>(
    mut normal: SMatrix<f64, N, N>,
    mut right: SVector<f64, N>,
    priors: &[GaussianPrior; N],
    lent: &[f64; N],
) -> Option<(SVector<f64, N>, Cholesky<f64, Const<N>>)> {
    for i in 0..N {
        normal[(i, i)] += lent[i];
        right[i] += lent[i] * priors[i].mean;
        // A column no row touches, such as friction that never acts, keeps its prior or stays zero.
        if normal[(i, i)] <= 0.0 {
            normal[(i, i)] = 1.0;
        }
    }
    let factor: Cholesky<f64, Const<N>> = normal.cholesky()?;
    Some((factor.solve(&right), factor))
}

impl<const N: usize> RobustFit<N> {
    pub(crate) fn residual_m(&self, row: &DesignRow<N>) -> f64 {
        row.y_m - dot(&self.beta, &row.x)
    }

    /// A coefficient refitted with the weights of this fit: over all rows whose column `by` is at least `least` in size,
    /// and with each group of them left out in turn. `None` if too few rows remain.
    pub(crate) fn leave_one_out(
        &self,
        column: usize,
        rows: &[DesignRow<N>],
        groups: &[Range<usize>],
        (by, least): (usize, f64),
    ) -> Option<(f64, Vec<f64>)> {
        let parts: Vec<_> = groups
            .iter()
            .map(|group| {
                let chosen = rows[group.clone()].iter().zip(&self.weights[group.clone()]);
                let weights: Vec<f64> =
                    chosen.map(|(row, w)| if row.x[by].abs() < least { 0.0 } else { *w }).collect();
                normal_equations(&rows[group.clone()], &weights)
            })
            .collect();
        let mut total = (SMatrix::<f64, N, N>::zeros(), SVector::<f64, N>::zeros());
        for (normal, right) in &parts {
            total = (total.0 + normal, total.1 + right);
        }
        let refitted =
            |(normal, right)| solve_normal(normal, right, &self.priors, &self.lent).map(|f| f.0[column]);
        let whole = refitted(total)?;
        let parts: Option<Vec<f64>> =
            parts.iter().map(|part| refitted((total.0 - part.0, total.1 - part.1))).collect();
        Some((whole, parts?))
    }

    /// Trust in each row, from 0 to 1: its weight over the weight that it would have with a small residual.
    pub(crate) fn trusts(&self, rows: &[DesignRow<N>]) -> impl Iterator<Item = f64> {
        let mean_blocks = rows.iter().map(|r| r.blocks).sum::<f64>() / rows.len() as f64;
        rows.iter().zip(&self.weights).map(move |(row, w)| w * mean_blocks / row.blocks)
    }

    /// Standard deviation of a coefficient under an error of rms 1 m that depends on the place alone: on the column `by`, a
    /// place from −1 to 1, whose sixteenths err independently.
    pub(crate) fn error_along(&self, column: usize, by: usize, rows: &[DesignRow<N>]) -> f64 {
        const BINS: usize = 16;
        let influence: [f64; N] = std::array::from_fn(|i| self.inverse[(column, i)]);
        let mut moved = [0.0; BINS];
        for (row, w) in rows.iter().zip(&self.weights) {
            let bin = (0.5 * (row.x[by] + 1.0) * BINS as f64) as usize;
            moved[bin.min(BINS - 1)] += w * dot(&influence, &row.x);
        }
        dot(&moved, &moved).sqrt()
    }

    /// The share of a column's variance that the other columns do not explain: one over its variance inflation factor.
    pub(crate) fn own_share(&self, column: usize, rows: &[DesignRow<N>]) -> f64 {
        let moment = |power: i32| -> f64 {
            rows.iter().zip(&self.weights).map(|(row, w)| w * row.x[column].powi(power)).sum()
        };
        let variance = moment(2) - moment(1).powi(2) / moment(0);
        (self.inverse[(column, column)] * variance).recip().clamp(0.0, 1.0)
    }

    /// Standard error of a weighted sum of coefficients, m: the sandwich estimate over stretches, and the share of
    /// uncertain priors; of one coefficient
    ///
    /// ```text
    /// Var β_j = Σ_stretches (Σ w e aᵀx)² · B/(B − N) + Σ_i (a_i λ_i σ_i)²      a = row j of H⁻¹
    /// ```
    pub(crate) fn standard_error_m(&self, terms: &[(usize, f64)], rows: &[DesignRow<N>]) -> f64 {
        let influence: [f64; N] = std::array::from_fn(|i| {
            terms.iter().map(|&(column, weight)| weight * self.inverse[(column, i)]).sum()
        });
        let moved = |(row, w): (&DesignRow<N>, &f64)| w * self.residual_m(row) * dot(&influence, &row.x);
        let (total, stretches) = squares_of_stretches(rows, rows.iter().zip(&self.weights).map(moved));
        let freedom = stretches as f64 / (stretches as f64 - N as f64).max(1.0);
        (total * freedom + self.variance_of_priors(&influence)).sqrt()
    }

    /// Standard error of a coefficient by the uncertainty of the priors that it rests on, m: 0 where the data decide.
    pub(crate) fn error_of_priors_m(&self, column: usize) -> f64 {
        self.variance_of_priors(&std::array::from_fn(|i| self.inverse[(column, i)])).sqrt()
    }

    fn variance_of_priors(&self, influence: &[f64; N]) -> f64 {
        let believed = (0..N).filter(|&i| self.priors[i].sd.is_finite());
        believed.map(|i| (influence[i] * self.lent[i] * self.priors[i].sd).powi(2)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Huber's weights (Huber 1964), and none for an outlier in the last round.
    #[test]
    fn outliers_lose_weight_and_then_all_of_it() {
        for (deviation, last, wanted) in [
            (0.0, false, 1.0),
            (HUBER, true, 1.0),
            (2.0 * HUBER, false, 0.5),
            (2.0 * HUBER, true, 0.5),
            (2.0 * WILD, false, HUBER / (2.0 * WILD)),
            (2.0 * WILD, true, 0.0),
        ] {
            assert!((trust(deviation, last) - wanted).abs() < 1e-15, "{deviation} {last}");
        }
    }
}
