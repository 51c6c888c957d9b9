//! What the coupling does over a flight: followed from block to block once, so that all else goes side by side.

use std::ops::Range;

use super::blocks::{Blocks, is_sound};
use super::coupling::{State, Walk};
use super::design::{FIRM_SHARE, Flank, Frame};
use crate::wide::widest;

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
pub(super) struct Course {
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

impl Course {
    /// Follows the coupling over all segments, in the memory of the course before.
    pub(super) fn follow(&mut self, blocks: &Blocks, state: &State) {
        for column in [&mut self.force_n, &mut self.by_dry, &mut self.by_share_n] {
            column.resize(blocks.len(), f64::NAN);
        }
        for segment in blocks.segments() {
            let mut walk = Walk::new(state);
            let channels = blocks.motor_m[segment.clone()].iter().zip(&blocks.load_n[segment.clone()]);
            let friction = self.by_dry[segment.clone()].iter_mut().zip(&mut self.by_share_n[segment.clone()]);
            let coupling = self.force_n[segment].iter_mut().zip(friction);
            for ((&motor_m, &load_n), (force_n, (by_dry, by_share_n))) in channels.zip(coupling) {
                let here = walk.step(motor_m, load_n);
                (*force_n, *by_dry, *by_share_n) = (here.force_n, here.by_dry, here.by_share_n);
            }
        }
    }

    /// Finds the blocks that keep flank and firmness, so that no row mixes flank and gap.
    pub(super) fn keep(&mut self, blocks: &Blocks, frame: &Frame) {
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
        blocks: &Blocks,
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

widest! {
    fn touches(force_n: &[f64], firm_n: f64, touches: &mut [Touch]) {
        for (&force_n, touch) in force_n.iter().zip(touches) {
            let (upper, lower) = (u8::from(force_n > 0.0), u8::from(force_n < 0.0));
            let firm = u8::from(force_n.abs() > firm_n);
            *touch = Touch(upper * Touch::UPPER | lower * Touch::LOWER | firm * Touch::FIRM);
        }
    }
}

widest! {
    /// Of the blocks of a segment.
    fn kept(touches: &[Touch], kept: &mut [Touch]) {
        for (around, kept) in touches.array_windows::<KEPT>().zip(kept.iter_mut().skip(BEFORE)) {
            let here = around[BEFORE].0;
            let all = around[0].0 & around[1].0 & here & around[3].0;
            let is_kept = (all & (Touch::UPPER | Touch::LOWER) != 0) & (here & !all & Touch::FIRM == 0);
            *kept = Touch(here * u8::from(is_kept));
        }
    }
}

widest! {
    /// Drops the blocks of which something is missing or whose neighbours do, and those at the very beginning.
    fn drop_unsound(blocks: &Blocks, kept: &mut [Touch]) {
        let inner = 1..kept.len().max(2) - 1;
        let (time_s, dx_m) = (&blocks.time_s[inner.clone()], &blocks.dx_m[inner.clone()]);
        let rates = blocks.motor_m.array_windows::<3>().zip(blocks.load_n.array_windows::<3>());
        for (((motor_m, load_n), (time_s, dx_m)), kept) in rates.zip(time_s.iter().zip(dx_m)).zip(&mut kept[inner])
        {
            *kept = Touch(kept.0 * u8::from(is_sound(*time_s, *dx_m, motor_m, load_n)));
        }
    }
}
