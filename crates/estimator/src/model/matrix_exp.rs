//! The exponential of a small matrix, with a standard library and without.

use nalgebra::SMatrix;
#[cfg(any(test, not(feature = "std")))]
use nalgebra::linalg::balancing::{balance_parlett_reinsch, unbalance};

/// Matrix exponential e^M by Padé approximants (Higham 2005). Stored results depend on its exact bits.
#[cfg(feature = "std")]
pub(crate) fn exponential<const N: usize>(m: &SMatrix<f64, N, N>) -> SMatrix<f64, N, N>
where
    nalgebra::Const<N>: nalgebra::DimMin<nalgebra::Const<N>, Output = nalgebra::Const<N>>,
{
    m.exp()
}

/// Matrix exponential without `std`, where `nalgebra` has none.
#[cfg(not(feature = "std"))]
pub(crate) use by_series as exponential;

/// Halvings that bring the norm of M below a half for any physical parameters.
#[cfg(any(test, not(feature = "std")))]
const HALVINGS: i32 = 64;
/// Terms of the series; 0.5¹⁸/18! is far below the last bit.
#[cfg(any(test, not(feature = "std")))]
const TERMS: u32 = 18;

/// e^M = (e^{M/2^h})^{2^h}, with the least h for which the norm of M/2^h is at most a half, and e^{M/2^h} by its series.
///
/// M is balanced first, by powers of two: without it a stiff spring needs twenty squarings, each of
/// which may double the rounding error.
#[cfg(any(test, not(feature = "std")))]
pub(crate) fn by_series<const N: usize>(m: &SMatrix<f64, N, N>) -> SMatrix<f64, N, N> {
    let norm = |m: &SMatrix<f64, N, N>| {
        (0..N).map(|j| m.column(j).iter().map(|v| v.abs()).sum()).fold(0.0, f64::max)
    };
    let (mut small, mut halvings) = (*m, 0);
    let units = balance_parlett_reinsch(&mut small);
    while norm(&small) > 0.5 && halvings < HALVINGS {
        small *= 0.5;
        halvings += 1;
    }
    // Horner's order: I + M(I + M/2(I + M/3(…))).
    let one = SMatrix::<f64, N, N>::identity();
    let mut sum = one;
    for term in (1..=TERMS).rev() {
        sum = one + small * sum / f64::from(term);
    }
    for _ in 0..halvings {
        sum *= sum;
    }
    unbalance(&mut sum, &units);
    sum
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix4;

    use super::{by_series, exponential};

    /// An actuator's mode from far below to far above the sample rate, undamped and damped. The vectors of `tests/data/lkf`
    /// hold nalgebra's exponential against 50 digits.
    #[test]
    fn the_series_agrees_with_the_approximants() {
        for (stiffness_per_s2, damping_per_s, step_s) in
            [(6e6, 250.0, 0.004), (1e8, 40.0, 0.01), (3e5, 2000.0, 0.001), (2e4, 0.0, 0.02)]
        {
            let mut m = Matrix4::zeros();
            m[(0, 1)] = 1.0;
            (m[(1, 0)], m[(1, 1)], m[(1, 2)]) = (-stiffness_per_s2, -damping_per_s, stiffness_per_s2);
            m[(1, 3)] = 0.125;
            m *= step_s;
            for at in [(0, 0), (0, 1), (0, 3), (1, 0), (1, 1), (1, 3)] {
                let (found, wanted) = (by_series(&m)[at], exponential(&m)[at]);
                assert!((found / wanted - 1.0).abs() < 1e-12, "{step_s}: {at:?} {found:e} is not {wanted:e}");
            }
        }
    }
}
