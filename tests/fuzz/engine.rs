//! Fuzzing on stable Rust: seeded mutations of a corpus of real files. An input with a new outcome joins the corpus; in a
//! build with counters (`tests/fuzz/run`), also an input that takes a branch as often as no input before.
//!
//! The gate (`FREEPLAY_TESTS=gate`) tries a fixed number of cases, a test a tenth of them. `FREEPLAY_FUZZ_S` is the time of each target in seconds, and
//! `FREEPLAY_FUZZ_SEED` another seed; `FREEPLAY_FUZZ_INPUT` is a kept input to try alone. `docs/reliability.md` has the
//! command and its figures.

#![allow(dead_code, reason = "each of the test programs that include this file uses a part of it")]
#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use std::collections::BTreeSet;
use std::io::Write;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

#[path = "../gate.rs"]
mod gate;

pub(crate) use gate::is_gate;

/// A case that takes longer is a hang: the process ends, since no thread can be ended from outside.
const HANG: Duration = Duration::from_mins(1);

/// Inputs that the corpus grows to at most.
const MAX_POOL: usize = 4000;

/// Pseudo-random numbers (Steele, Lea and Flood 2014, `SplitMix64`, <https://doi.org/10.1145/2660193.2660195>).
pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed)
    }

    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        mixed ^ (mixed >> 31)
    }

    pub(crate) fn below(&mut self, count: usize) -> usize {
        (self.next() % count.max(1) as u64) as usize
    }

    pub(crate) fn pick<'a, T>(&mut self, all: &'a [T]) -> &'a T {
        &all[self.below(all.len())]
    }
}

/// Bytes, and the corpus file that they come from.
#[derive(Debug, Clone)]
pub(crate) struct Input {
    pub(crate) origin: usize,
    pub(crate) bytes: Vec<u8>,
}

/// Counts of the branches that are taken, in a build that counts them.
#[derive(Default)]
struct Branches {
    /// Of each branch, the classes of counts seen so far, a bit each.
    seen: Vec<u8>,
    /// Branches that some input has taken.
    taken: usize,
}

impl Branches {
    /// Sets all counts to zero.
    fn clear() {
        counters().fill(0);
    }

    /// Whether some branch was taken as often as never before: once, twice, three times, up to 7, 15, 31, 127 or more
    /// (Zalewski 2014, American fuzzy lop, technical details).
    fn are_new(&mut self) -> bool {
        let counts = counters();
        self.seen.resize(counts.len(), 0);
        let mut is_new = false;
        for (seen, count) in self.seen.iter_mut().zip(counts).filter(|(_, count)| **count > 0) {
            let class = match *count {
                count @ 0..=3 => 1 << (count.max(1) - 1),
                4..=7 => 8,
                8..=15 => 16,
                16..=31 => 32,
                32..=127 => 64,
                128.. => 128,
            };
            self.taken += usize::from(*seen == 0);
            is_new |= *seen & class == 0;
            *seen |= class;
        }
        is_new
    }
}

#[cfg(not(branch_counters))]
fn counters() -> &'static mut [u8] {
    &mut []
}

#[cfg(branch_counters)]
#[allow(unsafe_code, reason = "the counters are an array of the linker")]
fn counters() -> &'static mut [u8] {
    unsafe extern "C" {
        fn freeplay_branch_counters(count: *mut usize) -> *mut u8;
    }
    let mut count = 0;
    // SAFETY: the array lives as long as the program; a lost increment of another thread is a slightly other count.
    unsafe {
        let first = freeplay_branch_counters(&raw mut count);
        std::slice::from_raw_parts_mut(first, count)
    }
}

/// A case in progress, for the thread that looks for hangs.
type Watched = Arc<Mutex<Option<(Instant, Vec<u8>)>>>;

