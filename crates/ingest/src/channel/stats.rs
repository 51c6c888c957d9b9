//! What can be seen of a channel in one pass over it: sound channels need no other.
//!
//! Columns are longer than any cache, so each further pass would cost as much as reading memory; where it can, this one
//! follows what reads the column. The pass goes in groups of samples whose figures are kept apart, since a chain of
//! comparisons is as slow as its links.

use multiversion::multiversion;
use smart_default::SmartDefault;

/// Samples in a group.
const LANES: usize = 8;

/// Figures of a channel; missing samples are NaN, and compare as nothing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ChannelStats {
    /// Smallest value; infinite where there is none.
    pub(crate) min: f64,
    /// Largest value; minus infinite where there is none.
    pub(crate) max: f64,
    pub(crate) missing: usize,
    /// Smallest step between neighbours that differ; infinite where none do.
    pub(crate) min_step: f64,
    /// Furthest that a sample lies from the middle of its neighbours.
    pub(crate) max_second_difference: f64,
    /// Most samples in a row that repeat one value.
    pub(crate) longest_run: usize,
}

/// Looks at a channel that grows, at what is new of it.
#[derive(Debug, Clone, SmartDefault)]
pub(crate) struct StatsAccumulator {
    #[default([f64::INFINITY; LANES])]
    low: [f64; LANES],
    #[default([f64::NEG_INFINITY; LANES])]
    high: [f64; LANES],
    missing: [u64; LANES],
    #[default([f64::INFINITY; LANES])]
    min_step: [f64; LANES],
    max_second_difference: [f64; LANES],
    /// Repeats up to here, and most of them.
    repeats: usize,
    most_repeats: usize,
    /// Samples processed so far; the last ones wait for their successors.
    done: usize,
}

impl StatsAccumulator {
    /// The channel as far as it is known by now, from its first sample on.
    pub(crate) fn advance(&mut self, values: &[f64]) {
        groups(self, values);
    }

    pub(crate) fn end(mut self, values: &[f64]) -> ChannelStats {
        self.advance(values);
        let at = |k: usize| values.get(k).copied().unwrap_or(f64::NAN);
        for k in self.done..values.len() {
            self.one(0, [at(k), at(k + 1), at(k + 2)]);
            self.count_repeat(at(k), at(k + 1));
        }
        ChannelStats {
            min: self.low.into_iter().fold(f64::INFINITY, min),
            max: self.high.into_iter().fold(f64::NEG_INFINITY, max),
            missing: self.missing.iter().sum::<u64>() as usize,
            min_step: self.min_step.into_iter().fold(f64::INFINITY, min),
            max_second_difference: self.max_second_difference.into_iter().fold(0.0, max),
            longest_run: if values.is_empty() { 0 } else { self.most_repeats + 1 },
        }
    }

    #[inline]
    fn one(&mut self, lane: usize, [at, next, after]: [f64; 3]) {
        self.low[lane] = min(self.low[lane], at);
        self.high[lane] = max(self.high[lane], at);
        self.missing[lane] += u64::from(at.is_nan());
        let step = (next - at).abs();
        self.min_step[lane] = min(self.min_step[lane], if step > 0.0 { step } else { f64::INFINITY });
        let second_difference = (next - 0.5 * (at + after)).abs();
        self.max_second_difference[lane] = max(self.max_second_difference[lane], second_difference);
    }

    #[inline]
    #[expect(clippy::float_cmp, reason = "a frozen channel repeats its bits")]
    fn count_repeat(&mut self, at: f64, next: f64) {
        self.repeats = if at == next { self.repeats + 1 } else { 0 };
        self.most_repeats = self.most_repeats.max(self.repeats);
    }
}

