//! Spikes: samples that stand apart from the median of the nine around them.

use std::ops::Range;

/// Steps between neighbours are looked at this many times over a flight.
const LOOKS: usize = 4000;
/// A sample is wild beyond this many times the step that nine in ten steps stay under.
const WILD: f64 = 8.0;
/// Neighbours on either side.
const REACH: usize = 4;

/// How far a channel's neighbours lie apart.
#[derive(Debug, Clone, Copy)]
pub(super) struct Neighbours {
    /// The longest step that is not looked at twice, in the channel's unit.
    pub(super) leap: f64,
}

impl Neighbours {
    /// From the steps that are not zero; none when the channel never moves.
    pub(super) fn of(values: &[f64]) -> Option<Self> {
        let stride = (values.len() / LOOKS).max(1);
        let mut steps: Vec<f64> =
            values.windows(2).step_by(stride).map(|w| (w[1] - w[0]).abs()).filter(|s| *s > 0.0).collect();
        if steps.is_empty() {
            return None;
        }
        let at = steps.len() * 9 / 10;
        Some(Self { leap: WILD * *steps.select_nth_unstable_by(at, f64::total_cmp).1 })
    }

    /// Whether a sample stands apart; a step from one level to another does not.
    pub(super) fn is_wild(self, values: &[f64], at: usize, segment: &Range<usize>) -> bool {
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
