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

/// The median of values and its standard error, where those of one stretch count as one; none of fewer than five.
pub(crate) fn median_and_error(values: impl Iterator<Item = (f64, u32)>) -> Option<(f64, f64)> {
    let (mut values, mut stretches): (Vec<f64>, Vec<u32>) = values.unzip();
    if values.len() < 5 {
        return None;
    }
    stretches.sort_unstable();
    stretches.dedup();
    let middle = median(&mut values);
    values.iter_mut().for_each(|value| *value = (*value - middle).abs());
    // A median of a normal sample scatters so much more than its mean: √(π/2).
    Some((middle, 1.253_314_137_315_5 * MAD * median(&mut values) / (stretches.len() as f64).sqrt()))
}

/// Standard deviation of normal values about zero, from the median of their sizes.
pub(crate) fn spread(values: impl Iterator<Item = f64>) -> f64 {
    MAD * median(&mut values.map(f64::abs).collect::<Vec<f64>>())
}

/// Sums over the neighbours of which none is missing: of the square of their second difference, which slow loads do not
/// show, of the square of the middle one, and of 1.
pub(crate) fn second_differences(values: impl Iterator<Item = f64>) -> [f64; 3] {
    let (mut sums, mut before, mut here) = ([0.0; 3], f64::NAN, f64::NAN);
    for after in values {
        let difference = before - 2.0 * here + after;
        if difference.is_finite() {
            sums = [sums[0] + difference * difference, sums[1] + here * here, sums[2] + 1.0];
        }
        (before, here) = (here, after);
    }
    sums
}
