//! Order statistics of a channel or of residuals.

use crate::gap::statistic::range;

/// Size of a subsample that shows a range, a sign, or the usual step of a channel.
pub(crate) const LOOKS: usize = 4000;

/// Middle and half length of what values span; a negative length where there are none.
pub(crate) fn middle_and_half(values: &[f64]) -> (f64, f64) {
    let (low, high) = range(values);
    (0.5 * (low + high), 0.5 * (high - low))
}

/// Normal standard deviations in a median absolute deviation.
pub(crate) const MAD: f64 = 1.482_602_218_505_602;

/// The median of values, of an even number the upper of the middle two; zero of none. The values are put in another order.
pub(crate) fn median(values: &mut [f64]) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Standard deviation of normal values about zero, from the median of their sizes.
pub(crate) fn spread(values: impl Iterator<Item = f64>) -> f64 {
    MAD * median(&mut values.map(f64::abs).collect::<Vec<f64>>())
}

/// Rms of the second difference of a channel, which slow loads do not show.
pub(crate) fn second_difference_rms(values: &[f64]) -> f64 {
    let (mut squares, mut count) = (0.0, 0_usize);
    for [before, here, after] in values.array_windows() {
        let difference = before - 2.0 * here + after;
        if difference.is_finite() {
            squares += difference * difference;
            count += 1;
        }
    }
    (squares / count.max(1) as f64).sqrt()
}
