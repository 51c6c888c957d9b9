//! What the load did: its band, and how often it changed sides.

use std::ops::Range;

/// A load counts as being on a side beyond this share of its greater quantile, so noise about zero is no reversal.
const SIDE_SHARE: f64 = 0.12;

/// The load of a flight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LoadBand {
    /// 5 % quantile, N.
    pub p05_n: f64,
    /// 95 % quantile, N.
    pub p95_n: f64,
    /// Changes from one side to the other.
    pub reversals: usize,
}

/// Load band over the segments: 5 % and 95 % quantiles, N, and the number of reversals; `None` when they are empty.
///
/// `load_n` has one value per sample, N; NaN is skipped. A quantile p is the order statistic nearest to p (n − 1), counted
/// from zero, without interpolation (method 3 of Hyndman and Fan 1996 is close; <https://doi.org/10.2307/2684934>). A
/// reversal is a change from beyond +12 % of the greater of the two quantiles to beyond −12 %, or back: a definition of
/// this project. Both are part of each record, since gaps of different load bands are not comparable.
pub fn load_band(load_n: &[f64], segments: &[Range<usize>]) -> Option<LoadBand> {
    let [p05_n, p95_n] = quantiles(load_n, segments, [0.05, 0.95])?;
    debug_assert!(p05_n <= p95_n, "quantiles {p05_n} and {p95_n} N");
    let threshold = SIDE_SHARE * p05_n.abs().max(p95_n.abs());
    let reversals = segments.iter().map(|segment| reversals(&load_n[segment.clone()], threshold)).sum();
    Some(LoadBand { p05_n, p95_n, reversals })
}

/// Changes from beyond one side of a threshold to beyond the other.
pub(crate) fn reversals(load_n: &[f64], threshold_n: f64) -> usize {
    let (mut side, mut changes) = (0.0, 0);
    for &f in load_n.iter().filter(|f| f.abs() > threshold_n) {
        changes += usize::from(side * f < 0.0);
        side = f.signum();
    }
    changes
}

/// Loads that brackets are laid by.
const SUBSAMPLE_SIZE: usize = 2048;
/// Half width of a bracket in the order of those loads: five standard deviations of a rank, or somewhat more.
const HALF_BRACKET: usize = 50;

/// Quantiles: elements, no interpolation. `None` without a load; NaN is skipped.
///
/// Only the loads near each quantile are put in order, in brackets from a subsample; where a bracket misses its quantile,
/// and where loads are few, all are.
pub(crate) fn quantiles<const N: usize>(
    load_n: &[f64],
    segments: &[Range<usize>],
    shares: [f64; N],
) -> Option<[f64; N]> {
    let loads = || segments.iter().flat_map(|segment| load_n[segment.clone()].iter().copied());
    let present = || loads().filter(|f| !f.is_nan());
    let last = present().count().checked_sub(1)?;
    let stride = segments.iter().map(Range::len).sum::<usize>() / SUBSAMPLE_SIZE + 1;
    let in_brackets = || {
        let every = segments.iter().flat_map(|s| load_n[s.clone()].iter().step_by(stride).copied());
        let mut subsample: Vec<f64> = every.filter(|f| !f.is_nan()).collect();
        subsample.sort_unstable_by(f64::total_cmp);
        let found = shares.map(|share| {
            let at = rank(subsample.len().checked_sub(1)?, share);
            let least = at.checked_sub(HALF_BRACKET).map_or(f64::NEG_INFINITY, |k| subsample[k]);
            let greatest = subsample.get(at + HALF_BRACKET).copied().unwrap_or(f64::INFINITY);
            let below = loads().filter(|f| *f < least).count();
            let mut within: Vec<f64> = loads().filter(|f| (least..=greatest).contains(f)).collect();
            let at = rank(last, share).checked_sub(below)?;
            (at < within.len()).then(|| *within.select_nth_unstable_by(at, f64::total_cmp).1)
        });
        found.iter().all(Option::is_some).then(|| found.map(Option::unwrap_or_default))
    };
    let in_order = || {
        let mut all: Vec<f64> = present().collect();
        shares.map(|share| *all.select_nth_unstable_by(rank(last, share), f64::total_cmp).1)
    };
    // Brackets of less than sixteen times the subsample save nothing.
    Some((stride >= 16).then(in_brackets).flatten().unwrap_or_else(in_order))
}

/// Where a share of the order lies, counted from zero to the last.
fn rank(last: usize, share: f64) -> usize {
    (last as f64 * share).round() as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ranks by hand: of `n` numbers in order, round(0.05 (n − 1)) and round(0.95 (n − 1)).
    fn check(load_n: &[f64]) {
        let whole = 0..load_n.len();
        let mut sorted: Vec<f64> = load_n.iter().copied().filter(|f| !f.is_nan()).collect();
        sorted.sort_unstable_by(f64::total_cmp);
        let found = quantiles(load_n, std::slice::from_ref(&whole), [0.05, 0.95]).unwrap();
        let last = (sorted.len() - 1) as f64;
        let wanted = [0.05, 0.95].map(|share| sorted[(share * last).round() as usize]);
        assert_eq!(found.map(f64::to_bits), wanted.map(f64::to_bits), "{} loads", load_n.len());
    }

    #[test]
    fn quantiles_are_those_of_the_whole_order() {
        // A full cycle of 65 536 different numbers, ties, missing ones, and few of them.
        let mixed = |k: u32| f64::from((k.wrapping_mul(40503)) % 65536) - 3e4;
        let all: Vec<f64> = (0..200_000).map(mixed).collect();
        check(&all);
        check(&all.iter().map(|f| (f / 5e3).round()).collect::<Vec<_>>());
        check(&all.iter().map(|f| if *f as i64 % 7 == 0 { f64::NAN } else { *f }).collect::<Vec<_>>());
        check(&all[..77]);
        // The subsample is every forty-ninth load: here only these differ from the rest.
        let stride = 100_000 / SUBSAMPLE_SIZE + 1;
        check(&(0..100_000).map(|k| if k % stride == 0 { 1e6 } else { k as f64 }).collect::<Vec<_>>());
    }

    /// A load that oscillates with a falling frequency under noise, with a gap in the data, counted sample by sample.
    #[test]
    fn reversals_are_those_of_one_sample_after_the_other() {
        for count in [0, 1, 7, 8, 9, 5000] {
            let noise = |k: u32| f64::from(k.wrapping_mul(40503) % 1024) / 1024.0 - 0.5;
            let load = |k: u32| 3.0 * f64::from(k).sqrt().sin() + noise(k);
            let mut load_n: Vec<f64> = (0..count).map(load).collect();
            load_n.iter_mut().skip(70).take(9).for_each(|f| *f = f64::NAN);
            for threshold_n in [0.0, 0.4, 3.2, 9.0] {
                let beyond: Vec<bool> =
                    load_n.iter().filter(|f| f.abs() > threshold_n).map(|f| *f > 0.0).collect();
                let changes = beyond.windows(2).filter(|pair| pair[0] != pair[1]).count();
                assert_eq!(reversals(&load_n, threshold_n), changes, "{count} loads, {threshold_n} N");
            }
        }
    }
}
