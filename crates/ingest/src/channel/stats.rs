//! Figures of a channel, gathered in one pass that follows the decoder: columns are longer than any cache, so each further
//! pass would cost as much as reading memory.

/// Samples whose range is found side by side: a chain of comparisons is as slow as its links.
const LANES: usize = 8;

/// Figures of a channel; missing samples are NaN, and compare as nothing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ChannelStats {
    /// Smallest value; infinite where there is none.
    pub(crate) min: f64,
    /// Largest value; minus infinite where there is none.
    pub(crate) max: f64,
    /// Samples without a value.
    pub(crate) missing: usize,
    /// Smallest step between neighbours that differ; infinite where none do.
    pub(crate) min_step: f64,
    /// Furthest that a sample lies from the middle of its neighbours.
    pub(crate) max_second_difference: f64,
    /// Most samples in a row that repeat one value.
    pub(crate) longest_run: usize,
}

impl ChannelStats {
    /// Looks at a channel.
    pub(crate) fn of(values: &[f64]) -> Self {
        StatsAccumulator::new().end(values)
    }
}

/// Figures of a channel that grows.
#[derive(Debug, Clone)]
pub(crate) struct StatsAccumulator {
    stats: ChannelStats,
    /// Samples up to the latest one that repeat its value.
    run: usize,
    /// Samples processed so far.
    done: usize,
}

impl StatsAccumulator {
    pub(crate) fn new() -> Self {
        let stats = ChannelStats {
            min: f64::INFINITY,
            max: f64::NEG_INFINITY,
            missing: 0,
            min_step: f64::INFINITY,
            max_second_difference: 0.0,
            longest_run: 0,
        };
        Self { stats, run: 0, done: 0 }
    }

    /// Takes in what is new of the channel, given from its first sample on.
    #[expect(clippy::float_cmp, reason = "a frozen channel repeats its bits")]
    pub(crate) fn advance(&mut self, values: &[f64]) {
        let known = |back: usize| self.done.checked_sub(back).map_or(f64::NAN, |at| values[at]);
        let (mut earlier, mut before) = (known(2), known(1));
        let (mut stats, mut run) = (self.stats, self.run);
        for &at in &values[self.done..] {
            stats.min = min(stats.min, at);
            stats.max = max(stats.max, at);
            stats.missing += usize::from(at.is_nan());
            let step = (at - before).abs();
            stats.min_step = min(stats.min_step, if step > 0.0 { step } else { f64::INFINITY });
            let difference = second_difference(earlier, before, at);
            stats.max_second_difference = max(stats.max_second_difference, difference);
            run = if at == before { run + 1 } else { 1 };
            stats.longest_run = stats.longest_run.max(run);
            (earlier, before) = (before, at);
        }
        (self.stats, self.run, self.done) = (stats, run, values.len());
    }

    /// The figures of the whole channel.
    pub(crate) fn end(mut self, values: &[f64]) -> ChannelStats {
        self.advance(values);
        self.stats
    }
}

/// How far a sample lies from the middle of its neighbours.
#[inline]
pub(crate) fn second_difference(before: f64, at: f64, after: f64) -> f64 {
    (at - 0.5 * (before + after)).abs()
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

/// Largest less smallest value; minus infinity where there is none.
pub(crate) fn range(values: &[f64]) -> f64 {
    let mut span = MinMax::NONE;
    span.take(values);
    span.length()
}

/// Range of the values, updated block by block.
#[derive(Debug, Clone, Copy)]
pub(crate) struct MinMax {
    low: [f64; LANES],
    high: [f64; LANES],
}

impl MinMax {
    pub(crate) const NONE: Self = Self { low: [f64::INFINITY; LANES], high: [f64::NEG_INFINITY; LANES] };

    /// Some more values.
    #[inline]
    pub(crate) fn take(&mut self, values: &[f64]) {
        let (groups, rest) = values.as_chunks::<LANES>();
        for group in groups {
            for (lane, &value) in group.iter().enumerate() {
                self.low[lane] = min(self.low[lane], value);
                self.high[lane] = max(self.high[lane], value);
            }
        }
        for &value in rest {
            self.low[0] = min(self.low[0], value);
            self.high[0] = max(self.high[0], value);
        }
    }

    /// Largest less smallest value; minus infinity where there is none.
    pub(crate) fn length(&self) -> f64 {
        let low = self.low.iter().copied().fold(f64::INFINITY, min);
        self.high.iter().copied().fold(f64::NEG_INFINITY, max) - low
    }
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
        /// Over channels with repeats and holes.
        #[test]
        fn one_pass_sees_what_a_pass_for_each_figure_does(values in channel()) {
            let seen = ChannelStats::of(&values);
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

        /// However a channel grows, what is seen of it is the same.
        #[test]
        fn a_channel_that_grows_is_seen_as_one_that_is_there(
            values in channel(), step in 1_usize..170,
        ) {
            let mut scanner = StatsAccumulator::new();
            (0..values.len()).step_by(step).for_each(|end| scanner.advance(&values[..end]));
            prop_assert_eq!(scanner.end(&values), ChannelStats::of(&values));
        }
    }
}
