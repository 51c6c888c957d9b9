//! A long stretch in eight parts at once, with the bits of one sample after the other.
//!
//! The settled filter forgets how it started, and not nearly but wholly: two runs over the same samples come to
//! the same bits, since rounding leaves nothing between neighbouring numbers for a difference to live on. So
//! each part starts early, from a guess. Where the state in which it arrives at its own first sample is, bit
//! for bit, the one in which the part before it ended, it goes on as the plain recursion would have; where
//! it is not, the plain recursion does the rest itself.

use std::ops::Range;

#[cfg(target_arch = "x86_64")]
use crate::eight::x86::{Avx, Avx512};
use crate::eight::{Eight, Plain};
use crate::folded::{Folded, TILE};

/// Parts worked on side by side.
pub(crate) const PARTS: usize = 8;
/// The longest part: what eight of them read and write stays in the second cache. No power of two, or all parts
/// would fall on the same lines of the first.
const LONGEST_PART: usize = 2040;
/// A part no longer than this share of its early start gains too little.
const SHORTEST_SHARE: f64 = 0.5;

/// How a stretch is cut: part `i` covers `lead + part` samples from `i·part`; the first `lead` of them are its
/// early start, but for the first part, whose state is known.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Cut {
    lead: usize,
    part: usize,
}

impl Cut {
    /// Of up to so many samples; none where they are too few. `lead` is how long it takes to forget a start.
    pub(crate) fn of(samples: usize, lead: usize) -> Option<Self> {
        let lead = lead.div_ceil(TILE) * TILE;
        let part = (samples.checked_sub(lead)? / PARTS).min(LONGEST_PART.max(4 * lead)) / TILE * TILE;
        (part > 0 && part as f64 >= SHORTEST_SHARE * lead as f64).then_some(Self { lead, part })
    }

    /// Samples that the parts cover together.
    pub(crate) fn samples(self) -> usize {
        self.lead + PARTS * self.part
    }

    /// Tiles that each part covers.
    pub(crate) fn tiles(self) -> usize {
        (self.lead + self.part) / TILE
    }

    /// Where part `i` starts early.
    pub(crate) fn start(self, i: usize) -> usize {
        i * self.part
    }
}

/// The states of eight parts: eight numbers for each entry of the state.
pub(crate) type States = [[f64; PARTS]; 3];

/// What the parts read and write.
pub(crate) struct Work<'a> {
    pub(crate) map: &'a Folded,
    pub(crate) cut: Cut,
    pub(crate) y_m: &'a [f64],
    pub(crate) load_n: &'a [f64],
    pub(crate) s_m: &'a mut [f64],
    /// Squared innovations of each tile: of all parts' first tiles, then of their second ones, and so on.
    pub(crate) squares_m2: &'a mut [[f64; PARTS]],
}

