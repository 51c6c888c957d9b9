//! What can be seen of a channel in one pass over it: sound channels need no other.
//!
//! Columns are longer than any cache, so each further pass would cost as much as reading memory; where it can, this one
//! follows what reads the column. The pass goes in groups of samples whose figures are kept apart, since a chain of
//! comparisons is as slow as its links.

use multiversion::multiversion;

/// Samples in a group.
const LANES: usize = 8;
/// Samples whose repeats are found together.
const BLOCK: usize = 64;

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

/// Looks at a channel that grows, at what is new of it.
#[derive(Debug, Clone)]
pub(crate) struct StatsAccumulator {
    lanes: LaneStats,
    run: RepeatCounter,
    /// Samples processed so far; the last ones wait for their successors.
    done: usize,
}

impl StatsAccumulator {
    pub(crate) fn new() -> Self {
        Self { lanes: LaneStats::new(), run: RepeatCounter::default(), done: 0 }
    }

    /// The channel as far as it is known by now, from its first sample on.
    pub(crate) fn advance(&mut self, values: &[f64]) {
        self.done += groups(&values[self.done..], &mut self.lanes, &mut self.run);
    }

    /// What was seen of the whole channel.
    pub(crate) fn end(mut self, values: &[f64]) -> ChannelStats {
        self.advance(values);
        let Self { mut lanes, mut run, done } = self;
        let rest = &values[done..];
        let at = |k: usize| rest.get(k).copied().unwrap_or(f64::NAN);
        (0..rest.len()).for_each(|k| lanes.one(0, [at(k), at(k + 1), at(k + 2)]));
        run.take_rest(rest);
        lanes.folded(if values.is_empty() { 0 } else { run.most + 1 })
    }
}

/// Looks at whole groups; how many samples those are. Vectors change no figure: comparisons and halves are exact in all.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq", "x86_64+avx2"))]
fn groups(values: &[f64], lanes: &mut LaneStats, run: &mut RepeatCounter) -> usize {
    let mut done = 0;
    while let Some(block) = values[done..].first_chunk::<{ BLOCK + 2 }>() {
        let mut same = 0_u64;
        for k in (0..BLOCK).step_by(LANES) {
            let Some(group) = block[k..].first_chunk::<{ LANES + 2 }>() else { continue };
            lanes.take(group);
            same |= u64::from(repeat_mask(group)) << k;
        }
        run.take(same);
        done += BLOCK;
    }
    done
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

/// Least and greatest of each lane.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq", "x86_64+avx2"))]
fn extend_min_max(
    mut low: [f64; LANES],
    mut high: [f64; LANES],
    groups: &[[f64; LANES]],
) -> ([f64; LANES], [f64; LANES]) {
    for group in groups {
        for lane in 0..LANES {
            low[lane] = min(low[lane], group[lane]);
            high[lane] = max(high[lane], group[lane]);
        }
    }
    (low, high)
}

impl MinMax {
    pub(crate) const NONE: Self = Self { low: [f64::INFINITY; LANES], high: [f64::NEG_INFINITY; LANES] };

    /// Some more values.
    #[inline]
    pub(crate) fn take(&mut self, values: &[f64]) {
        let (groups, rest) = values.as_chunks::<LANES>();
        (self.low, self.high) = extend_min_max(self.low, self.high, groups);
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

/// Figures of every eighth sample, eight times side by side.
#[derive(Debug, Clone)]
struct LaneStats {
    min: [f64; LANES],
    max: [f64; LANES],
    missing: [u64; LANES],
    min_step: [f64; LANES],
    max_second_difference: [f64; LANES],
}

impl LaneStats {
    fn new() -> Self {
        Self {
            min: [f64::INFINITY; LANES],
            max: [f64::NEG_INFINITY; LANES],
            missing: [0; LANES],
            min_step: [f64::INFINITY; LANES],
            max_second_difference: [0.0; LANES],
        }
    }

    /// A group and the two samples after it.
    #[inline]
    fn take(&mut self, group: &[f64; LANES + 2]) {
        for lane in 0..LANES {
            self.one(lane, [group[lane], group[lane + 1], group[lane + 2]]);
        }
    }

    #[inline]
    fn one(&mut self, lane: usize, [at, next, after]: [f64; 3]) {
        self.min[lane] = min(self.min[lane], at);
        self.max[lane] = max(self.max[lane], at);
        self.missing[lane] += u64::from(at.is_nan());
        let step = (next - at).abs();
        self.min_step[lane] = min(self.min_step[lane], if step > 0.0 { step } else { f64::INFINITY });
        self.max_second_difference[lane] =
            max(self.max_second_difference[lane], second_difference(at, next, after));
    }

    fn folded(&self, longest_run: usize) -> ChannelStats {
        ChannelStats {
            min: self.min.iter().copied().fold(f64::INFINITY, min),
            max: self.max.iter().copied().fold(f64::NEG_INFINITY, max),
            missing: self.missing.iter().sum::<u64>() as usize,
            min_step: self.min_step.iter().copied().fold(f64::INFINITY, min),
            max_second_difference: self.max_second_difference.iter().copied().fold(0.0, max),
            longest_run,
        }
    }
}

/// Follows samples that repeat the one before.
#[derive(Debug, Clone, Default)]
struct RepeatCounter {
    /// Repeats up to here.
    repeats: usize,
    most: usize,
}

impl RepeatCounter {
    /// Which samples of a block are repeated by the one after them, a bit each.
    #[inline]
    fn take(&mut self, same: u64) {
        let joined = self.repeats + same.trailing_ones() as usize;
        self.repeats = if same == u64::MAX { joined } else { same.leading_ones() as usize };
        self.most = self.most.max(joined);
        while has_ones_run(same, self.most + 1) {
            self.most += 1;
        }
    }

    /// Some samples, of which the first was the last of those before.
    #[expect(clippy::float_cmp, reason = "a frozen channel repeats its bits")]
    fn take_rest(&mut self, values: &[f64]) {
        for (a, b) in values.iter().zip(values.iter().skip(1)) {
            self.repeats = (self.repeats + 1) * usize::from(a == b);
            self.most = self.most.max(self.repeats);
        }
    }
}

/// Which samples of a group are repeated by the one after them, a bit each.
#[inline]
#[expect(clippy::float_cmp, reason = "a frozen channel repeats its bits")]
fn repeat_mask(group: &[f64; LANES + 2]) -> u8 {
    let mut same = 0;
    for lane in 0..LANES {
        same |= u8::from(group[lane] == group[lane + 1]) << lane;
    }
    same
}

/// Whether there are `ones` consecutive set bits, at least one: each shift keeps the bits that end a longer run.
#[inline]
fn has_ones_run(bits: u64, ones: usize) -> bool {
    if ones > BLOCK {
        return false;
    }
    let (mut ends, mut known) = (bits, 1);
    while known < ones {
        let more = known.min(ones - known);
        ends &= ends >> more;
        known += more;
    }
    ends != 0
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
        /// One pass sees what a pass for each figure does, over channels with repeats and holes.
        #[test]
        fn the_lanes_see_what_plain_passes_do(values in channel()) {
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
