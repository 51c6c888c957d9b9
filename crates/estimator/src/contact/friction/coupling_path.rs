//! The coupling over a flight, integrated from block to block: all that depends on the block before is computed here.

use std::ops::Range;

use multiversion::multiversion;

use crate::contact::block_means::BlockMeans;
use crate::contact::friction::friction_model::{Coupling, CouplingParams, Drive, FrictionState, ScrewState};

/// Parts of a segment that are integrated side by side.
const LANES: usize = 8;

/// Integrates the coupling of every block over all segments under one set of parameters: eight parts of a segment in
/// parallel lanes, each from an arbitrary state; then each part from its true start, until this sequential integration
/// meets the lane's result.
pub(crate) fn integrate(blocks: &mut BlockMeans, state: &FrictionState, motor_sense: f64) {
    let mut found = std::mem::take(&mut blocks.couplings);
    found.resize(blocks.len(), Coupling::UNKNOWN);
    let params = CouplingParams::new(state, motor_sense);
    for segment in &blocks.segments {
        let part = segment.len() / LANES;
        let ends = integrate_lanes(params, blocks, segment.start, part, &mut found);
        let rest = segment.start + LANES * part..segment.end;
        let mut screw = None;
        for (lane, start) in (segment.start..rest.start).step_by(part.max(1)).enumerate() {
            if recompute_until_match(params, &mut screw, blocks, start..start + part, &mut found) {
                screw = Some(ends.get(lane));
            }
        }
        // No lane covers the rest of the segment, which may hold another integration.
        found[rest.clone()].fill(Coupling::UNKNOWN);
        recompute_until_match(params, &mut screw, blocks, rest, &mut found);
    }
    blocks.couplings = found;
}

/// Integrates through a part until its values are those found before: once the screw has slipped, its force determines
/// all of its state. False where it integrated to the end.
fn recompute_until_match(
    params: CouplingParams,
    screw: &mut Option<ScrewState>,
    blocks: &BlockMeans,
    part: Range<usize>,
    found: &mut [Coupling],
) -> bool {
    for k in part {
        let here = params.follow(screw, blocks.drive(k));
        let is_same = found[k].force_n.to_bits() == here.force_n.to_bits()
            && found[k].dforce_ddry.to_bits() == here.dforce_ddry.to_bits();
        if is_same && here.force_n.is_finite() && screw.is_some_and(|screw| screw.has_slipped) {
            return true;
        }
        found[k] = here;
    }
    false
}

/// Eight screws in parallel lanes.
#[derive(Clone, Copy)]
struct ScrewStates8 {
    motor_m: [f64; LANES],
    anchor_m: [f64; LANES],
    memory: [[f64; LANES]; 3],
}

#[allow(clippy::inline_always, reason = "compiled within each version of its caller")]
impl ScrewStates8 {
    #[inline(always)]
    fn get(&self, lane: usize) -> ScrewState {
        ScrewState {
            motor_m: self.motor_m[lane],
            anchor_m: self.anchor_m[lane],
            memory: [self.memory[0][lane], self.memory[1][lane], self.memory[2][lane]],
            coupling: Coupling::UNKNOWN,
            has_slipped: false,
        }
    }

    #[inline(always)]
    fn set(&mut self, lane: usize, is_known: bool, screw: &ScrewState) {
        self.motor_m[lane] = if is_known { screw.motor_m } else { self.motor_m[lane] };
        self.anchor_m[lane] = if is_known { screw.anchor_m } else { self.anchor_m[lane] };
        for (kept, new) in self.memory.iter_mut().zip(screw.memory) {
            kept[lane] = if is_known { new } else { kept[lane] };
        }
    }
}

/// Integrates eight parts of a segment, all of one length, each from an arbitrary state; the final states.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq", "x86_64+avx2"))]
fn integrate_lanes(
    params: CouplingParams,
    blocks: &BlockMeans,
    start: usize,
    part: usize,
    found: &mut [Coupling],
) -> ScrewStates8 {
    let zero = [0.0; LANES];
    let mut screws = ScrewStates8 { motor_m: zero, anchor_m: zero, memory: [zero; 3] };
    for k in 0..part {
        let mut drives = [Drive { motor_m: 0.0, load_n: 0.0, slowness: 0.0 }; LANES];
        for (lane, drive) in drives.iter_mut().enumerate() {
            *drive = blocks.drive(start + lane * part + k);
        }
        let mut couplings = [Coupling::UNKNOWN; LANES];
        for lane in 0..LANES {
            let is_known = (drives[lane].motor_m + drives[lane].load_n).abs() < f64::INFINITY;
            let screw = params.step(&screws.get(lane), drives[lane]);
            screws.set(lane, is_known, &screw);
            couplings[lane] = if is_known { screw.coupling } else { Coupling::UNKNOWN };
        }
        for (lane, coupling) in couplings.into_iter().enumerate() {
            found[start + lane * part + k] = coupling;
        }
    }
    screws
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::contact::friction::friction_model::Friction;

    proptest! {
        /// However a flight is cut, and whatever is missing of it, eight integrations in parallel lanes are bitwise one
        /// sequential integration. Motors that rest leave the screw held for long; so does friction beyond any load.
        #[test]
        fn parallel_lanes_are_one_integration(
            steps in proptest::collection::vec((-3_i32..4, -40_i32..41, 0_u8..30), 1..400),
            cuts in proptest::collection::vec(0.0_f64..1.0, 0..4),
            gap_m in 0.0_f64..1e-4, dry_n in prop_oneof![0.0_f64..300.0, Just(1e5)], lost_share in 0.0_f64..0.2,
            bristle in prop_oneof![Just(0.0), 0.1_f64..3.0], load_zero_n in -300.0_f64..300.0,
        ) {
            let mut place_m = 0.0;
            let mut blocks = BlockMeans::default();
            for &(step, load, chance) in &steps {
                place_m += f64::from(step) * 1.3e-5;
                let missing = |which: u8| if chance == which { f64::NAN } else { 0.0 };
                let slowness = f64::from(chance % 5) / 5.0;
                blocks.time_s.push(0.0);
                blocks.motor_m.push(place_m + missing(0));
                blocks.load_n.push(f64::from(load) * 51.7 + missing(1));
                blocks.slowness.push(slowness);
            }
            let mut ends: Vec<usize> = cuts.iter().map(|cut| (cut * steps.len() as f64) as usize).collect();
            ends.push(steps.len());
            ends.sort_unstable();
            blocks.segments = ends.iter().scan(0, |from, &end| Some(std::mem::replace(from, end)..end)).collect();
            let state = FrictionState {
                stiffness_n_per_m: 5e7,
                gap_m,
                friction: Friction { dry_n, lost_share },
                stribeck: 0.3,
                bristle_m_per_n: bristle / 5e7,
                load_zero_n,
                ..FrictionState::default()
            };
            integrate(&mut blocks, &state, 1.0);
            for segment in blocks.segments.clone() {
                let (params, mut screw) = (CouplingParams::new(&state, 1.0), None);
                for k in segment {
                    let drive = blocks.drive(k);
                    let bits = |c: Coupling| {
                        [c.force_n, c.dforce_ddry, c.dforce_dloss_n, c.relative_m].map(f64::to_bits)
                    };
                    prop_assert_eq!(bits(blocks.couplings[k]), bits(params.follow(&mut screw, drive)), "block {}", k);
                }
            }
        }
    }
}
