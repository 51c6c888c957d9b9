//! Scatter of the gaps of simulated histories.

/// Scatter of ± 1 µm (1 sd), the same in every run: twelve uniform numbers less six.
pub(crate) fn scatter_um(unit: i32, day: i32) -> f64 {
    let mut state = (i64::from(unit) * 100_003 + i64::from(day) + 1) as u64;
    state = state.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let mut uniform = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    (0..12).map(|_| uniform()).sum::<f64>() - 6.0
}