/// Tries mutations of the corpus: `run` returns an outcome and must neither panic nor hang.
pub(crate) fn fuzz(
    name: &'static str,
    corpus: Vec<Vec<u8>>,
    gate_cases: usize,
    mutate: impl Fn(&mut Random, &mut Input),
    run: impl Fn(&[u8]) -> String,
) {
    if let Ok(file) = std::env::var("FREEPLAY_FUZZ_INPUT") {
        print(&format!("{name}: {}", run(&std::fs::read(file).unwrap())));
        return;
    }
    let wanted_cases = if is_gate() { gate_cases } else { gate_cases.div_ceil(10) };
    let number = |key: &str| std::env::var(key).ok().and_then(|text| text.parse::<u64>().ok());
    let time = number("FREEPLAY_FUZZ_S").map(Duration::from_secs);
    let seed = number("FREEPLAY_FUZZ_SEED").unwrap_or(1);
    let mut random = Random::new(seed);
    let mut pool: Vec<Input> =
        corpus.into_iter().enumerate().map(|(origin, bytes)| Input { origin, bytes }).collect();
    assert!(!pool.is_empty(), "{name} has no corpus");
    let watched: Watched = Arc::default();
    watch(name, &watched);
    let (mut outcomes, mut failures, mut cases) = (BTreeSet::new(), Vec::new(), 0);
    let (mut branches, mut by_branch) = (Branches::default(), Vec::new());
    let begun = Instant::now();
    let originals = pool.len();
    // Loops over long inputs take branches as often as never before, and are slow.
    let longest = 1000 + 2 * pool.iter().map(|input| input.bytes.len()).max().unwrap_or(0);
    while time.map_or(cases < wanted_cases.max(originals), |time| begun.elapsed() < time) {
        // Each corpus file as it is, then mutations.
        // Inputs that only took new branches are often refused early: half of the cases start from others.
        let from = if random.below(2) == 0 || by_branch.is_empty() { &pool } else { &by_branch };
        let mut input = if cases < originals { pool[cases].clone() } else { random.pick(from).clone() };
        if cases >= originals {
            mutate(&mut random, &mut input);
        }
        cases += 1;
        *watched.lock().unwrap_or_else(PoisonError::into_inner) = Some((Instant::now(), input.bytes.clone()));
        Branches::clear();
        match catch_unwind(AssertUnwindSafe(|| run(&input.bytes))) {
            Ok(outcome) => {
                let is_new = branches.are_new();
                let is_other = outcomes.insert(outcome);
                let grown = if is_other { &mut pool } else { &mut by_branch };
                let is_short = input.bytes.len() <= longest;
                if (is_other || is_new) && is_short && cases > originals && grown.len() < MAX_POOL {
                    grown.push(input);
                }
            }
            Err(panic) => {
                let text = panic.downcast_ref::<String>().map(String::as_str);
                let text = text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("a panic");
                let first = text.lines().next().unwrap_or_default().to_owned();
                if outcomes.insert(format!("panic: {first}")) {
                    let file = keep(name, failures.len(), &input.bytes);
                    failures.push(format!("{first} ({})", file.display()));
                }
            }
        }
    }
    *watched.lock().unwrap_or_else(PoisonError::into_inner) = None;
    print(&format!(
        "| {name} | {originals} | {} | {cases} | {} | {} | {} | {} |",
        begun.elapsed().as_secs(),
        outcomes.len(),
        branches.taken,
        pool.len() + by_branch.len(),
        failures.len()
    ));
    assert!(failures.is_empty(), "{name}, seed {seed}:\n{}", failures.join("\n"));
}

