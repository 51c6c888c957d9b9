//! Scatter of the gaps of simulated histories.

/// Scatter of ± 1 µm (1 sd), the same in every run: twelve uniform numbers less six.
pub(crate) fn scatter_um(unit: i32, day: i32) -> f64 {
    let mut random = fastrand::Rng::with_seed((i64::from(unit) * 100_003 + i64::from(day)) as u64);
    (0..12).map(|_| random.f64()).sum::<f64>() - 6.0
}
