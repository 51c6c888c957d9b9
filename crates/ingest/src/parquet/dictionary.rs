//! Numbers that are stored as codes of a dictionary: most writers do so for channels of few values.
//!
//! Codes lie in runs of one code, and in eights of a fixed number of bits (the Parquet format's RLE/bit-packed hybrid).

use crate::channel::column_builder::{BATCH, ColumnBuilder};

/// Zeros that must follow the codes, so that each can be read as part of a whole word.
pub(crate) const PADDING_BYTES: usize = 8;
/// Largest bit width of dictionary indices in the format.
const MAX_BITS: u8 = 32;

/// The codes of a page that are yet to be taken.
#[derive(Debug)]
pub(crate) struct DictIndices<'p> {
    bits: usize,
    /// From the run on that comes next.
    rest: &'p [u8],
    run: RleRun<'p>,
}

/// What is left of a run.
#[derive(Debug)]
enum RleRun<'p> {
    /// One code, so many times.
    Same { code: usize, left: usize },
    /// Codes side by side from the first bit of these bytes on: the next one's number, and how many are left.
    Packed { bytes: &'p [u8], next: usize, left: usize },
}

impl<'p> DictIndices<'p> {
    /// The codes in a page's body, with [`PADDING_BYTES`] after it. None where codes would be too long.
    pub(crate) fn of(body: &'p [u8]) -> Option<Self> {
        let (&bits, rest) = body.split_first()?;
        let run = RleRun::Same { code: 0, left: 0 };
        (bits <= MAX_BITS).then_some(Self { bits: bits.into(), rest, run })
    }

    /// Appends what the next codes stand for. None where they end early or stand for nothing.
    pub(crate) fn append(
        &mut self,
        mut count: usize,
        dictionary: &[f64],
        into: &mut ColumnBuilder,
    ) -> Option<()> {
        while count > 0 {
            let taken = match &mut self.run {
                RleRun::Same { left: 0, .. } | RleRun::Packed { left: 0, .. } => {
                    self.run = self.next_run()?;
                    0
                }
                RleRun::Same { code, left } => {
                    let taken = count.min(*left).min(BATCH);
                    into.extend(std::iter::repeat_n(*dictionary.get(*code)?, taken));
                    *left -= taken;
                    taken
                }
                RleRun::Packed { bytes, next, left } => {
                    let taken = count.min(*left).min(BATCH);
                    let codes = (*next..*next + taken).map(|k| code(bytes, k, self.bits));
                    append(codes, dictionary, into)?;
                    (*next, *left) = (*next + taken, *left - taken);
                    taken
                }
            };
            count -= taken;
        }
        Some(())
    }

    fn next_run(&mut self) -> Option<RleRun<'p>> {
        let header = usize::try_from(uleb128(&mut self.rest)?).ok()?;
        let count = header >> 1;
        if count == 0 {
            return None;
        }
        let is_packed = header & 1 == 1;
        let length = if is_packed { count.checked_mul(self.bits)? } else { self.bits.div_ceil(8) };
        let bytes = self.rest;
        let (run, rest) = bytes.split_at_checked(length)?;
        // The spare ones belong to no run, and must be there to read the last code with.
        if rest.len() < PADDING_BYTES {
            return None;
        }
        self.rest = rest;
        if is_packed {
            return Some(RleRun::Packed { bytes, next: 0, left: count.checked_mul(8)? });
        }
        let code = run.iter().rev().fold(0, |code, byte| code << 8 | usize::from(*byte));
        Some(RleRun::Same { code, left: count })
    }
}

/// The code of this number among those of so many bits side by side.
#[inline]
fn code(bytes: &[u8], number: usize, bits: usize) -> usize {
    let first = number * bits;
    let word = bytes[first / 8..].first_chunk().map_or(0, |word| u64::from_le_bytes(*word));
    (word >> (first % 8) & ((1_u64 << bits) - 1)) as usize
}

/// Appends what codes stand for; none where one of them stands for nothing.
fn append(codes: impl Iterator<Item = usize>, dictionary: &[f64], into: &mut ColumnBuilder) -> Option<()> {
    let last = dictionary.len().checked_sub(1)?;
    let mut greatest = 0;
    into.extend(codes.map(|code| {
        greatest = greatest.max(code);
        dictionary[code.min(last)]
    }));
    (greatest <= last).then_some(())
}

/// A number in sevens of bits, the lowest first.
pub(crate) fn uleb128(bytes: &mut &[u8]) -> Option<u64> {
    let mut number = 0;
    for shift in (0..63).step_by(7) {
        let (byte, rest) = bytes.split_first()?;
        *bytes = rest;
        number |= u64::from(byte & 0x7f) << shift;
        if byte & 0x80 == 0 {
            return Some(number);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What codes of three bits stand for: the numbers 0, 10, 20 … 70.
    fn read(body: &[u8], counts: &[usize]) -> Option<Vec<f64>> {
        let dictionary: Vec<f64> = (0..8).map(|k| f64::from(k) * 10.0).collect();
        let body: Vec<u8> = body.iter().copied().chain([0; PADDING_BYTES]).collect();
        let mut codes = DictIndices::of(&body)?;
        let mut read = ColumnBuilder::with_capacity(0, None);
        counts.iter().try_for_each(|count| codes.append(*count, &dictionary, &mut read))?;
        Some(read.finish().0)
    }

    /// The Parquet format's own example of bits side by side: 0 to 7 in three bits each.
    const EIGHT: [u8; 3] = [0b1000_1000, 0b1100_0110, 0b1111_1010];

    #[test]
    fn codes_are_read_from_bits_and_from_runs() {
        let [a, b, c] = EIGHT;
        // Five times the code 6, one group of eight, twice the code 1.
        let body = [3, 5 << 1, 6, 0b11, a, b, c, 2 << 1, 1];
        let wanted: Vec<f64> =
            [6, 6, 6, 6, 6, 0, 1, 2, 3, 4, 5, 6, 7, 1, 1].map(|k| f64::from(k) * 10.0).into();
        assert_eq!(read(&body, &[15]), Some(wanted.clone()));
        assert_eq!(read(&body, &[1, 6, 0, 7, 1]), Some(wanted));
        assert_eq!(read(&body, &[16]), None);
    }

    #[test]
    fn codes_that_stand_for_nothing_are_not_read() {
        // A run, and a group, of codes beyond the dictionary; a group that ends early; a run of none; codes too long.
        assert_eq!(read(&[4, 2 << 1, 8], &[2]), None);
        assert_eq!(read(&[4, 0b11, 0xff, 0xff, 0xff, 0xff], &[8]), None);
        assert_eq!(read(&[3, 0b101, EIGHT[0]], &[16]), None);
        assert_eq!(read(&[3, 0, 1], &[1]), None);
        assert_eq!(read(&[3, 5 << 1], &[5]), None);
        assert_eq!(read(&[33, 2, 0, 0, 0, 0], &[1]), None);
        assert_eq!(read(&[], &[1]), None);
    }
}