impl Work<'_> {
    /// Runs the parts from their states, and says up to which sample S is that of the plain recursion, its state
    /// there, and a sum with the squared innovations until then added, tile by tile.
    pub(crate) fn run(&mut self, states: States, mut sum_m2: f64) -> (usize, [f64; 3], f64) {
        let Cut { lead, part } = self.cut;
        let arrived = self.advance(states, 0..lead);
        // A part's end is written after the early start of the next, which lies in the same place.
        let ended = self.advance(arrived, lead..lead + part);
        let state = |states: &States, part: usize| states.each_ref().map(|entry| entry[part]);
        let bits = |states: &States, part: usize| state(states, part).map(f64::to_bits);
        let joined = (1..PARTS).take_while(|&i| bits(&arrived, i) == bits(&ended, i - 1)).count();
        for part in 0..=joined {
            // The early start of the first part is no guess.
            let first = if part == 0 { 0 } else { lead / TILE };
            sum_m2 =
                self.squares_m2[first..self.cut.tiles()].iter().fold(sum_m2, |sum, tile| sum + tile[part]);
        }
        (lead + (joined + 1) * part, state(&ended, joined), sum_m2)
    }

    /// Takes all parts from one of their samples to another, with the widest vectors the machine has.
    fn advance(&mut self, states: States, within: Range<usize>) -> States {
        #[cfg(target_arch = "x86_64")]
        {
            if is_x86_feature_detected!("avx512f") {
                // SAFETY: the processor has what it was compiled for.
                #[allow(unsafe_code, reason = "see `eight`")]
                return unsafe { advance_avx512(self, states, within) };
            }
            if is_x86_feature_detected!("avx2") {
                // SAFETY: as above.
                #[allow(unsafe_code, reason = "see `eight`")]
                return unsafe { advance_avx2(self, states, within) };
            }
        }
        advance::<Plain>(self, states, within)
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f")]
fn advance_avx512(work: &mut Work<'_>, states: States, within: Range<usize>) -> States {
    advance::<Avx512>(work, states, within)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn advance_avx2(work: &mut Work<'_>, states: States, within: Range<usize>) -> States {
    advance::<Avx>(work, states, within)
}

#[inline(always)]
#[allow(clippy::inline_always, reason = "see `eight`")]
fn advance<E: Eight>(work: &mut Work<'_>, states: States, within: Range<usize>) -> States {
    let (map, part) = (work.map.wide::<E>(), work.cut.part);
    let mut x = [E::of(&states[0]), E::of(&states[1]), E::of(&states[2])];
    for at in within.step_by(TILE) {
        let (y, u) = (gathered::<E>(work.y_m, part, at), gathered::<E>(work.load_n, part, at));
        let (mut s, mut squares) = (y, E::all(0.0));
        for k in 0..TILE {
            let e_m;
            (x, e_m) = map.step(x, y[k], u[k]);
            s[k] = x[2];
            squares = squares.plus(e_m.times(e_m));
        }
        scatter(s, part, at, work.s_m);
        if let Some(tile) = work.squares_m2.get_mut(at / TILE) {
            squares.put(tile);
        }
    }
    let mut states = states;
    for (entry, x) in states.iter_mut().zip(x) {
        x.put(entry);
    }
    states
}

/// Samples from `at` of all parts: a vector of parts for each.
#[inline(always)]
#[allow(clippy::inline_always, reason = "see `eight`")]
fn gathered<E: Eight>(column: &[f64], part: usize, at: usize) -> [E; TILE] {
    let mut parts = [E::all(0.0); PARTS];
    for (i, samples) in parts.iter_mut().enumerate() {
        if let Some(tile) = column.get(i * part + at..).and_then(<[f64]>::first_chunk) {
            *samples = E::of(tile);
        }
    }
    E::turned(parts)
}

/// Back to where [`gathered`] found them.
#[inline(always)]
#[allow(clippy::inline_always, reason = "see `eight`")]
fn scatter<E: Eight>(samples: [E; TILE], part: usize, at: usize, column: &mut [f64]) {
    for (i, samples) in E::turned(samples).into_iter().enumerate() {
        if let Some(tile) = column.get_mut(i * part + at..).and_then(<[f64]>::first_chunk_mut) {
            samples.put(tile);
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]
mod tests {
    use super::*;
    use crate::noise::{Noise, Sensors};
    use crate::{Actuator, Filter};

    fn map() -> Folded {
        let noise = Noise::Sensors(Sensors {
            screw_rms_m: 3e-6,
            screw_resolution_m: 2.3e-6,
            motor_rms_m: 1e-6,
            motor_resolution_m: 3e-7,
            unknown_force_n: 200.0,
            bandwidth_hz: 10.0,
        });
        let filter = Filter::new(&Actuator::linear(5e7, 2000.0, 8.0).unwrap(), 0.004, &noise).unwrap();
        let (gain, p) = filter.settled().unwrap();
        Folded::new(&filter, &gain, &p)
    }

    /// A load that swings, and positions that jump about what it makes of them.
    fn channels(count: usize) -> (Vec<f64>, Vec<f64>) {
        let load_n: Vec<f64> = (0..count).map(|k| 5e3 * (k as f64 * 0.004).sin()).collect();
        let jump = |k: usize| ((k * 40503) % 65536) as f64 * 1e-10;
        let y_m = load_n.iter().enumerate().map(|(k, u)| u / 5e7 + 50e-6 * u.signum() + jump(k)).collect();
        (y_m, load_n)
    }

    const STARTS: States = [[1e-4, 0.0, 0.0, 1e-3, 0.0, 0.0, -1e-3, 0.0], [0.0; PARTS], [2e-4; PARTS]];

    fn bits(values: &[f64]) -> Vec<u64> {
        values.iter().map(|v| v.to_bits()).collect()
    }

    /// The arithmetic alone: each part by itself, from its start, as the plain recursion does it.
    #[test]
    fn every_kind_of_vector_gives_the_bits_of_the_plain_recursion() {
        let (map, cut) = (map(), Cut { lead: 0, part: 96 });
        let (y_m, load_n) = channels(cut.samples());
        let (mut wanted_m, mut wanted_m2) = (vec![0.0; cut.samples()], vec![[0.0; PARTS]; cut.tiles()]);
        for part in 0..PARTS {
            let within = part * 96..(part + 1) * 96;
            let (x, column) =
                (STARTS.map(|entry| entry[part]), (&y_m[within.clone()], &load_n[within.clone()]));
            let note = |k: usize, e_m: f64| wanted_m2[k / TILE][part] += e_m * e_m;
            map.run(x, 0.0, column, &mut wanted_m[within], note);
        }
        let run = |advance: fn(&mut Work<'_>, States, Range<usize>) -> States| {
            let (mut s_m, mut squares_m2) = (vec![0.0; cut.samples()], vec![[0.0; PARTS]; cut.tiles()]);
            let (s_m, squares_m2) = (&mut s_m, &mut squares_m2);
            advance(&mut Work { map: &map, cut, y_m: &y_m, load_n: &load_n, s_m, squares_m2 }, STARTS, 0..96);
            assert_eq!(bits(s_m), bits(&wanted_m));
            assert_eq!(bits(squares_m2.as_flattened()), bits(wanted_m2.as_flattened()));
        };
        run(advance::<Plain>);
        #[allow(clippy::redundant_closure_for_method_calls, reason = "the method has a lifetime of its own")]
        run(|work, states, within| work.advance(states, within));
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has it.
            #[allow(unsafe_code, reason = "see `eight`")]
            run(|work, states, within| unsafe { advance_avx2(work, states, within) });
        }
    }

    /// Long leads join all parts; a lead of one tile joins none, and says so.
    #[test]
    fn only_parts_that_have_forgotten_their_start_are_joined() {
        let map = map();
        for (lead, joins) in [(224, true), (8, false)] {
            let cut = Cut { lead, part: 96 };
            let (y_m, load_n) = channels(cut.samples());
            let (mut s_m, mut squares_m2) = (vec![0.0; cut.samples()], vec![[0.0; PARTS]; cut.tiles()]);
            let (s_m, squares_m2) = (&mut s_m, &mut squares_m2);
            let mut work = Work { map: &map, cut, y_m: &y_m, load_n: &load_n, s_m, squares_m2 };
            let (done, x, sum_m2) = work.run(STARTS, 0.25);
            assert_eq!(done, if joins { cut.samples() } else { lead + 96 });
            let (mut wanted_m, start) = (vec![0.0; done], STARTS.map(|entry| entry[0]));
            let plain = (&y_m[..done], &load_n[..done]);
            let (wanted_x, wanted_m2) = map.run(start, 0.25, plain, &mut wanted_m, |_, _| ());
            assert_eq!((bits(&s_m[..done]), bits(&x)), (bits(&wanted_m), bits(&wanted_x)));
            assert_eq!(sum_m2.to_bits(), wanted_m2.to_bits());
        }
    }
}
