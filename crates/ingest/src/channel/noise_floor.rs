//! White noise of a channel, estimated from the channel itself by differences of high order.
//!
//! A difference of order m suppresses smooth motion and multiplies the variance of white noise by the binomial
//! coefficient C(2m, m). Its mean square over short blocks is therefore the noise variance where motion is smooth
//! enough, and larger elsewhere. The noise is the scale of the quietest blocks: the smallest σ at which the counts of
//! blocks below two of its χ² quantiles have the ratio that white noise gives (Wilson and Hilferty 1931,
//! <https://doi.org/10.1073/pnas.17.12.684>), whatever the share of quiet blocks.

use std::ops::Range;

use crate::channel::stats::range;

/// White noise of a channel and its uncertainty, in the channel's unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WhiteNoise {
    /// Root mean square, without the rounding to the channel's resolution.
    pub rms: f64,
    /// Standard uncertainty of `rms`.
    pub uncertainty: f64,
}

/// Samples of a block.
const BLOCK: usize = 32;
/// Samples on either side of a block that must move with it where the channel is quantised.
const MARGIN: usize = 16;
/// Orders of difference that are compared, the lowest first.
const ORDERS: [usize; 4] = [3, 5, 7, 9];
/// Standard normal deviates of the two probabilities at which blocks are counted, and these probabilities.
const LOW: (f64, f64) = (-0.8416, 0.2);
const HIGH: (f64, f64) = (0.2533, 0.6);
/// The counts' ratio may fall short of that of pure noise by this factor: louder blocks reach below the upper quantile.
const RATIO_SHARE: f64 = 0.9;
/// Fewest quiet blocks, as a number and as a share of all.
const MIN_BLOCKS: usize = 40;
const MIN_SHARE: f64 = 0.02;
/// Most samples that are read; of a longer channel as many in stretches that are spread over it.
const MAX_SAMPLES: usize = 1 << 17;
/// Samples of such a stretch.
const STRETCH: usize = 1024;
/// A quantised channel must span this many steps about a block; where it rests on one step, rounding is not white.
const MIN_STEPS: f64 = 3.0;
/// Relative uncertainty that remains however many blocks there are.
const SYSTEMATIC: f64 = 0.03;

/// White noise of a channel; `None` where too few blocks are complete, or move by more than the resolution.
///
/// Rounding to steps adds step²/12 to the variance and is subtracted. A channel that repeats every value k times, or
/// holds one in k rows, is taken at its own rate. NaN marks a missing sample.
pub fn white_noise(values: &[f64], resolution: Option<f64>) -> Option<WhiteNoise> {
    white_noise_of(values, resolution, MAX_SAMPLES)
}

/// As [`white_noise`], from at most `most_samples` samples.
pub(crate) fn white_noise_of(
    values: &[f64],
    resolution: Option<f64>,
    most_samples: usize,
) -> Option<WhiteNoise> {
    let own = own_samples(values, most_samples);
    let blocks = block_variances(&own, resolution.unwrap_or(0.0));
    let levels: Vec<Level> =
        ORDERS.iter().zip(blocks).filter_map(|(order, variances)| quiet_level(*order, variances)).collect();
    let mut best = *levels.first()?;
    let mut fall = 0.0;
    // A higher order is taken while it shows less motion.
    for level in levels.get(1..)? {
        if level.rms >= best.rms * (1.0 - 0.7 * level.relative) {
            break;
        }
        fall = best.rms / level.rms - 1.0;
        best = *level;
    }
    let rounding = resolution.map_or(0.0, |step| step * step / 12.0);
    let rms = (best.rms * best.rms - rounding).max(0.0).sqrt();
    let share = best.relative.hypot(SYSTEMATIC).hypot(0.5 * fall);
    // dσ = (total/σ) d(total); near zero the rounding bounds it.
    let uncertainty = share * best.rms * (best.rms / rms.max(0.5 * best.rms));
    Some(WhiteNoise { rms, uncertainty })
}

/// Noise scale of the quietest blocks at one order of difference.
#[derive(Debug, Clone, Copy)]
struct Level {
    rms: f64,
    relative: f64,
}

