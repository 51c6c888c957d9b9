//! Spikes: samples that stand apart from the median of the nine around them.

use std::ops::Range;

/// Size of the subsample of steps between neighbours.
const LOOKS: usize = 4000;
/// A sample is a spike beyond this many times the 90 % quantile of the steps.
const WILD: f64 = 8.0;
/// SpikeThreshold on either side.
const REACH: usize = 4;

/// How far a channel's neighbours lie apart.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SpikeThreshold {
    /// The longest step that needs no spike test, in the channel's unit.
    pub(crate) leap: f64,
}

impl SpikeThreshold {
    /// From the steps within segments that are not zero; none when the channel never moves.
    pub(crate) fn of(values: &[f64], segments: &[Range<usize>]) -> Option<Self> {
        let steps = |stride: usize| -> Vec<f64> {
            let pairs =
                segments.iter().flat_map(|segment| values[segment.clone()].windows(2).step_by(stride));
            pairs.map(|w| (w[1] - w[0]).abs()).filter(|s| *s > 0.0).collect()
        };
        let stride = (segments.iter().map(Range::len).sum::<usize>() / LOOKS).max(1);
        let looked_at = steps(stride);
        // Looks may keep step with a channel that is held, and see none of its steps.
        let mut steps = if looked_at.is_empty() { steps(1) } else { looked_at };
        if steps.is_empty() {
            return None;
        }
        let at = steps.len() * 9 / 10;
        Some(Self { leap: WILD * *steps.select_nth_unstable_by(at, f64::total_cmp).1 })
    }

    /// Whether a sample stands apart; a step from one level to another does not.
    pub(crate) fn is_wild(self, values: &[f64], at: usize, segment: &Range<usize>) -> bool {
        let around = at.saturating_sub(REACH).max(segment.start)..(at + REACH + 1).min(segment.end);
        // Where most lie near, so does the median: nothing need be put in order.
        let near = values[around.clone()].iter().filter(|v| (values[at] - **v).abs() <= self.leap).count();
        if 2 * near > around.len() {
            return false;
        }
        let (mut sorted, mut count) = ([0.0; 2 * REACH + 1], 0);
        for &v in values[around].iter().filter(|v| v.is_finite()) {
            sorted[count] = v;
            count += 1;
        }
        sorted[..count].sort_unstable_by(f64::total_cmp);
        count > 0 && (values[at] - sorted[count / 2]).abs() > self.leap
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]
mod tests {
    use super::*;

    /// Ten rows for each load, and every forty-fifth step in the subsample: none of them is one of the load's.
    #[test]
    fn a_channel_that_is_held_moves() {
        let held: Vec<f64> = (0..180_000).map(|k| (f64::from(k / 10) * 0.01).sin()).collect();
        let found = SpikeThreshold::of(&held, std::slice::from_ref(&(0..held.len()))).unwrap();
        assert!((0.07..0.09).contains(&found.leap), "{found:?}");
        assert!(SpikeThreshold::of(&vec![3.0; 50_000], std::slice::from_ref(&(0..50_000))).is_none());
    }

    /// However little of a long log counts, its steps are known from as many looks as those of a short one.
    #[test]
    fn looks_fall_within_what_counts() {
        let wave: Vec<f64> = (0..9000).map(|k| (f64::from(k) * 0.01).sin()).collect();
        let mut long = vec![f64::NAN; 3_000_000];
        let counts = 1_234_567..1_234_567 + wave.len();
        long[counts.clone()].copy_from_slice(&wave);
        let alone = SpikeThreshold::of(&wave, std::slice::from_ref(&(0..wave.len()))).unwrap();
        assert_eq!(
            SpikeThreshold::of(&long, std::slice::from_ref(&counts)).unwrap().leap.to_bits(),
            alone.leap.to_bits()
        );
    }
}
