//! Fetched blocks of an object, and the requests that fetch missing blocks.

use std::collections::BTreeSet;
use std::ops::Range;

/// Bytes that are fetched together. The last block of an object may be shorter.
const BLOCK: u64 = 64 << 10;
/// Largest distance of missing blocks that one request fetches together with the blocks between them: a second request
/// takes as long as a mebibyte.
const MAX_GAP: u64 = (1 << 20) / BLOCK;
/// Most blocks of one request: a failed request is repeated whole, and several requests run in parallel.
const MAX_REQUEST: u64 = (8 << 20) / BLOCK;

#[derive(Debug, Default)]
pub(crate) struct FetchedBlocks(BTreeSet<u64>);

impl FetchedBlocks {
    /// The requests that fetch all missing blocks of some ranges, as byte ranges of an object of `size` bytes.
    pub(crate) fn missing(&self, wanted: &[Range<u64>], size: u64) -> Vec<Range<u64>> {
        let blocks = wanted.iter().flat_map(|range| range.start / BLOCK..range.end.div_ceil(BLOCK));
        let missing: BTreeSet<u64> = blocks.filter(|block| !self.0.contains(block)).collect();
        let mut requests: Vec<Range<u64>> = Vec::new();
        for block in missing {
            match requests.last_mut() {
                Some(last) if block - last.end <= MAX_GAP && block - last.start < MAX_REQUEST => {
                    last.end = block + 1;
                }
                _ => requests.push(block..block + 1),
            }
        }
        requests.into_iter().map(|blocks| blocks.start * BLOCK..size.min(blocks.end * BLOCK)).collect()
    }

    pub(crate) fn add(&mut self, request: &Range<u64>) {
        self.0.extend(request.start / BLOCK..request.end.div_ceil(BLOCK));
    }
}

#[cfg(test)]
#[expect(clippy::single_range_in_vec_init, reason = "one range is a list of one")]
mod tests {
    use super::*;

    const MIB: u64 = 1 << 20;

    #[test]
    fn neighbours_are_fetched_together_long_ones_in_pieces_and_nothing_twice() {
        let mut had = FetchedBlocks::default();
        let near = [10 * MIB..11 * MIB, 1..MIB, 2 * MIB..3 * MIB];
        assert_eq!(had.missing(&near, 20 * MIB), [0..3 * MIB, 10 * MIB..11 * MIB]);
        let whole = [0..17 * MIB - 7];
        let pieces = [0..8 * MIB, 8 * MIB..16 * MIB, 16 * MIB..17 * MIB - 7];
        assert_eq!(had.missing(&whole, 17 * MIB - 7), pieces);
        pieces[..2].iter().for_each(|piece| had.add(piece));
        assert_eq!(had.missing(&whole, 17 * MIB - 7), [16 * MIB..17 * MIB - 7]);
        assert_eq!(had.missing(&[5 * MIB..9 * MIB], 17 * MIB - 7), []);
    }
}
