//! Median, and the scatter by a median.

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
