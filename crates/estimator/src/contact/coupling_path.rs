//! What the coupling does over a flight: followed from block to block once, so that all else goes side by side.

use std::ops::Range;

use super::block_means::{BlockMeans, is_sound};
use super::design_matrix::{FIRM_SHARE, Flank, Scaling};
use super::friction_model::{CouplingForce, CouplingIntegrator, CouplingParams, FrictionState, ScrewState};
use crate::simd::dispatch::{Lanes, simd_dispatch as widest};

/// Blocks before one that must keep its flank and firmness; one after it must as well.
const BEFORE: usize = 2;
/// All of them.
const KEPT: usize = BEFORE + 2;

/// Which flank a block presses, and whether firmly, in bits; none in the gap, or where the force is unknown.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Touch(u8);

impl Touch {
    const NONE: Self = Self(0);
    const UPPER: u8 = 1;
    const LOWER: u8 = 2;
    const FIRM: u8 = 4;

    pub(super) fn flank(self) -> Flank {
        if self.0 & Self::UPPER == 0 { Flank::Lower } else { Flank::Upper }
    }

    pub(super) fn is_firm(self) -> bool {
        self.0 & Self::FIRM != 0
    }
}

/// The coupling of every block as a state has it.
#[derive(Debug, Default)]
pub(super) struct CouplingPath {
    /// c, N; NaN where a channel is missing.
    pub(super) force_n: Vec<f64>,
    /// ∂c/∂F_d.
    pub(super) by_dry: Vec<f64>,
    /// ∂c/∂η, N.
    pub(super) by_share_n: Vec<f64>,
    touches: Vec<Touch>,
    /// Touches of the blocks that keep flank and firmness, and of which nothing is missing.
    kept: Vec<Touch>,
}

impl CouplingPath {
    /// Follows the coupling over all segments, in the memory of the course before.
    pub(super) fn follow(&mut self, blocks: &BlockMeans, state: &FrictionState) {
        for column in [&mut self.force_n, &mut self.by_dry, &mut self.by_share_n] {
            column.resize(blocks.len(), f64::NAN);
        }
        let ways = CouplingParams::new(state);
        for segment in blocks.segments() {
            self.follow_segment(blocks, ways, segment);
        }
    }

    /// Eight parts abreast, each from where nothing is known; then from the true beginning into each, until the walk
    /// is on what was found there.
    fn follow_segment(&mut self, blocks: &BlockMeans, ways: CouplingParams, segment: Range<usize>) {
        let (motor_m, load_n) = (&blocks.motor_m[segment.clone()], &blocks.load_n[segment.clone()]);
        let mut found = Found {
            force_n: &mut self.force_n[segment.clone()],
            by_dry: &mut self.by_dry[segment.clone()],
            by_share_n: &mut self.by_share_n[segment.clone()],
        };
        let part = segment.len() / Lanes::COUNT;
        // Nobody walks here before, and what another course left is no answer.
        found.force_n[Lanes::COUNT * part..].fill(f64::NAN);
        let ends = abreast(ways, (motor_m, load_n), part, &mut found);
        let mut walk = CouplingIntegrator::new(ways);
        for number in 0..Lanes::COUNT {
            let part = number * part..(number + 1) * part;
            if found.catch_up(&mut walk, (motor_m, load_n), part) {
                walk.set(ends.get(number));
            }
        }
        found.catch_up(&mut walk, (motor_m, load_n), Lanes::COUNT * part..segment.len());
    }

    /// Finds the blocks that keep flank and firmness, so that no row mixes flank and gap.
    pub(super) fn keep(&mut self, blocks: &BlockMeans, frame: &Scaling) {
        self.touches.resize(blocks.len(), Touch::NONE);
        touches(&self.force_n, FIRM_SHARE * frame.load_n, &mut self.touches);
        self.kept.clear();
        self.kept.resize(blocks.len(), Touch::NONE);
        for segment in blocks.segments() {
            kept(&self.touches[segment.clone()], &mut self.kept[segment]);
        }
        drop_unsound(blocks, &mut self.kept);
    }

