//! Extent of a channel.

use crate::gap::statistic::extremes;

/// Middle and half length of what values span; a negative length where there are none.
pub(crate) fn middle_and_half(values: &[f64]) -> (f64, f64) {
    let (low, high) = extremes(values);
    let low = low.into_iter().fold(f64::INFINITY, f64::min);
    let high = high.into_iter().fold(f64::NEG_INFINITY, f64::max);
    (0.5 * (low + high), 0.5 * (high - low))
}
