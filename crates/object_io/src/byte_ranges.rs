//! Byte ranges: set of fetched ranges; coalescing and splitting of requests.

use std::ops::Range;

/// Gaps up to this size are fetched too: a request costs as much time as a mebibyte.
const MAX_GAP: u64 = 1 << 20;
/// Maximum length of one request: a failed request is repeated, and several run in parallel.
const MAX_REQUEST: u64 = 8 << 20;

/// Fetched ranges, sorted and disjoint.
#[derive(Debug, Default)]
pub(crate) struct RangeSet(Vec<Range<u64>>);

impl RangeSet {
    /// The wanted ranges that are missing: neighbours are coalesced, long ranges split into requests.
    pub(crate) fn missing(&self, wanted: &[Range<u64>]) -> Vec<Range<u64>> {
        let mut wanted: Vec<Range<u64>> =
            wanted.iter().flat_map(|range| self.missing_in(range.clone())).collect();
        wanted.sort_by_key(|range| range.start);
        let mut joined: Vec<Range<u64>> = Vec::new();
        for range in wanted {
            match joined.last_mut() {
                Some(last) if range.start <= last.end.saturating_add(MAX_GAP) => {
                    last.end = last.end.max(range.end);
                }
                _ => joined.push(range),
            }
        }
        joined.into_iter().flat_map(split).collect()
    }

    /// The missing parts of a range.
    fn missing_in(&self, range: Range<u64>) -> Vec<Range<u64>> {
        let (mut rest, mut at) = (Vec::new(), range.start);
        for had in self.0.iter().filter(|had| had.start < range.end && had.end > range.start) {
            if had.start > at {
                rest.push(at..had.start);
            }
            at = at.max(had.end);
        }
        if at < range.end {
            rest.push(at..range.end);
        }
        rest
    }

    /// Marks a range as fetched.
    pub(crate) fn add(&mut self, range: Range<u64>) {
        let (mut new, mut apart) = (range, Vec::with_capacity(self.0.len() + 1));
        for had in self.0.drain(..) {
            if had.end < new.start || had.start > new.end {
                apart.push(had);
            } else {
                new = new.start.min(had.start)..new.end.max(had.end);
            }
        }
        apart.push(new);
        apart.sort_by_key(|range| range.start);
        self.0 = apart;
    }
}

fn split(range: Range<u64>) -> impl Iterator<Item = Range<u64>> {
    let Range { start, end } = range;
    let pieces = (end - start).div_ceil(MAX_REQUEST);
    (0..pieces).map(move |piece| start + piece * MAX_REQUEST..(start + (piece + 1) * MAX_REQUEST).min(end))
}

#[cfg(test)]
mod tests {
    use std::slice;

    use super::*;

    const MIB: u64 = 1 << 20;

    fn missing(had: &RangeSet, wanted: Range<u64>) -> Vec<Range<u64>> {
        had.missing(slice::from_ref(&wanted))
    }

    #[test]
    fn neighbours_are_fetched_together_and_long_ones_in_pieces() {
        let none = RangeSet::default();
        let near = [10 * MIB..11 * MIB, 0..MIB, 2 * MIB..3 * MIB];
        assert_eq!(none.missing(&near), [0..3 * MIB, 10 * MIB..11 * MIB]);
        assert_eq!(missing(&none, 5..5), []);
        assert_eq!(missing(&none, 0..17 * MIB), [0..8 * MIB, 8 * MIB..16 * MIB, 16 * MIB..17 * MIB]);
    }

    #[test]
    fn what_is_had_is_not_fetched_again() {
        let mut had = RangeSet::default();
        had.add(0..10 * MIB);
        had.add(20 * MIB..30 * MIB);
        assert_eq!(missing(&had, 5 * MIB..9 * MIB), []);
        let wanted = [25 * MIB..31 * MIB, 8 * MIB..12 * MIB];
        assert_eq!(had.missing(&wanted), [10 * MIB..12 * MIB, 30 * MIB..31 * MIB]);
        had.add(9 * MIB..21 * MIB);
        assert_eq!(missing(&had, 0..30 * MIB), []);
    }
}
