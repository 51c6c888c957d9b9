//! Edits of valid inputs for the fuzz targets: the bytes that `bolero` draws choose what is changed, and where.

#![allow(dead_code, reason = "each test program that includes this file uses a part of it")]

use std::ops::Range;

/// Choices that the bytes of an input make, one after another: the first of all when no byte is left.
pub(crate) struct Choices<'a>(pub(crate) &'a [u8]);

impl Choices<'_> {
    pub(crate) fn below(&mut self, count: usize) -> usize {
        let width = if count <= 256 { 1 } else { 4 };
        let (taken, rest) = self.0.split_at(width.min(self.0.len()));
        self.0 = rest;
        taken.iter().fold(0, |number, byte| number << 8 | usize::from(*byte)) % count.max(1)
    }

    pub(crate) fn pick<'a, T>(&mut self, all: &'a [T]) -> &'a T {
        &all[self.below(all.len())]
    }
}

/// A number that breaks arithmetic, or any.
pub(crate) fn number(kind: u8, bits: [u8; 8]) -> f64 {
    const NUMBERS: &str = "0 -0 nan inf -inf 1.7976931348623157e308 -1.7976931348623157e308 2.2250738585072014e-308 \
        5e-324 1e-300 1e300 1e50 -1e50 1e11 1e9 3600 10 1 -1 0.01 1e-4 -1e-4 3e-5 1e-6 1e-9";
    let mut numbers = NUMBERS.split_whitespace().cycle();
    let listed = if kind < 160 { numbers.nth(usize::from(kind)) } else { None };
    listed.and_then(|text| text.parse().ok()).unwrap_or(f64::from_le_bytes(bits))
}

/// Overwrites up to six places within some ranges; the length stays.
pub(crate) fn overwrite(choices: &mut Choices<'_>, bytes: &mut [u8], ranges: &[Range<usize>]) {
    let length = bytes.len();
    let within = |range: &Range<usize>| range.start.min(length)..range.end.min(length);
    let ranges: Vec<_> = ranges.iter().map(within).filter(|range| !range.is_empty()).collect();
    for _ in 0..if ranges.is_empty() { 0 } else { 1 + choices.below(6) } {
        let range = choices.pick(&ranges).clone();
        let at = range.start + choices.below(range.len());
        let end = (at + 1 + choices.below(16)).min(range.end);
        match choices.below(6) {
            0 => bytes[at] ^= 1 << choices.below(8),
            1 => bytes[at] = choices.below(256) as u8,
            2 => bytes[at] = *choices.pick(&[0, 1, 2, 0x0f, 0x10, 0x15, 0x7f, 0x80, 0xfe, 0xff]),
            3 => {
                // The largest numbers of a variable-length encoding.
                bytes[at..end].fill(0xff);
                bytes[end - 1] = *choices.pick(&[0x01, 0x0f, 0x7f, 0xff]);
            }
            4 => {
                let from = range.start + choices.below(range.len() - (end - at) + 1);
                bytes.copy_within(from..from + (end - at), at);
            }
            _ => bytes[at..end].fill(0),
        }
    }
}

/// Changes up to four places of a text: lines, words, numbers, bytes. `others` gives lines.
pub(crate) fn edit_text(choices: &mut Choices<'_>, bytes: &mut Vec<u8>, others: &[Vec<u8>]) {
    /// Words that break readers of text.
    const WORDS: &str = "~0~-1~1e308~1e-320~1e999~nan~inf~5e77~9223372036854775807~-0.0~0x10~true~null~\"~'~\"\"\"~=~[~]\
        ~[[~{~}~,~\n~\r~\t~\0~\u{202e}~\u{feff}~é~9999-12-31~-0001-01-01T00:00:00Z~{position}~*~**~..~#";
    let words: Vec<&str> = WORDS.split('~').collect();
    let lines_of = |bytes: &[u8]| -> Vec<Vec<u8>> {
        bytes.split_inclusive(|byte| *byte == b'\n').map(<[u8]>::to_vec).collect()
    };
    for _ in 0..=choices.below(4) {
        let mut lines = lines_of(bytes);
        let line = choices.below(lines.len());
        match (choices.below(8), lines.len()) {
            (_, 0) => lines.push(choices.pick(others).clone()),
            (0, _) => drop(lines.remove(line)),
            (1, count) => lines.insert(choices.below(count), lines[line].clone()),
            (2, count) => lines.swap(line, choices.below(count)),
            (3, _) => {
                let other: &Vec<u8> = choices.pick(others);
                lines.insert(line, choices.pick(&lines_of(other)).clone());
            }
            (4 | 5, _) => replace_word(choices, &mut lines[line], &words),
            (6, _) => {
                let at = choices.below(lines[line].len() + 1);
                let is_long = choices.below(50) == 49;
                let word = if is_long { "a".repeat(70_000) } else { (*choices.pick(&words)).to_owned() };
                lines[line].splice(at..at, word.into_bytes());
            }
            _ => {
                let at = choices.below(lines[line].len());
                lines[line][at] ^= 1 << choices.below(8);
            }
        }
        *bytes = lines.concat();
        bytes.truncate(1 << 20);
    }
}

fn replace_word(choices: &mut Choices<'_>, line: &mut Vec<u8>, words: &[&str]) {
    let is_word = |byte: &u8| byte.is_ascii_alphanumeric() || b"._-+".contains(byte);
    let starts: Vec<usize> =
        (0..line.len()).filter(|&at| is_word(&line[at]) && (at == 0 || !is_word(&line[at - 1]))).collect();
    if !starts.is_empty() {
        let start = *choices.pick(&starts);
        let length = line[start..].iter().take_while(|byte| is_word(byte)).count();
        line.splice(start..start + length, choices.pick(words).bytes());
    }
}
