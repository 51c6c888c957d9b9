//! Normal distribution function.

use std::f64::consts::FRAC_1_SQRT_2;

/// 95 % quantile of the standard normal distribution: half the width of a 90 % interval, in standard deviations.
pub(crate) const NORMAL_95: f64 = 1.644_853_626_951_472_2;

/// Normal distribution function Φ(z), to the last bits also far in the lower tail.
pub(crate) fn cdf(z: f64) -> f64 {
    0.5 * libm::erfc(-z * FRAC_1_SQRT_2)
}

/// Log density of a normal distribution at its mean.
pub(crate) fn ln_peak_density(sd: f64) -> f64 {
    -sd.ln() - LN_ROOT_TAU
}

/// ln √(2π).
const LN_ROOT_TAU: f64 = 0.918_938_533_204_672_7;

#[cfg(test)]
mod tests {
    use super::*;

    /// 50-digit values from mpmath.
    #[test]
    fn the_normal_tail_holds_to_the_last_digits() {
        for (z, p) in [(-0.3, 0.382_088_577_811_047_4), (-5.0, 2.866_515_718_791_939e-7)] {
            assert!((cdf(z) / p - 1.0).abs() < 1e-14, "{z}: {}", cdf(z));
        }
    }
}
