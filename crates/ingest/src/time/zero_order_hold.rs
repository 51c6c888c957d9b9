//! Holds a load that is recorded more slowly than the positions until its next value.

use std::collections::BTreeMap;
use std::ops::Range;

/// Number of its own steps, or seconds if these are longer, over which a load is held.
const HOLD_STEPS: usize = 4;
const HOLD_S: f64 = 0.2;

/// Holds the last load over samples without one, and starts each segment at its first load.
///
/// It is held over four of its own steps or 0.2 s, whichever is longer; one that stays away longer has
/// died, and the segment ends where it was last known.
pub(crate) fn zero_order_hold(
    load_n: &mut [f64],
    segments: &[Range<usize>],
    step_s: f64,
) -> Vec<Range<usize>> {
    let longest = ((HOLD_S / step_s).ceil() as usize).max(HOLD_STEPS * median_sample_interval(load_n));
    let mut loaded = Vec::with_capacity(segments.len());
    for segment in segments {
        let mut known: Option<Range<usize>> = None;
        for i in segment.clone() {
            if load_n[i].is_nan() {
                continue;
            }
            match &mut known {
                Some(span) if i - span.end <= longest => {
                    let last = load_n[span.end - 1];
                    load_n[span.end..i].fill(last);
                    span.end = i + 1;
                }
                before => {
                    loaded.extend(before.take());
                    known = Some(i..i + 1);
                }
            }
        }
        if let Some(span) = known {
            let end = segment.end.min(span.end + longest);
            let last = load_n[span.end - 1];
            load_n[span.end..end].fill(last);
            loaded.push(span.start..end);
        }
    }
    loaded
}

/// Samples from one known load to the next, as the median has it.
pub(crate) fn median_sample_interval(load_n: &[f64]) -> usize {
    if !load_n.iter().any(|f| f.is_nan()) {
        return 1;
    }
    // A hole of the load may be as long as the log: intervals are counted by length, and few lengths occur.
    let (mut counts, mut last) = (BTreeMap::<usize, usize>::new(), None);
    for i in (0..load_n.len()).filter(|&i| !load_n[i].is_nan()) {
        if let Some(last) = last.replace(i) {
            *counts.entry(i - last).or_default() += 1;
        }
    }
    let (half, mut shorter) = (counts.values().sum::<usize>() / 2, 0);
    let is_middle = |(_, count): &(&usize, &usize)| {
        shorter += **count;
        shorter > half
    };
    counts.iter().find(is_middle).map_or(1, |(interval, _)| *interval)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By hand: intervals of 2, 2, 3 and 10 samples have the (upper) median 3.
    #[test]
    fn the_usual_interval_is_the_median() {
        let mut load = [f64::NAN; 20];
        [1, 3, 5, 8, 18].into_iter().for_each(|i| load[i] = 1.0);
        assert_eq!(median_sample_interval(&load), 3);
        assert_eq!([median_sample_interval(&[1.0; 5]), median_sample_interval(&[f64::NAN; 5])], [1, 1]);
    }

    /// The load comes every other sample, so it is held over eight at most; the second segment waits for its first load.
    #[test]
    fn a_slow_load_is_held_and_one_that_died_ends_its_segment() {
        let mut load = [f64::NAN; 40];
        for i in [0, 2, 4, 6, 30, 32] {
            load[i] = i as f64;
        }
        let segments = zero_order_hold(&mut load, &[0..20, 20..40], 0.07);
        assert_eq!(segments, [0..15, 30..40]);
        assert_eq!((load[5], load[14], load[33]), (4.0, 6.0, 32.0));
        assert!(load[15].is_nan());
    }
}