/// Looks at whole groups. Vectors change no figure: comparisons and halves are exact in all.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq", "x86_64+avx2"))]
#[expect(clippy::float_cmp, reason = "a frozen channel repeats its bits")]
fn groups(stats: &mut StatsAccumulator, values: &[f64]) {
    // In registers while the loop runs.
    let mut own = stats.clone();
    while let Some(group) = values[own.done..].first_chunk::<{ LANES + 2 }>() {
        let mut has_repeat = false;
        for lane in 0..LANES {
            own.one(lane, [group[lane], group[lane + 1], group[lane + 2]]);
            has_repeat |= group[lane] == group[lane + 1];
        }
        if has_repeat {
            (0..LANES).for_each(|lane| own.count_repeat(group[lane], group[lane + 1]));
        } else {
            own.repeats = 0;
        }
        own.done += LANES;
    }
    *stats = own;
}

/// The min; the first where the second is no number. One instruction, unlike [`f64::min`].
#[inline]
fn min(known: f64, new: f64) -> f64 {
    if new < known { new } else { known }
}

#[inline]
fn max(known: f64, new: f64) -> f64 {
    if new > known { new } else { known }
}

/// The value below which this share of all values lies; reorders them.
pub(crate) fn quantile(values: &mut [f64], share: f64) -> Option<f64> {
    let at = (share * values.len().checked_sub(1)? as f64).round() as usize;
    Some(*values.select_nth_unstable_by(at, f64::total_cmp).1)
}

/// Largest less smallest value; minus infinity where there is none.
pub(crate) fn range(values: &[f64]) -> f64 {
    let (low, high) = span(values);
    high - low
}

/// Smallest and largest value; infinite where there is none.
pub(crate) fn span(values: &[f64]) -> (f64, f64) {
    let (mut low, mut high) = ([f64::INFINITY; LANES], [f64::NEG_INFINITY; LANES]);
    for group in values.chunks(LANES) {
        for (lane, value) in group.iter().enumerate() {
            (low[lane], high[lane]) = (min(low[lane], *value), max(high[lane], *value));
        }
    }
    (low.into_iter().fold(f64::INFINITY, min), high.into_iter().fold(f64::NEG_INFINITY, max))
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "a repeat is one to the bit")]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// A channel of few values, some of which stay for a while, with holes.
    fn channel() -> impl Strategy<Value = Vec<f64>> {
        let stays = prop_oneof![8 => Just(1_usize), 1 => 1_usize..12, 1 => 1_usize..200];
        proptest::collection::vec((-3_i32..4, stays), 0..120).prop_map(|ticks| {
            let value = |k: i32| if k == -3 { f64::NAN } else { f64::from(k) * 0.5 };
            ticks.into_iter().flat_map(|(k, stays)| std::iter::repeat_n(value(k), stays)).collect()
        })
    }

    proptest! {
        /// However a channel with repeats and holes grows, one pass sees what a pass for each figure does.
        #[test]
        fn the_lanes_see_what_plain_passes_do(values in channel(), step in 1_usize..170) {
            let mut scanner = StatsAccumulator::default();
            (0..values.len()).step_by(step).for_each(|end| scanner.advance(&values[..end]));
            let seen = scanner.end(&values);
            let known = || values.iter().copied().filter(|v| !v.is_nan());
            prop_assert_eq!(seen.min.to_bits(), known().fold(f64::INFINITY, f64::min).to_bits());
            prop_assert_eq!(seen.max.to_bits(), known().fold(f64::NEG_INFINITY, f64::max).to_bits());
            prop_assert_eq!(seen.missing, values.len() - known().count());
            let steps = values.windows(2).map(|w| (w[1] - w[0]).abs()).filter(|s| *s > 0.0);
            prop_assert_eq!(seen.min_step.to_bits(), steps.fold(f64::INFINITY, f64::min).to_bits());
            let leaps = values.windows(3).map(|w| (w[1] - 0.5 * (w[0] + w[2])).abs());
            prop_assert_eq!(seen.max_second_difference.to_bits(), leaps.fold(0.0, f64::max).to_bits());
            let run = values.chunk_by(|a, b| a == b).map(<[f64]>::len).max();
            prop_assert_eq!(seen.longest_run, run.unwrap_or(0));
        }
    }
}
