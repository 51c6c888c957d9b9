//! The settled filter as one map with constant coefficients, shared by the batch and the stream.

use nalgebra::{Matrix3, Vector3};

use crate::filter::{Filter, Step, distance};

/// The folded map takes over when the covariance is this near to its limit, as a share of itself. The
/// difference leaves a share as small in S, and is forgotten.
const NEAR: f64 = 1e-13;

/// Predict and correct in one, at the settled gain K: F = (I − K C) A_d, g = (I − K C) B_d, k = K.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Folded {
    f: [[f64; 3]; 3],
    g: [f64; 3],
    k: [f64; 3],
    /// First rows of A_d and B_d, which predict y.
    a: [f64; 3],
    b: f64,
    #[cfg(feature = "std")]
    pub(crate) variance_m2: f64,
    p: Matrix3<f64>,
}

impl Folded {
    pub(crate) fn new(filter: &Filter, gain: &Vector3<f64>, p: &Matrix3<f64>) -> Self {
        let (a_d, b_d) = (&filter.discrete().a_d, &filter.discrete().b_d);
        Self {
            f: core::array::from_fn(|i| core::array::from_fn(|j| a_d[(i, j)] - gain[i] * a_d[(0, j)])),
            g: core::array::from_fn(|i| b_d[i] - gain[i] * b_d[0]),
            k: core::array::from_fn(|i| gain[i]),
            a: core::array::from_fn(|j| a_d[(0, j)]),
            b: b_d[0],
            #[cfg(feature = "std")]
            variance_m2: p[(0, 0)] + filter.noise().v_d_m2,
            p: *p,
        }
    }

    /// Whether a correction was made with a covariance near to the limit this map belongs to.
    pub(crate) fn suits(&self, step: &Step) -> bool {
        !step.innovation_m.is_nan() && distance(&self.p, &step.prior.p) <= NEAR
    }

    /// One sample: the state after it, and its innovation.
    ///
    /// Sums are taken as trees, or each sample would wait for eight additions in a row.
    #[inline]
    pub(crate) fn step(&self, [x0, x1, x2]: [f64; 3], y_m: f64, load_n: f64) -> ([f64; 3], f64) {
        let Self { f, g, k, a, b, .. } = self;
        let e_m = (y_m - b * load_n) - (a[0] * x0 + (a[1] * x1 + a[2] * x2));
        let next = |i: usize| ((g[i] * load_n + k[i] * y_m) + f[i][0] * x0) + (f[i][1] * x1 + f[i][2] * x2);
        ([next(0), next(1), next(2)], e_m)
    }

    /// The last state, and the sum of the squared innovations.
    #[cfg(feature = "std")]
    #[inline]
    pub(crate) fn run(
        &self,
        x: Vector3<f64>,
        y_m: &[f64],
        load_n: &[f64],
        s_m: &mut [f64],
        mut note: impl FnMut(usize, f64),
    ) -> (Vector3<f64>, f64) {
        let mut x = [x[0], x[1], x[2]];
        let mut squares_m2 = 0.0;
        for (at, ((&y, &u), s)) in y_m.iter().zip(load_n).zip(s_m).enumerate() {
            let e_m;
            (x, e_m) = self.step(x, y, u);
            *s = x[2];
            squares_m2 += e_m * e_m;
            note(at, e_m);
        }
        (Vector3::from(x), squares_m2)
    }
}
