//! Normal distribution with a quadrature rule, medians, and quantiles of weighted samples.

use std::f64::consts::FRAC_1_SQRT_2;

/// 95 % quantile of the standard normal distribution: half the width of a 90 % interval, in standard deviations.
pub(crate) const NORMAL_95: f64 = 1.644_853_626_951_472_2;

/// Normal distribution function Φ(z), to the last bits also far in the lower tail.
pub(crate) fn normal_cdf(z: f64) -> f64 {
    0.5 * libm::erfc(-z * FRAC_1_SQRT_2)
}

/// Log density of a normal distribution at its mean.
pub(crate) fn ln_peak_density(sd: f64) -> f64 {
    -sd.ln() - LN_ROOT_TAU
}

/// ln √(2π).
const LN_ROOT_TAU: f64 = 0.918_938_533_204_672_7;

/// Five-point Gauss–Hermite rule for a standard normal variable.
pub(crate) const GAUSS_HERMITE_5: [(f64, f64); 5] = [
    (-2.856_970_013_872_806, 0.011_257_411_327_720_69),
    (-1.355_626_179_974_266, 0.222_075_922_005_612_6),
    (0.0, 0.533_333_333_333_333_3),
    (1.355_626_179_974_266, 0.222_075_922_005_612_6),
    (2.856_970_013_872_806, 0.011_257_411_327_720_69),
];

/// Standard deviation of a normal distribution over its median absolute deviation: 1/Φ⁻¹(3/4).
pub(crate) const SD_OVER_MAD: f64 = 1.482_602_218_505_602;

/// The median of some values; none of nothing.
pub fn median(mut values: Vec<f64>) -> Option<f64> {
    let (middle, is_even) = (values.len() / 2, values.len().is_multiple_of(2));
    if values.is_empty() {
        return None;
    }
    let (below, upper, _) = values.select_nth_unstable_by(middle, f64::total_cmp);
    let lower = below.iter().copied().max_by(f64::total_cmp).filter(|_| is_even);
    Some(lower.map_or(*upper, |lower| 0.5 * (lower + *upper)))
}

pub(crate) struct WeightedSamples {
    values: Vec<(f64, f64)>,
    pub(crate) total: f64,
}

impl WeightedSamples {
    pub(crate) fn new(values: impl Iterator<Item = (f64, f64)>) -> Self {
        let mut values: Vec<(f64, f64)> = values.collect();
        values.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let total = values.iter().map(|v| v.1).sum();
        Self { values, total }
    }

    /// The first value at which this share of the weight is reached; zero of nothing.
    pub(crate) fn quantile(&self, share: f64) -> f64 {
        let mut sum = 0.0;
        let reached = self.values.iter().find(|(_, weight)| {
            sum += weight;
            sum >= share * self.total
        });
        reached.or(self.values.last()).map_or(0.0, |(value, _)| *value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 50-digit values from mpmath.
    #[test]
    fn the_normal_tail_holds_to_the_last_digits() {
        for (z, p) in [(-0.3, 0.382_088_577_811_047_4), (-5.0, 2.866_515_718_791_939e-7)] {
            assert!((normal_cdf(z) / p - 1.0).abs() < 1e-14, "{z}: {}", normal_cdf(z));
        }
    }

    /// A rule of n points is exact for powers below 2n (Abramowitz and Stegun 1964, 25.4.46); the moments of a standard
    /// normal variable are 1, 0, 1, 0, 3, 0, 15, 0, 105.
    #[test]
    fn rules_have_the_moments_of_a_normal_variable() {
        const MOMENTS: [f64; 10] = [1.0, 0.0, 1.0, 0.0, 3.0, 0.0, 15.0, 0.0, 105.0, 0.0];
        for (power, moment) in MOMENTS.iter().enumerate() {
            let found: f64 = GAUSS_HERMITE_5.iter().map(|(z, weight)| weight * z.powi(power as i32)).sum();
            assert!((found - moment).abs() < 1e-12 * moment.max(1.0), "{power}: {found}, not {moment}");
        }
    }
}