/// All of a channel as one stretch, or stretches that are spread evenly over one of more than `most` samples.
fn stretches(samples: usize, most: usize) -> impl Iterator<Item = Range<usize>> {
    let (count, length) = if samples <= most { (1, samples) } else { (most / STRETCH, STRETCH) };
    (0..count).map(move |k| k * (samples - length) / count).map(move |start| start..start + length)
}

/// At most `most` samples of a channel. Of one recorded every k-th row, those that are present, or the first of each k equal
/// ones.
fn own_samples(values: &[f64], most: usize) -> Vec<f64> {
    const MAX_INTERVAL: usize = 20;
    const MOST: f64 = 0.95;
    /// Changes that show the interval: the first ones, since a lost row moves all later ones.
    const MAX_CHANGES: usize = 4096;
    let places = || stretches(values.len(), most).flatten();
    let samples: Vec<f64> = places().map(|i| values[i]).collect();
    let missing = samples.iter().filter(|v| v.is_nan()).count();
    if 5 * missing >= 2 * samples.len() {
        return samples.into_iter().filter(|v| !v.is_nan()).collect();
    }
    let changes = (1..values.len()).filter(|&i| values[i].to_bits() != values[i - 1].to_bits());
    let changes: Vec<usize> = changes.take(MAX_CHANGES).collect();
    let rows = changes.last().map_or(0, |last| last + 1);
    if 3 * changes.len() > 2 * rows || changes.len() < MIN_BLOCKS {
        return samples;
    }
    let at_one_phase = |every: usize| {
        let mut counts = vec![0_usize; every];
        changes.iter().for_each(|i| counts[i % every] += 1);
        let phase = (0..every).max_by_key(|&phase| counts[phase])?;
        (counts[phase] as f64 >= MOST * changes.len() as f64).then_some((every, phase))
    };
    let Some((every, phase)) = (2..=MAX_INTERVAL).rev().find_map(at_one_phase) else { return samples };
    places().filter(|i| i % every == phase).map(|i| values[i]).collect()
}

/// Noise variances of all blocks, for each order; blocks with a missing sample, or at rest, are left out.
fn block_variances(values: &[f64], step: f64) -> [Vec<f64>; ORDERS.len()] {
    let mut found: [Vec<f64>; ORDERS.len()] = std::array::from_fn(|_| Vec::new());
    for start in (0..(values.len() + 1).saturating_sub(BLOCK)).step_by(BLOCK / 2) {
        let about = &values[start.saturating_sub(MARGIN)..values.len().min(start + BLOCK + MARGIN)];
        if step > 0.0 && range(about) < MIN_STEPS * step {
            continue;
        }
        let mut differences: [f64; BLOCK] = std::array::from_fn(|k| values[start + k]);
        let (mut order, mut factor) = (0, 1.0);
        for (at, into) in ORDERS.iter().zip(&mut found) {
            while order < *at {
                order += 1;
                factor *= (4 * order - 2) as f64 / order as f64;
                (0..BLOCK - order).for_each(|k| differences[k] = differences[k + 1] - differences[k]);
            }
            let squares: f64 = differences[..BLOCK - order].iter().map(|d| d * d).sum();
            let variance = squares / (factor * (BLOCK - order) as f64);
            if variance.is_finite() {
                into.push(variance);
            }
        }
    }
    found
}

/// The smallest σ at which the counts of blocks below its two quantiles have the ratio that noise gives.
fn quiet_level(order: usize, mut variances: Vec<f64>) -> Option<Level> {
    let fewest = MIN_BLOCKS.max((MIN_SHARE * variances.len() as f64) as usize);
    if variances.len() < fewest {
        return None;
    }
    variances.sort_unstable_by(f64::total_cmp);
    let freedom = degrees_of_freedom(order);
    let (low, high) = (chi_squared_share(freedom, LOW.0), chi_squared_share(freedom, HIGH.0));
    let ratio = RATIO_SHARE * LOW.1 / HIGH.1;
    let is_noise = |&last: &usize| {
        let limit = variances[last] * low / high;
        variances[..last].partition_point(|v| *v < limit) as f64 >= ratio * (last + 1) as f64
    };
    let stride = (variances.len() / 1000).max(1);
    let last = (fewest - 1..variances.len()).step_by(stride).find(is_noise).unwrap_or(variances.len() - 1);
    // Blocks overlap by half.
    let relative = 0.8 / (0.5 * (last + 1) as f64 * freedom).sqrt();
    Some(Level { rms: (variances[last] / high).sqrt(), relative })
}