    /// The next blocks in a row that keep one touch, no more than so many and of one stretch.
    pub(super) fn next_kept(
        &self,
        blocks: &BlockMeans,
        within: Range<usize>,
        most: usize,
    ) -> Option<(Touch, Range<usize>)> {
        let start =
            within.start + self.kept[within.clone()].iter().position(|touch| *touch != Touch::NONE)?;
        let (touch, stretch) = (self.kept[start], blocks.stretch(start));
        let mut end = start + 1;
        let last = within.end.min(start + most);
        while end < last && self.kept[end] == touch && blocks.stretch(end) == stretch {
            end += 1;
        }
        Some((touch, start..end))
    }
}

/// What was found of a segment.
struct Found<'a> {
    force_n: &'a mut [f64],
    by_dry: &'a mut [f64],
    by_share_n: &'a mut [f64],
}

impl Found<'_> {
    /// Walks through a part until all that follows is there already: where the screw has slipped, its force tells all
    /// of its state. False where it has walked to the end.
    fn catch_up(
        &mut self,
        walk: &mut CouplingIntegrator,
        (motor_m, load_n): (&[f64], &[f64]),
        part: Range<usize>,
    ) -> bool {
        for k in part {
            let here = walk.step(motor_m[k], load_n[k]);
            let is_there = self.force_n[k].to_bits() == here.force_n.to_bits()
                && self.by_dry[k].to_bits() == here.by_dry.to_bits();
            if is_there && here.force_n.is_finite() && walk.has_slipped() {
                return true;
            }
            (self.force_n[k], self.by_dry[k], self.by_share_n[k]) =
                (here.force_n, here.by_dry, here.by_share_n);
        }
        false
    }
}

/// Eight screws side by side: number k of each array is the k-th's.
struct ScrewStates8 {
    motor_m: [f64; Lanes::COUNT],
    relative_m: [f64; Lanes::COUNT],
    force_n: [f64; Lanes::COUNT],
    by_dry: [f64; Lanes::COUNT],
    by_share_n: [f64; Lanes::COUNT],
}

#[allow(clippy::inline_always, reason = "see `widest`")]
impl ScrewStates8 {
    const NOWHERE: Self = Self {
        motor_m: [0.0; Lanes::COUNT],
        relative_m: [0.0; Lanes::COUNT],
        force_n: [0.0; Lanes::COUNT],
        by_dry: [0.0; Lanes::COUNT],
        by_share_n: [0.0; Lanes::COUNT],
    };

    #[inline(always)]
    fn get(&self, lane: usize) -> ScrewState {
        let coupling = CouplingForce {
            force_n: self.force_n[lane],
            by_dry: self.by_dry[lane],
            by_share_n: self.by_share_n[lane],
        };
        ScrewState {
            motor_m: self.motor_m[lane],
            relative_m: self.relative_m[lane],
            coupling,
            has_slipped: false,
        }
    }

    #[inline(always)]
    fn set(&mut self, lane: usize, is_known: bool, screw: ScrewState) {
        let ScrewState { motor_m, relative_m, coupling, .. } = screw;
        let CouplingForce { force_n, by_dry, by_share_n } = coupling;
        self.motor_m[lane] = if is_known { motor_m } else { self.motor_m[lane] };
        self.relative_m[lane] = if is_known { relative_m } else { self.relative_m[lane] };
        self.force_n[lane] = if is_known { force_n } else { self.force_n[lane] };
        self.by_dry[lane] = if is_known { by_dry } else { self.by_dry[lane] };
        self.by_share_n[lane] = if is_known { by_share_n } else { self.by_share_n[lane] };
    }
}

widest! {
    /// Eight parts of a segment, all of one length, each walked from nowhere; where the walks end.
    fn abreast(ways: CouplingParams, channels: (&[f64], &[f64]), part: usize, found: &mut Found<'_>) -> ScrewStates8 {
        let (motor_m, load_n) = channels;
        let mut screws = ScrewStates8::NOWHERE;
        for k in 0..part {
            let (mut motor, mut load) = ([0.0; Lanes::COUNT], [0.0; Lanes::COUNT]);
            for lane in 0..Lanes::COUNT {
                motor[lane] = motor_m[lane * part + k];
                load[lane] = load_n[lane * part + k];
            }
            let mut is_known = [false; Lanes::COUNT];
            for lane in 0..Lanes::COUNT {
                is_known[lane] = (motor[lane] + load[lane]).abs() < f64::INFINITY;
                let screw = ways.moved(&screws.get(lane), motor[lane], load[lane]);
                screws.set(lane, is_known[lane], screw);
            }
            for (lane, is_known) in is_known.into_iter().enumerate() {
                let at = lane * part + k;
                found.force_n[at] = if is_known { screws.force_n[lane] } else { f64::NAN };
                found.by_dry[at] = if is_known { screws.by_dry[lane] } else { 0.0 };
                found.by_share_n[at] = if is_known { screws.by_share_n[lane] } else { 0.0 };
            }
        }
        screws
    }
}

