//! The settled filter as one map with constant coefficients, shared by the batch and the stream.

use nalgebra::{Matrix3, Vector3};

use crate::kalman::filter::{Filter, FilterStep, distance};
use crate::simd::dispatch::simd_dispatch;
use crate::simd::fma::FmaScalar;

/// The folded map takes over when the covariance is this near to its limit, as a share of itself. The
/// difference leaves a share as small in S, and is forgotten.
const NEAR: f64 = 1e-13;

/// Samples whose squared innovations are added up by themselves before their sum is added to all others: the
/// order of additions is part of a number, and this one suits vectors.
#[cfg(feature = "std")]
pub(crate) const GROUP: usize = 32;

/// The state in the coordinates of the folded map, m: z = δX − S, what is bent and not backlash; v = a₀₁ δẊ, what the
/// speed adds to that in a step; and S.
pub(crate) type SteadyState = [f64; 3];

/// Predict and correct in one, at the settled gain K.
///
/// With the entries a of A_d, whose last row is [0 0 1] and which leaves [1 0 1] as it is (the model sees δX and S by
/// their difference alone), and with κ = k₀ − k₂ and λ = a₀₁ k₁:
///
/// ```text
/// w = y − b₀ u        n = w − S        p = a₀₀ z + v        e = n − p
/// z = (1 − κ) p + (κ n + b₀ u)
/// v = λ n + ((a₁₁ − λ) v + (a₀₁ a₁₀ − λ a₀₀) z + a₀₁ b₁ u)
/// S = −k₂ p + ((1 − k₂) S + k₂ w)
/// ```
/// So there are eleven products where (I − K C) A_d has nine alone. Fewer would do, in coordinates that make e one
/// difference, or if S were moved by k₂ e; but then a difference of the last bit would live on for long, and
/// `lanes` needs that starts are forgotten wholly. Each product is fused with its sum, on any machine.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SteadyStateFilter {
    coefficients: SteadyStateCoefficients<f64>,
    #[cfg(feature = "std")]
    pub(crate) variance_m2: f64,
    /// a₀₁, s.
    speed_to_way_s: f64,
    /// Its reciprocal; zero where it has none.
    way_to_speed_per_s: f64,
    p: Matrix3<f64>,
}

/// See [`SteadyStateFilter`].
#[derive(Debug, Clone, Copy)]
pub(crate) struct SteadyStateCoefficients<E> {
    b: E,
    a: E,
    kappa: E,
    less_kappa: E,
    lambda: E,
    v_by_v: E,
    v_by_z: E,
    v_by_u: E,
    k: E,
    minus_k: E,
    less_k: E,
}

impl SteadyStateFilter {
    pub(crate) fn new(filter: &Filter, gain: &Vector3<f64>, p: &Matrix3<f64>) -> Self {
        let (a, b) = (&filter.discrete().a_d, &filter.discrete().b_d);
        let (kappa, lambda) = (gain[0] - gain[2], a[(0, 1)] * gain[1]);
        let coefficients = SteadyStateCoefficients {
            b: b[0],
            a: a[(0, 0)],
            kappa,
            less_kappa: 1.0 - kappa,
            lambda,
            v_by_v: a[(1, 1)] - lambda,
            v_by_z: a[(0, 1)] * a[(1, 0)] - lambda * a[(0, 0)],
            v_by_u: a[(0, 1)] * b[1],
            k: gain[2],
            minus_k: -gain[2],
            less_k: 1.0 - gain[2],
        };
        Self {
            coefficients,
            #[cfg(feature = "std")]
            variance_m2: p[(0, 0)] + filter.noise().v_d_m2,
            speed_to_way_s: a[(0, 1)],
            way_to_speed_per_s: if a[(0, 1)].is_normal() { a[(0, 1)].recip() } else { 0.0 },
            p: *p,
        }
    }

    /// Whether a correction was made with a covariance near to the limit this map belongs to.
    pub(crate) fn is_converged(&self, step: &FilterStep) -> bool {
        !step.innovation_m.is_nan() && distance(&self.p, &step.prior.p) <= NEAR
    }