/// Degrees of freedom of a block's mean square: differences of white noise are correlated with their neighbours by
/// C(2m, m+k)/C(2m, m).
fn degrees_of_freedom(order: usize) -> f64 {
    let samples = (BLOCK - order) as f64;
    let (mut correlation, mut sum) = (1.0, samples);
    for lag in 1..=order {
        correlation *= (order - lag + 1) as f64 / (order + lag) as f64;
        sum += 2.0 * (samples - lag as f64).max(0.0) * correlation * correlation;
    }
    samples * samples / sum
}

/// Quantile of χ² over its degrees of freedom at a standard normal deviate (Wilson and Hilferty).
fn chi_squared_share(freedom: f64, deviate: f64) -> f64 {
    let spread = 2.0 / (9.0 * freedom);
    (1.0 - spread + deviate * spread.sqrt()).powi(3)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// White noise of a given rms: sums of twelve uniform numbers, the same in every run of a seed.
    pub(crate) fn noise_of(seed: u64, count: usize, rms: f64) -> Vec<f64> {
        let mut state = seed;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        (0..count).map(|_| rms * ((0..12).map(|_| uniform()).sum::<f64>() - 6.0)).collect()
    }

    fn near(values: &[f64], wanted: f64) {
        let found = white_noise(values, None).unwrap();
        assert!((found.rms / wanted - 1.0).abs() < 0.1, "{found:?}");
        assert!((found.rms - wanted).abs() < 3.0 * found.uncertainty, "{found:?}");
    }

    #[test]
    fn rounding_is_not_noise() {
        let motion = |k: usize| 0.02 * (0.003 * k as f64).sin();
        let rounded: Vec<f64> = (0..20_000).map(|k| (motion(k) / 1e-6).round() * 1e-6).collect();
        assert!(white_noise(&rounded, Some(1e-6)).unwrap().rms < 0.2e-6);
    }

    /// Every value once in four rows, and every value four times; then with a row lost now and then: the later values change
    /// at another row of four.
    #[test]
    fn a_slow_channel_is_taken_at_its_own_rate() {
        let own = noise_of(42, 100_000, 5e-6);
        let sparse: Vec<f64> = own[..8000].iter().flat_map(|v| [*v, f64::NAN, f64::NAN, f64::NAN]).collect();
        near(&sparse, 5e-6);
        let mut held: Vec<f64> = own.iter().flat_map(|v| [*v; 4]).collect();
        near(&held[..32_000], 5e-6);
        for lost in [310_001, 190_002, 90_003, 50_001] {
            held.remove(lost);
        }
        near(&held, 5e-6);
        let excerpt = white_noise_of(&held, None, 1 << 14).unwrap();
        assert!((excerpt.rms / 5e-6 - 1.0).abs() < 0.1, "{excerpt:?}");
    }

    #[test]
    fn without_enough_whole_blocks_there_is_no_estimate() {
        assert_eq!(white_noise(&[f64::NAN; 200], None), None);
        assert_eq!(white_noise(&noise_of(42, 300, 1.0), None), None);
        assert_eq!(white_noise(&vec![1.0; 20_000], Some(0.1)), None);
    }

    /// By hand: order 1 has correlations 1, −1/2; 31 differences give 31²/(31 + 2·30/4) = 20.9.
    #[test]
    fn overlapping_differences_count_for_less() {
        assert!((degrees_of_freedom(1) - 31.0 * 31.0 / 46.0).abs() < 1e-9);
    }
}
