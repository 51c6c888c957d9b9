//! The settled filter as one map with constant coefficients, shared by the batch and the stream.

use nalgebra::{Matrix3, Vector3};

#[cfg(feature = "std")]
use crate::eight::Eight;
use crate::filter::{Filter, Step, distance};

/// The folded map takes over when the covariance is this near to its limit, as a share of itself. The
/// difference leaves a share as small in S, and is forgotten.
const NEAR: f64 = 1e-13;

/// Samples whose squared innovations are added up by themselves before their sum is added to all others: the
/// order of additions is part of a number, and this one suits vectors.
#[cfg(feature = "std")]
pub(crate) const TILE: usize = 8;

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

    /// Samples one after the other: the last state, and a sum with the squared innovations added, [`TILE`] by
    /// [`TILE`].
    #[cfg(feature = "std")]
    #[inline]
    pub(crate) fn run(
        &self,
        mut x: [f64; 3],
        mut squares_m2: f64,
        (y_m, load_n): (&[f64], &[f64]),
        s_m: &mut [f64],
        mut note: impl FnMut(usize, f64),
    ) -> ([f64; 3], f64) {
        let tiles = y_m.chunks(TILE).zip(load_n.chunks(TILE)).zip(s_m.chunks_mut(TILE));
        for (tile, ((y_m, load_n), s_m)) in tiles.enumerate() {
            let mut tile_m2 = 0.0;
            for (at, ((&y, &u), s)) in y_m.iter().zip(load_n).zip(s_m).enumerate() {
                let e_m;
                (x, e_m) = self.step(x, y, u);
                *s = x[2];
                tile_m2 += e_m * e_m;
                note(TILE * tile + at, e_m);
            }
            squares_m2 += tile_m2;
        }
        (x, squares_m2)
    }

    /// The same map for eight series side by side.
    #[cfg(feature = "std")]
    #[inline(always)]
    #[allow(clippy::inline_always, reason = "see `eight`")]
    pub(crate) fn wide<E: Eight>(&self) -> Wide<E> {
        let Self { f: [p, q, r], g, k, a, b, .. } = self;
        Wide { f: [three(p), three(q), three(r)], g: three(g), k: three(k), a: three(a), b: E::all(*b) }
    }
}

#[cfg(feature = "std")]
#[inline(always)]
#[allow(clippy::inline_always, reason = "see `eight`")]
fn three<E: Eight>(v: &[f64; 3]) -> [E; 3] {
    [E::all(v[0]), E::all(v[1]), E::all(v[2])]
}

/// [`Folded`] for eight series at a time.
#[cfg(feature = "std")]
#[derive(Debug, Clone, Copy)]
pub(crate) struct Wide<E> {
    f: [[E; 3]; 3],
    g: [E; 3],
    k: [E; 3],
    a: [E; 3],
    b: E,
}

#[cfg(feature = "std")]
impl<E: Eight> Wide<E> {
    /// [`Folded::step`], operation by operation: each series has the bits it would have alone.
    #[inline(always)]
    #[allow(clippy::inline_always, reason = "see `eight`")]
    pub(crate) fn step(&self, [x0, x1, x2]: [E; 3], y_m: E, load_n: E) -> ([E; 3], E) {
        let Self { f, g, k, a, b } = self;
        let seen_m = a[0].times(x0).plus(a[1].times(x1).plus(a[2].times(x2)));
        let e_m = y_m.less(b.times(load_n)).less(seen_m);
        let mut next = [x0; 3];
        for i in 0..3 {
            let pushed = g[i].times(load_n).plus(k[i].times(y_m)).plus(f[i][0].times(x0));
            next[i] = pushed.plus(f[i][1].times(x1).plus(f[i][2].times(x2)));
        }
        (next, e_m)
    }
}
