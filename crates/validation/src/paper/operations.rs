//! Operations of one step of the filter, counted while they are done.

use std::cell::Cell;
use std::ops::{Add, Div, Mul, Sub};

use estimator::{Filter, KalmanState};

/// Multiplications, additions with subtractions, and divisions.
pub type OperationCount = [u32; 3];

thread_local! {
    static DONE: Cell<OperationCount> = const { Cell::new([0; 3]) };
}

/// A number that counts what is done with it.
#[derive(Debug, Clone, Copy)]
struct Counted(f64);

impl Counted {
    /// The result of an operation of a kind, an index into [`OperationCount`].
    fn of(kind: usize, result: f64) -> Self {
        let mut done = DONE.get();
        done[kind] += 1;
        DONE.set(done);
        Self(result)
    }
}

impl Mul for Counted {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Self::of(0, self.0 * other.0)
    }
}

impl Add for Counted {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self::of(1, self.0 + other.0)
    }
}

impl Sub for Counted {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self::of(1, self.0 - other.0)
    }
}

impl Div for Counted {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        Self::of(2, self.0 / other.0)
    }
}

type Vector = [Counted; 3];
type Matrix = [Vector; 3];

fn each(entry: impl Fn(usize, usize) -> Counted) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)))
}

fn dot(row: impl Fn(usize) -> Counted, column: impl Fn(usize) -> Counted) -> Counted {
    row(0) * column(0) + row(1) * column(1) + row(2) * column(2)
}

/// Half of the sum with the transpose.
fn symmetric(p: &Matrix) -> Matrix {
    each(|i, j| (p[i][j] + p[j][i]) * Counted(0.5))
}

/// One whole step of the recursion written out, and its operations: the state prediction (24), the covariance
/// prediction (25), the gain (26), the state correction (27) and the covariance correction (28).
///
/// The step has no loop whose length depends on data and no branch on a measured sample, so the count is also that of
/// the worst step.
pub fn count_step(
    filter: &Filter,
    state: &KalmanState,
    load_n: f64,
    y_m: f64,
) -> ([OperationCount; 5], KalmanState) {
    let a = each(|i, j| Counted(filter.discrete().a_d[(i, j)]));
    let b = filter.discrete().b_d;
    let w = each(|i, j| Counted(filter.noise().w_d[(i, j)]));
    let x: Vector = std::array::from_fn(|i| Counted(state.x[i]));
    let p = each(|i, j| Counted(state.p[(i, j)]));
    let mut marks = vec![DONE.get()];
    let x: Vector = std::array::from_fn(|i| dot(|k| a[i][k], |k| x[k]) + Counted(b[i]) * Counted(load_n));
    marks.push(DONE.get());
    let ap = each(|i, j| dot(|k| a[i][k], |k| p[k][j]));
    let p = symmetric(&each(|i, j| dot(|k| ap[i][k], |k| a[j][k]) + w[i][j]));
    marks.push(DONE.get());
    let variance_m2 = p[0][0] + Counted(filter.noise().v_d_m2);
    let gain: Vector = std::array::from_fn(|i| p[i][0] / variance_m2);
    marks.push(DONE.get());
    let innovation_m = Counted(y_m) - x[0];
    let x: Vector = std::array::from_fn(|i| x[i] + gain[i] * innovation_m);
    marks.push(DONE.get());
    let p = symmetric(&each(|i, j| p[i][j] - gain[i] * p[0][j]));
    marks.push(DONE.get());
    let mut next = *state;
    for i in 0..3 {
        next.x[i] = x[i].0;
        (0..3).for_each(|j| next.p[(i, j)] = p[i][j].0);
    }
    let since = |k: usize| std::array::from_fn(|kind| marks[k + 1][kind] - marks[k][kind]);
    (std::array::from_fn(since), next)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::paper::{Assumed, STEP_S, filter};

    /// By hand: (24) 12 × and 9 +; (25) two products of 27 × and 18 +, 9 +, and 9 × and 9 + of the symmetry; (26) 1 +
    /// and 3 ÷; (27) 3 × and 4 +; (28) 18 × and 18 +.
    #[test]
    fn a_step_takes_185_operations_and_is_the_filter_s() {
        let filter = filter(Assumed::default(), &simulator::Sensors::default(), STEP_S).unwrap();
        let before = filter.update(&filter.initial_state(1e-4, 4e3), 1.1e-4).unwrap().posterior;
        let (counts, after) = count_step(&filter, &before, 3e3, 1.3e-4);
        assert_eq!(counts, [[12, 9, 0], [63, 54, 0], [0, 1, 3], [3, 4, 0], [18, 18, 0]]);
        assert_eq!(counts.iter().flatten().sum::<u32>(), 185);
        let wanted = filter.update(&filter.predict(&before, 3e3), 1.3e-4).unwrap().posterior;
        let x_apart = (after.x - wanted.x).abs().component_div(&wanted.x.abs()).max();
        let p_apart = (after.p - wanted.p).abs().max() / wanted.p.abs().max();
        assert!(x_apart < 1e-12 && p_apart < 1e-12, "{x_apart} {p_apart}");
    }
}