    /// From the state after a sample.
    pub(crate) fn transform(&self, x: &Vector3<f64>) -> SteadyState {
        [x[0] - x[2], self.speed_to_way_s * x[1], x[2]]
    }

    /// Transforms back to the state. A velocity that decays within one step moves nothing, and is returned as zero.
    pub(crate) fn inverse_transform(&self, [z_m, v_m, s_m]: SteadyState) -> Vector3<f64> {
        Vector3::new(z_m + s_m, v_m * self.way_to_speed_per_s, s_m)
    }

    /// The same map for eight series side by side, or for one.
    #[inline(always)]
    #[allow(clippy::inline_always, reason = "must be compiled within each of its shells")]
    pub(crate) fn wide<E: FmaScalar>(&self) -> SteadyStateCoefficients<E> {
        let of = &self.coefficients;
        SteadyStateCoefficients {
            b: E::splat(of.b),
            a: E::splat(of.a),
            kappa: E::splat(of.kappa),
            less_kappa: E::splat(of.less_kappa),
            lambda: E::splat(of.lambda),
            v_by_v: E::splat(of.v_by_v),
            v_by_z: E::splat(of.v_by_z),
            v_by_u: E::splat(of.v_by_u),
            k: E::splat(of.k),
            minus_k: E::splat(of.minus_k),
            less_k: E::splat(of.less_k),
        }
    }
}

impl<E: FmaScalar> SteadyStateCoefficients<E> {
    /// One sample of each series: the state after it, and its innovation.
    ///
    /// What comes latest is added last: a state waits ten cycles for the one before it where a sum takes three and a
    /// fused product four.
    #[inline(always)]
    #[allow(clippy::inline_always, reason = "must be compiled within each of its shells")]
    pub(crate) fn step(&self, [z_m, v_m, s_m]: [E; 3], y_m: E, load_n: E) -> ([E; 3], E) {
        let pushed_m = self.b.mul(load_n);
        let w_m = y_m.sub(pushed_m);
        let n_m = w_m.sub(s_m);
        let p_m = self.a.mul_add(z_m, v_m);
        let next_z_m = self.less_kappa.mul_add(p_m, self.kappa.mul_add(n_m, pushed_m));
        let moved_m = self.v_by_v.mul_add(v_m, self.v_by_z.mul_add(z_m, self.v_by_u.mul(load_n)));
        let next_s_m = self.minus_k.mul_add(p_m, self.less_k.mul_add(s_m, self.k.mul(w_m)));
        ([next_z_m, self.lambda.mul_add(n_m, moved_m), next_s_m], n_m.sub(p_m))
    }
}

simd_dispatch! {
    /// One sample; see [`SteadyStateCoefficients::step`].
    pub(crate) fn step(map: &SteadyStateFilter, x: &mut SteadyState, y_m: f64, load_n: f64) {
        *x = map.wide::<f64>().step(*x, y_m, load_n).0;
    }
}

#[cfg(feature = "std")]
simd_dispatch! {
    /// Samples one after the other: the last state, and a sum with the squared innovations added, [`GROUP`] by
    /// [`GROUP`]. Innovations are written as far as the buffer reaches.
    pub(crate) fn run(
        map: &SteadyStateFilter,
        from: SteadyState,
        sum_m2: f64,
        columns: (&[f64], &[f64]),
        s_m: &mut [f64],
        innovation_m: &mut [f64],
    ) -> (SteadyState, f64) {
        let (coefficients, mut x, mut sum_m2) = (map.wide::<f64>(), from, sum_m2);
        let mut outputs = innovation_m.iter_mut();
        let groups = columns.0.chunks(GROUP).zip(columns.1.chunks(GROUP)).zip(s_m.chunks_mut(GROUP));
        for ((y_m, load_n), s_m) in groups {
            let mut group_m2 = 0.0;
            for ((&y, &u), s) in y_m.iter().zip(load_n).zip(s_m) {
                let e_m;
                (x, e_m) = coefficients.step(x, y, u);
                *s = x[2];
                group_m2 = e_m.mul_add(e_m, group_m2);
                if let Some(out) = outputs.next() {
                    *out = e_m;
                }
            }
            sum_m2 += group_m2;
        }
        (x, sum_m2)
    }
}
