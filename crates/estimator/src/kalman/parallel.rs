//! Steady-state Kalman filter over eight overlapping chunks in parallel, bitwise identical to the sequential filter.
//!
//! The steady-state filter forgets its initial state exactly: after enough samples, two runs over the same samples have
//! bitwise identical states, since rounding removes the last difference. So each chunk starts early (warm-up) from a
//! guessed state. Where its state at its own first sample equals the final state of the chunk before it,
//! the result is that of the sequential recursion. Where it differs, the sequential recursion continues until it meets
//! the chunk at one of a few checkpoints, or to the end of the chunk.

#[cfg(target_arch = "x86_64")]
use core::arch::x86_64::{_MM_HINT_T1, _mm_prefetch};
use std::hint::black_box;
use std::ops::Range;

use crate::kalman::nis::NisBlocks;
use crate::kalman::steady_state::{self, GROUP, SteadyState, SteadyStateFilter};
#[cfg(target_arch = "x86_64")]
use crate::simd::f64x8::x86::{Avx2F64x8, Avx512F64x8};
use crate::simd::f64x8::{F64x8, PortableF64x8, load_rows, store_rows};

/// Parts worked on side by side.
pub(crate) const PARTS: usize = 8;
/// The longest part: what eight of them read and write stays in the second cache. An odd number of groups, or all
/// parts would fall on the same lines of the first.
const LONGEST_PART: usize = 63 * GROUP;
/// A part no longer than this share of its early start gains too little.
const SHORTEST_SHARE: f64 = 0.2;
/// Places of a part at which its states are kept, the last at its end.
const CHECKPOINTS: usize = 4;
/// Samples of a part that are loaded and turned at once.
const TILE: usize = 8;

/// Partition of a run of samples: part `i` covers `lead + part` samples from `i·part`; the first `lead` of them are its
/// early start, but for the first part, whose state is known.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ChunkPlan {
    lead: usize,
    part: usize,
}

impl ChunkPlan {
    /// Partition of up to `samples` samples; `None` where they are too few. `lead` is the warm-up until the initial state has no effect.
    pub(crate) fn new(samples: usize, lead: usize) -> Option<Self> {
        let lead = lead.div_ceil(GROUP) * GROUP;
        let part = (samples.checked_sub(lead)? / PARTS).min(LONGEST_PART.max(4 * lead)) / GROUP * GROUP;
        (part > 0 && part as f64 >= SHORTEST_SHARE * lead as f64).then_some(Self { lead, part })
    }

    /// Samples that the parts cover together.
    pub(crate) fn samples(self) -> usize {
        self.lead + PARTS * self.part
    }

    /// Groups that each part covers.
    pub(crate) fn groups(self) -> usize {
        (self.lead + self.part) / GROUP
    }

    /// Where part `i` starts early.
    pub(crate) fn start(self, i: usize) -> usize {
        i * self.part
    }

    /// The samples of a part between two marks.
    fn between(self, checkpoint: usize) -> Range<usize> {
        let at = |checkpoint: usize| self.lead + self.part / GROUP * checkpoint / CHECKPOINTS * GROUP;
        at(checkpoint)..at(checkpoint + 1)
    }
}

/// The states of eight parts: eight numbers for each entry of the state.
pub(crate) type ChunkStates = [[f64; PARTS]; 3];

/// The state of one part.
fn state(states: &ChunkStates, part: usize) -> SteadyState {
    states.each_ref().map(|entry| entry[part])
}

fn same(a: SteadyState, b: SteadyState) -> bool {
    a.map(f64::to_bits) == b.map(f64::to_bits)
}

/// What the parts read and write. Columns may go on behind the last part: what the next eight will need is fetched
/// meanwhile, since memory is quickest line after line.
pub(crate) struct ChunkIo<'a> {
    pub(crate) map: &'a SteadyStateFilter,
    pub(crate) cut: ChunkPlan,
    pub(crate) y_m: &'a [f64],
    pub(crate) load_n: &'a [f64],
    pub(crate) s_m: &'a mut [f64],
    /// Squared innovations of each group: of all parts' first groups, then of their second ones, and so on.
    pub(crate) squares_m2: &'a mut [[f64; PARTS]],
    /// Takes each part as a block.
    pub(crate) blocks: &'a mut NisBlocks,
}