/// Past the test runner, which captures what tests print.
fn print(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

/// Keeps an input for later.
fn keep(name: &str, number: usize, bytes: &[u8]) -> PathBuf {
    let folder = std::env::temp_dir().join("freeplay-fuzz");
    let file = folder.join(format!("{}-{number}", name.replace(' ', "-")));
    let _ = std::fs::create_dir_all(&folder);
    let _ = std::fs::write(&file, bytes);
    file
}

fn watch(name: &'static str, watched: &Watched) {
    let watched = Arc::downgrade(watched);
    std::thread::spawn(move || {
        while let Some(watched) = watched.upgrade() {
            if let Some((begun, bytes)) = &*watched.lock().unwrap_or_else(PoisonError::into_inner)
                && begun.elapsed() > HANG
            {
                print(&format!("{name}: no end after {HANG:?}: {}", keep(name, usize::MAX, bytes).display()));
                std::process::abort();
            }
            drop(watched);
            std::thread::park_timeout(Duration::from_millis(200));
        }
    });
}

/// Overwrites up to six places within some ranges; the length stays.
pub(crate) fn overwrite(random: &mut Random, bytes: &mut [u8], ranges: &[std::ops::Range<usize>]) {
    let ranges: Vec<_> = ranges
        .iter()
        .map(|r| r.start.min(bytes.len())..r.end.min(bytes.len()))
        .filter(|r| !r.is_empty())
        .collect();
    if ranges.is_empty() {
        return;
    }
    for _ in 0..=random.below(6) {
        let range = random.pick(&ranges).clone();
        let at = range.start + random.below(range.len());
        match random.below(7) {
            0 => bytes[at] ^= 1 << random.below(8),
            1 => bytes[at] = random.next() as u8,
            2 => bytes[at] = *random.pick(&[0, 1, 2, 0x0f, 0x10, 0x15, 0x7f, 0x80, 0xfe, 0xff]),
            3 => bytes[at] = bytes[at].wrapping_add(*random.pick(&[1, 2, 0xff, 0xfe, 0x10])),
            4 => {
                // The largest numbers of a variable-length encoding.
                let end = (at + 1 + random.below(10)).min(range.end);
                bytes[at..end].fill(0xff);
                bytes[end - 1] = *random.pick(&[0x01, 0x0f, 0x7f, 0xff]);
            }
            5 => {
                let length = (1 + random.below(16)).min(range.end - at);
                let from = range.start + random.below(range.len() - length + 1);
                bytes.copy_within(from..from + length, at);
            }
            _ => {
                let length = (1 + random.below(32)).min(range.end - at);
                bytes[at..at + length].fill(0);
            }
        }
    }
}

/// Changes an input that is one byte and then edits of some bytes each: one more, one less, or other bytes.
pub(crate) fn change_edits(random: &mut Random, input: &mut Input, edit: usize, most: usize) {
    let length = input.bytes.len();
    match random.below(4) {
        0 => input.bytes.extend((0..edit).map(|_| random.next() as u8)),
        1 if length > edit => input.bytes.truncate(length - edit),
        _ => overwrite(random, &mut input.bytes, std::slice::from_ref(&(0..length))),
    }
    input.bytes.truncate(1 + most * edit);
}

/// Words that break readers of text.
const WORDS: [&str; 40] = [
    "",
    "0",
    "-1",
    "1e308",
    "1e-320",
    "1e999",
    "-1e50",
    "nan",
    "inf",
    "5e77",
    "9223372036854775807",
    "1e50",
    "-0.0",
    "0x10",
    "true",
    "null",
    "\"",
    "'",
    "\"\"\"",
    "=",
    "[",
    "]",
    "[[",
    "{",
    "}",
    ",",
    "\n",
    "\r",
    "\t",
    "\0",
    "\u{202e}",
    "\u{feff}",
    "é",
    "9999-12-31",
    "-0001-01-01T00:00:00Z",
    "{position}",
    "*",
    "**",
    "..",
    "#",
];

/// Changes up to four places of a text: lines, words, numbers, bytes. `others` gives lines and words.
pub(crate) fn edit_text(random: &mut Random, bytes: &mut Vec<u8>, others: &[Vec<u8>]) {
    for _ in 0..=random.below(4) {
        let lines: Vec<&[u8]> = bytes.split_inclusive(|byte| *byte == b'\n').collect();
        if lines.is_empty() {
            bytes.extend(random.pick(others));
            continue;
        }
        let line = random.below(lines.len());
        let mut edited: Vec<Vec<u8>> = lines.iter().map(|line| line.to_vec()).collect();
        match random.below(8) {
            0 => drop(edited.remove(line)),
            1 => edited.insert(random.below(lines.len()), lines[line].to_vec()),
            2 => edited.swap(line, random.below(lines.len())),
            3 => {
                let other: Vec<&[u8]> = random.pick(others).split_inclusive(|byte| *byte == b'\n').collect();
                if !other.is_empty() {
                    edited.insert(line, random.pick(&other).to_vec());
                }
            }
            4 | 5 => replace_word(random, &mut edited[line]),
            6 => {
                let at = random.below(edited[line].len() + 1);
                let word = if random.below(50) == 0 {
                    "a".repeat(70_000)
                } else {
                    (*random.pick(&WORDS)).to_owned()
                };
                edited[line].splice(at..at, word.into_bytes());
            }
            _ => {
                let at = random.below(edited[line].len());
                edited[line][at] ^= 1 << random.below(8);
            }
        }
        *bytes = edited.concat();
        bytes.truncate(1 << 20);
    }
}

/// Replaces one word or number of a line.
fn replace_word(random: &mut Random, line: &mut Vec<u8>) {
    let is_word = |byte: &u8| byte.is_ascii_alphanumeric() || b"._-+".contains(byte);
    let starts: Vec<usize> =
        (0..line.len()).filter(|&at| is_word(&line[at]) && (at == 0 || !is_word(&line[at - 1]))).collect();
    if starts.is_empty() {
        return;
    }
    let start = *random.pick(&starts);
    let length = line[start..].iter().take_while(|byte| is_word(byte)).count();
    line.splice(start..start + length, random.pick(&WORDS).bytes());
}