widest! {
    fn touches(force_n: &[f64], firm_n: f64, touches: &mut [Touch]) {
        for (&force_n, touch) in force_n.iter().zip(touches) {
            let (upper, lower) = (u8::from(force_n > 0.0), u8::from(force_n < 0.0));
            let firm = u8::from(force_n.abs() > firm_n);
            *touch = Touch((upper * Touch::UPPER) | (lower * Touch::LOWER) | (firm * Touch::FIRM));
        }
    }
}

widest! {
    /// Of the blocks of a segment.
    fn kept(touches: &[Touch], kept: &mut [Touch]) {
        for (around, kept) in touches.array_windows::<KEPT>().zip(kept.iter_mut().skip(BEFORE)) {
            let here = around[BEFORE].0;
            let all = around[0].0 & around[1].0 & here & around[3].0;
            let is_kept = all & (Touch::UPPER | Touch::LOWER) != 0 && here & !all & Touch::FIRM == 0;
            *kept = Touch(here * u8::from(is_kept));
        }
    }
}

widest! {
    /// Drops the blocks of which something is missing or whose neighbours do, and those at the very beginning.
    fn drop_unsound(blocks: &BlockMeans, kept: &mut [Touch]) {
        let inner = 1..kept.len().max(2) - 1;
        let (time_s, dx_m) = (&blocks.time_s[inner.clone()], &blocks.dx_m[inner.clone()]);
        let rates = blocks.motor_m.array_windows::<3>().zip(blocks.load_n.array_windows::<3>());
        for (((motor_m, load_n), (time_s, dx_m)), kept) in rates.zip(time_s.iter().zip(dx_m)).zip(&mut kept[inner])
        {
            *kept = Touch(kept.0 * u8::from(is_sound(*time_s, *dx_m, motor_m, load_n)));
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::friction_model::Friction;
    use super::*;

    proptest! {
        /// However a flight is cut, and whatever is missing of it, eight walks abreast are one walk, bit for bit. Motors
        /// that rest leave the screw stuck for long; so does friction beyond any load.
        #[test]
        fn walks_abreast_are_one_walk(
            steps in proptest::collection::vec((-3_i32..4, -40_i32..41, 0_u8..30), 1..400),
            cuts in proptest::collection::vec(0.0_f64..1.0, 0..4),
            gap_m in 0.0_f64..1e-4, dry_n in prop_oneof![0.0_f64..300.0, Just(1e5)], lost_share in 0.0_f64..0.2,
        ) {
            let mut place_m = 0.0;
            let mut blocks = BlockMeans::default();
            for &(step, load, chance) in &steps {
                place_m += f64::from(step) * 1.3e-5;
                let missing = |which: u8| if chance == which { f64::NAN } else { 0.0 };
                blocks.put([place_m + missing(0), 0.0, f64::from(load) * 51.7 + missing(1)]);
            }
            let mut starts: Vec<usize> = cuts.iter().map(|cut| (cut * steps.len() as f64) as usize).collect();
            starts.push(0);
            starts.sort_unstable();
            starts.dedup();
            blocks.starts = starts;
            let friction = Friction { dry_n, lost_share };
            let state = FrictionState { stiffness_n_per_m: 5e7, gap_m, friction, skew_s: 0.0 };
            // In the memory of a course that knew another gap.
            let mut course = CouplingPath::default();
            course.follow(&blocks, &FrictionState { gap_m: gap_m + 1e-5, stiffness_n_per_m: 4e7, ..state });
            course.follow(&blocks, &state);
            for segment in blocks.segments() {
                let mut walk = CouplingIntegrator::new(CouplingParams::new(&state));
                for k in segment {
                    let one = walk.step(blocks.motor_m[k], blocks.load_n[k]);
                    let wanted = [one.force_n, one.by_dry, one.by_share_n].map(f64::to_bits);
                    let found = [course.force_n[k], course.by_dry[k], course.by_share_n[k]].map(f64::to_bits);
                    prop_assert_eq!(found, wanted, "block {}", k);
                }
            }
        }
    }
}