impl ChunkIo<'_> {
    /// Runs the parts from their states: the last state of the plain recursion, and a sum with its squared
    /// innovations added, group by group. None where a sample is missing, which leaves no state behind it a number.
    pub(crate) fn run(&mut self, states: ChunkStates, mut sum_m2: f64) -> Option<(SteadyState, f64)> {
        let arrived = self.advance_chunks(states, 0..self.cut.lead);
        let mut checkpoints = [arrived; CHECKPOINTS];
        let mut reached = arrived;
        for (checkpoint, states) in checkpoints.iter_mut().enumerate() {
            // A chunk's end is written after the warm-up of the next, which uses the same memory.
            reached = self.advance_chunks(reached, self.cut.between(checkpoint));
            *states = reached;
        }
        if reached.as_flattened().iter().any(|entry| !entry.is_finite()) {
            return None;
        }
        // The early start of the first part is no guess.
        let mut start_m2 = sum_m2;
        sum_m2 = self.add_squares(sum_m2, 0, 0);
        self.blocks.add((sum_m2 - start_m2) / self.map.variance_m2, self.cut.lead + self.cut.part);
        let mut last = state(&reached, 0);
        for part in 1..PARTS {
            start_m2 = sum_m2;
            (last, sum_m2) = if same(state(&arrived, part), last) {
                (state(&reached, part), self.add_squares(sum_m2, part, self.cut.lead))
            } else {
                self.recompute_until_match(part, last, sum_m2, &checkpoints)
            };
            self.blocks.add((sum_m2 - start_m2) / self.map.variance_m2, self.cut.part);
        }
        Some((last, sum_m2))
    }

    /// A part from the state it should have arrived in, until it is in one that it was in.
    #[cold]
    fn recompute_until_match(
        &mut self,
        part: usize,
        mut x: SteadyState,
        mut sum_m2: f64,
        checkpoints: &[ChunkStates; CHECKPOINTS],
    ) -> (SteadyState, f64) {
        for (checkpoint, states) in checkpoints.iter().enumerate() {
            let Range { start, end } = self.cut.between(checkpoint);
            let all = self.cut.start(part) + start..self.cut.start(part) + end;
            let columns = (&self.y_m[all.clone()], &self.load_n[all.clone()]);
            (x, sum_m2) = steady_state::run(self.map, x, sum_m2, columns, &mut self.s_m[all], &mut []);
            if same(x, state(states, part)) {
                return (state(&checkpoints[CHECKPOINTS - 1], part), self.add_squares(sum_m2, part, end));
            }
        }
        (x, sum_m2)
    }

    /// A sum with the squared innovations of a part added from one of its samples on.
    fn add_squares(&self, sum_m2: f64, part: usize, from: usize) -> f64 {
        let groups = &self.squares_m2[from / GROUP..self.cut.groups()];
        groups.iter().fold(sum_m2, |sum, group| sum + group[part])
    }

    /// Takes all parts from one of their samples to another, with the widest vectors the machine has.
    fn advance_chunks(&mut self, states: ChunkStates, within: Range<usize>) -> ChunkStates {
        #[cfg(target_arch = "x86_64")]
        {
            if is_x86_feature_detected!("avx512f") {
                // SAFETY: the processor has what it was compiled for.
                #[allow(unsafe_code, reason = "see `f64x8`")]
                return unsafe { advance_avx512(self, states, within) };
            }
            if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
                // SAFETY: as above.
                #[allow(unsafe_code, reason = "see `f64x8`")]
                return unsafe { advance_avx2(self, states, within) };
            }
        }
        advance_chunks::<PortableF64x8>(self, states, within)
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f")]
fn advance_avx512(work: &mut ChunkIo<'_>, states: ChunkStates, within: Range<usize>) -> ChunkStates {
    advance_chunks::<Avx512F64x8>(work, states, within)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn advance_avx2(work: &mut ChunkIo<'_>, states: ChunkStates, within: Range<usize>) -> ChunkStates {
    advance_chunks::<Avx2F64x8>(work, states, within)
}

/// Prefetches numbers into the cache.
#[inline(always)]
#[allow(clippy::inline_always, reason = "see `f64x8`")]
#[cfg_attr(not(target_arch = "x86_64"), expect(unused_variables, reason = "no prefetch instruction"))]
fn prefetch(numbers: &[f64]) {
    #[cfg(target_arch = "x86_64")]
    for line in numbers.iter().step_by(TILE) {
        // SAFETY: it reads nothing that could be seen.
        #[allow(unsafe_code, reason = "see `f64x8`")]
        unsafe {
            _mm_prefetch::<_MM_HINT_T1>(std::ptr::from_ref(line).cast());
        }
    }
}

#[inline(always)]
#[allow(clippy::inline_always, reason = "see `f64x8`")]
fn advance_chunks<E: F64x8>(
    work: &mut ChunkIo<'_>,
    states: ChunkStates,
    within: Range<usize>,
) -> ChunkStates {
    let (map, part) = (work.map.wide::<E>(), work.cut.part);
    let mut x = [E::load(&states[0]), E::load(&states[1]), E::load(&states[2])];
    for group in within.step_by(GROUP) {
        let mut squares = E::splat(0.0);
        for at in (group..group + GROUP).step_by(TILE) {
            // Hidden, or each of the 24 places would be kept in a register, of which there are not enough.
            let part = black_box(part);
            let next = work.cut.samples() + PARTS * at;
            for column in [work.y_m, work.load_n, work.s_m] {
                if let Some(tiles) = column.get(next..next + PARTS * TILE) {
                    prefetch(tiles);
                }
            }
            let (y, u) = (
                E::gather_transpose(load_rows(work.y_m, at, part)),
                E::gather_transpose(load_rows(work.load_n, at, part)),
            );
            let mut s = y;
            for k in 0..TILE {
                let e_m;
                (x, e_m) = map.step(x, y[k], u[k]);
                s[k] = x[2];
                squares = e_m.mul_add(e_m, squares);
            }
            store_rows(E::transpose(s), work.s_m, at, part);
        }
        if let Some(group) = work.squares_m2.get_mut(group / GROUP) {
            squares.store(group);
        }
    }
    let mut states = states;
    for (entry, x) in states.iter_mut().zip(x) {
        x.store(entry);
    }
    states
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]
mod tests {
    use proptest::collection::vec;
    use proptest::prelude::*;

    use super::*;
    use crate::model::{NoiseModel, SensorNoise};
    use crate::{ActuatorModel, Filter, GainSchedule};

    fn filter((stiffness, damping, mass): (f64, f64, f64), rate_hz: f64, bandwidth_hz: f64) -> Filter {
        let noise = NoiseModel::Sensors(SensorNoise {
            screw_rms_m: 3e-6,
            screw_resolution_m: 2.3e-6,
            motor_rms_m: 1e-6,
            motor_resolution_m: 3e-7,
            unknown_force_n: 200.0,
            bandwidth_hz,
        });
        Filter::new(&ActuatorModel::linear(stiffness, damping, mass).unwrap(), rate_hz.recip(), &noise)
            .unwrap()
    }

    fn folded_of(filter: &Filter) -> SteadyStateFilter {
        let (gain, p) = filter.steady_state_gain().unwrap();
        SteadyStateFilter::new(filter, &gain, &p)
    }

    fn map() -> SteadyStateFilter {
        folded_of(&filter((5e7, 2000.0, 8.0), 250.0, 10.0))
    }

    /// A load that swings, and positions that jump about what it makes of them.
    fn channels(count: usize) -> (Vec<f64>, Vec<f64>) {
        let load_n: Vec<f64> = (0..count).map(|k| 5e3 * (k as f64 * 0.004).sin()).collect();
        let jump = |k: usize| ((k * 40503) % 65536) as f64 * 1e-10;
        let y_m = load_n.iter().enumerate().map(|(k, u)| u / 5e7 + 50e-6 * u.signum() + jump(k)).collect();
        (y_m, load_n)
    }

    const STARTS: ChunkStates = [[1e-4, 0.0, 0.0, 1e-3, 0.0, 0.0, -1e-3, 0.0], [0.0; PARTS], [2e-4; PARTS]];

    fn bits(values: &[f64]) -> Vec<u64> {
        values.iter().map(|v| v.to_bits()).collect()
    }

    type Advance = fn(&mut ChunkIo<'_>, ChunkStates, Range<usize>) -> ChunkStates;

    /// S and the sums of squares of eight parts of 96 samples, by one kind of vector.
    fn advanced(
        map: &SteadyStateFilter,
        y_m: &[f64],
        load_n: &[f64],
        advance_chunks: Advance,
    ) -> (Vec<u64>, Vec<u64>) {
        let cut = ChunkPlan { lead: 0, part: 96 };
        let (mut s_m, mut squares_m2) = (vec![0.0; cut.samples()], vec![[0.0; PARTS]; cut.groups()]);
        advance_chunks(
            &mut ChunkIo {
                map,
                cut,
                y_m,
                load_n,
                s_m: &mut s_m,
                squares_m2: &mut squares_m2,
                blocks: &mut NisBlocks::default(),
            },
            STARTS,
            0..96,
        );
        (bits(&s_m), bits(squares_m2.as_flattened()))
    }

    /// Each part by itself, from its start, as the plain recursion does it.
    fn one_by_one(map: &SteadyStateFilter, y_m: &[f64], load_n: &[f64]) -> (Vec<u64>, Vec<u64>) {
        let (mut s_m, mut squares_m2) = (vec![0.0; y_m.len()], vec![[0.0; PARTS]; 96 / GROUP]);
        for part in 0..PARTS {
            let within = part * 96..(part + 1) * 96;
            let columns = (&y_m[within.clone()], &load_n[within.clone()]);
            let mut e_m = [0.0; 96];
            steady_state::run(map, state(&STARTS, part), 0.0, columns, &mut s_m[within], &mut e_m);
            for (squares_m2, e_m) in squares_m2.iter_mut().zip(e_m.chunks(GROUP)) {
                squares_m2[part] = e_m.iter().fold(0.0, |sum, e: &f64| e.mul_add(*e, sum));
            }
        }
        (bits(&s_m), bits(squares_m2.as_flattened()))
    }

    /// The first without the processor's own fused products, where it could do without.
    fn kinds() -> Vec<Advance> {
        let mut kinds: Vec<Advance> =
            vec![advance_chunks::<PortableF64x8>, |work, states, within| work.advance_chunks(states, within)];
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
            // SAFETY: the processor has them.
            #[allow(unsafe_code, reason = "see `f64x8`")]
            kinds.push(|work, states, within| unsafe { advance_avx2(work, states, within) });
        }
        kinds
    }

    proptest! {
        /// The arithmetic alone, of any actuator, over any samples; a few are missing.
        #[test]
        fn every_kind_of_vector_gives_the_bits_of_the_plain_recursion(
            (stiffness, damping, mass) in (6.0..9.5_f64, 1.0..5.0_f64, 0.0..3.0_f64),
            (rate_hz, bandwidth_hz) in (1.5..3.7_f64, 0.0..1.5_f64),
            y_m in vec(prop_oneof![300 => (-1e-3..1e-3).boxed(), 1 => Just(f64::NAN).boxed()], 8 * 96),
            load_n in vec(-8e3..8e3, 8 * 96),
        ) {
            let ten = |power: f64| 10_f64.powf(power);
            let plant = (ten(stiffness), ten(damping), ten(mass));
            let map = folded_of(&filter(plant, ten(rate_hz), ten(bandwidth_hz)));
            let wanted = one_by_one(&map, &y_m, &load_n);
            for advance_chunks in kinds() {
                prop_assert!(advanced(&map, &y_m, &load_n, advance_chunks) == wanted);
            }
        }
    }

    /// The lead is long enough for nearly all: of starts that are wrong by a tenth of a millimetre, under tunings from 50
    /// to 1000 Hz, at most one in fifty is remembered.
    #[test]
    fn starts_are_forgotten_to_the_last_bit() {
        let (mut starts, mut remembered) = (0, 0);
        for rate_hz in [50.0, 125.0, 250.0, 1000.0] {
            for bandwidth_hz in [3.0, 10.0] {
                for plant in [(5e7, 2000.0, 8.0), (2e7, 3000.0, 40.0), (3e8, 20_000.0, 5.0)] {
                    let filter = filter(plant, rate_hz, bandwidth_hz);
                    let (map, lead) = (folded_of(&filter), GainSchedule::new(&filter).lead.unwrap());
                    let (y_m, load_n) = channels(lead + 100);
                    for from in (0..100).step_by(5) {
                        let columns = (&y_m[from..from + lead], &load_n[from..from + lead]);
                        let ended = |x: SteadyState| {
                            steady_state::run(&map, x, 0.0, columns, &mut vec![0.0; lead], &mut []).0
                        };
                        let start = map.transform(&filter.initial_state(y_m[from], load_n[from]).x);
                        starts += 1;
                        remembered += u32::from(!same(ended(start), ended([1e-4, 1e-5, -1e-4])));
                    }
                }
            }
        }
        assert!(50 * remembered <= starts, "{remembered} of {starts} starts are remembered");
    }

    /// Long leads join all parts; where a lead is too short, the plain recursion catches up with the part.
    #[test]
    fn parts_that_have_not_forgotten_their_start_are_caught_up_with() {
        let map = map();
        for (lead, part) in [(224, 96), (32, 512), (32, 32), (0, 96)] {
            let cut = ChunkPlan { lead, part };
            let (y_m, load_n) = channels(cut.samples());
            let (mut s_m, mut squares_m2) = (vec![0.0; cut.samples()], vec![[0.0; PARTS]; cut.groups()]);
            let (s_m, squares_m2) = (&mut s_m, &mut squares_m2);
            let blocks = &mut NisBlocks::default();
            let mut work = ChunkIo { map: &map, cut, y_m: &y_m, load_n: &load_n, s_m, squares_m2, blocks };
            let (x, sum_m2) = work.run(STARTS, 0.25).unwrap();
            let (mut wanted_m, start) = (vec![0.0; cut.samples()], STARTS.map(|entry| entry[0]));
            let (wanted_x, wanted_m2) =
                steady_state::run(&map, start, 0.25, (&y_m, &load_n), &mut wanted_m, &mut []);
            assert_eq!((bits(s_m), bits(&x)), (bits(&wanted_m), bits(&wanted_x)), "{cut:?}");
            assert_eq!(sum_m2.to_bits(), wanted_m2.to_bits(), "{cut:?}");
        }
    }

    /// Wherever one is missing, the first and the last among them.
    #[test]
    fn a_missing_sample_is_noticed() {
        let (map, cut) = (map(), ChunkPlan { lead: 64, part: 96 });
        for at in [0, 63, 64, 159, 160, 500, cut.samples() - 1] {
            for is_load in [false, true] {
                let (mut y_m, mut load_n) = channels(cut.samples());
                (if is_load { &mut load_n } else { &mut y_m })[at] = f64::NAN;
                let (mut s_m, mut squares_m2) = (vec![0.0; cut.samples()], vec![[0.0; PARTS]; cut.groups()]);
                let (s_m, squares_m2) = (&mut s_m, &mut squares_m2);
                let blocks = &mut NisBlocks::default();
                let mut work =
                    ChunkIo { map: &map, cut, y_m: &y_m, load_n: &load_n, s_m, squares_m2, blocks };
                assert!(work.run(STARTS, 0.0).is_none(), "sample {at} is missing");
            }
        }
    }
}
