//! Quadrature rules.

/// Five-point Gauss–Hermite rule for a standard normal variable.
pub(crate) const GAUSS_HERMITE_5: [(f64, f64); 5] = [
    (-2.856_970_013_872_806, 0.011_257_411_327_720_69),
    (-1.355_626_179_974_266, 0.222_075_922_005_612_6),
    (0.0, 0.533_333_333_333_333_3),
    (1.355_626_179_974_266, 0.222_075_922_005_612_6),
    (2.856_970_013_872_806, 0.011_257_411_327_720_69),
];

/// Quantiles of an exponential wait, one for each tenth.
pub(crate) const WAIT_QUANTILES: usize = 10;

#[cfg(test)]
mod tests {
    use super::*;

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
