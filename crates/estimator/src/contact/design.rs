//! Blocks in contact as rows of a regression: averaged over stretches that stay on one flank.

use super::Prior;
use std::ops::Range;

use super::blocks::Blocks;
use super::coupling::{Coupling, State, Walk};
use super::refusal::Refusal;
use crate::gap::extremes;
use crate::load::quantiles;

/// Columns while the flanks are straight.
pub(super) const LINEAR: usize = 12;
/// Columns with the four that let them bend.
pub(super) const CURVED: usize = 16;

/// δX₀.
pub(super) const ORIGIN: usize = 0;
/// s/2: its coefficient is the gap.
pub(super) const GAP: usize = 1;
/// c over the 95 % load.
pub(super) const FORCE: usize = 2;
/// ∂c/∂F_d, whose coefficient is what F_d lacks, over K.
pub(super) const DRY: usize = 3;
/// ∂c/∂η over the 95 % load.
pub(super) const SHARE: usize = 4;
/// Ẋ₁ over a reference speed: its coefficient is the skew.
pub(super) const SPEED: usize = 5;
/// Drift: t and t², from −1 to 1.
pub(super) const DRIFT: usize = 6;
const DRIFT_SQUARE: usize = 7;
/// Transducer error: X, X² and X³, from −1 to 1.
pub(super) const PLACE: usize = 8;
const PLACE_SQUARE: usize = 9;
const PLACE_CUBE: usize = 10;
/// Ḟ: a load channel that lags.
pub(super) const LOAD_RATE: usize = 11;
/// Softness at low load.
pub(super) const BEND: usize = 12;

/// Loads over the 95 % load below which each bend acts.
const KNEES: [f64; 3] = [0.06, 0.2, 0.5];
/// Forces over the 95 % load below which flanks may be soft.
pub(super) const FIRM_SHARE: f64 = 0.12;
/// Speed that scales the skew's column, m/s.
pub(super) const SPEED_M_PER_S: f64 = 0.02;
/// Time that scales the load rate's column, s.
pub(super) const LATE_S: f64 = 0.01;
/// The first second is left out: offsets settle and logs start in motion, s.
const START_S: f64 = 1.0;
/// Residuals are taken as dependent within this time, s.
const STRETCH_S: f64 = 2.0;
/// Blocks around one that must keep its flank, itself among them: two before and one after.
const KEPT_BLOCKS: u32 = 4;
/// Blocks in a row, at least and at most; long flights need no finer rows.
const ROW_BLOCKS: (usize, usize) = (6, 25);
/// The 95 % load must exceed the force the model does not know by this factor, or friction alone may hold the
/// screw within the gap for the whole flight.
const LEAST_LOAD: f64 = 1.5;
/// Blocks of flight for each block in a row, so that long flights have no more rows than they need.
const BLOCKS_PER_ROW_BLOCK: usize = 2000;

/// Scales that bring every column to about one.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame {
    /// 95 % quantile of the load's magnitude, N.
    pub(super) load_n: f64,
    /// Stiffness of the part, N/m.
    pub(super) stiffness_n_per_m: f64,
    /// Middle and half length of the flight, s.
    time_s: (f64, f64),
    /// Middle and half of the stroke seen, m.
    pub(super) place_m: (f64, f64),
    /// 1/load, 1/N, and 1/half of the stroke, 1/m: a product is a quarter of a division.
    per_load: f64,
    per_place: f64,
    row_blocks: usize,
}

impl Frame {
    /// # Errors
    /// [`Refusal::TooShort`], [`Refusal::LoadTooSmall`], [`Refusal::TravelTooSmall`].
    pub(super) fn of(blocks: &Blocks, prior: &Prior) -> Result<Self, Refusal> {
        let sizes_n: Vec<f64> = blocks.load_n.iter().map(|f| f.abs()).collect();
        let whole = 0..sizes_n.len();
        let [load_n] = quantiles(&sizes_n, std::slice::from_ref(&whole), [0.95]).ok_or(Refusal::TooShort)?;
        if load_n <= prior.unknown_force_n.map_or(0.0, |force_n| LEAST_LOAD * force_n) {
            return Err(Refusal::LoadTooSmall);
        }
        let place_m = middle_and_half(&blocks.motor_m);
        if 2.0 * place_m.1 < load_n / prior.stiffness_n_per_m {
            return Err(Refusal::TravelTooSmall);
        }
        let (fewest, most) = ROW_BLOCKS;
        Ok(Self {
            load_n,
            stiffness_n_per_m: prior.stiffness_n_per_m,
            time_s: middle_and_half(&blocks.time_s),
            place_m,
            per_load: load_n.recip(),
            per_place: place_m.1.recip(),
            row_blocks: (blocks.len() / BLOCKS_PER_ROW_BLOCK).clamp(fewest, most),
        })
    }

    /// The wind-up of the part at the 95 % load, m.
    pub(super) fn windup_m(&self) -> f64 {
        self.load_n / self.stiffness_n_per_m
    }

    /// The middle of a row, s from the first sample of the log.
    pub(super) fn moment_s(&self, row: &Row<LINEAR>) -> f64 {
        self.time_s.0 + row.x[DRIFT] * self.time_s.1
    }
}

/// Middle and half length of what values span; a negative length where there are none.
pub(super) fn middle_and_half(values: &[f64]) -> (f64, f64) {
    let (low, high) = extremes(values);
    let low = low.into_iter().fold(f64::INFINITY, f64::min);
    let high = high.into_iter().fold(f64::NEG_INFINITY, f64::max);
    (0.5 * (low + high), 0.5 * (high - low))
}

/// The mean of some blocks in contact on one flank.
#[derive(Debug, Clone, Copy)]
pub(super) struct Row<const N: usize> {
    /// Regressors.
    pub(super) x: [f64; N],
    /// δX, m.
    pub(super) y_m: f64,
    /// How many blocks.
    pub(super) blocks: f64,
    /// Rows of one stretch are taken as dependent.
    pub(super) stretch: u32,
}

/// All rows, and how long each flank was touched.
#[derive(Debug)]
pub(super) struct Design<const N: usize> {
    /// Rows beyond the share of the load below which flanks may be soft.
    pub(super) firm: Vec<Row<N>>,
    /// Rows below it.
    pub(super) light: Vec<Row<N>>,
    /// Time in firm contact on the upper and the lower flank, s.
    pub(super) touched_s: (f64, f64),
}

/// One of the two sides of the gap.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Flank {
    /// Pressed by a positive force.
    Upper,
    /// Pressed by a negative one.
    Lower,
}

impl Flank {
    /// s, +1 for the upper and −1 for the lower.
    pub fn sign(self) -> f64 {
        match self {
            Self::Upper => 1.0,
            Self::Lower => -1.0,
        }
    }
}

/// Which flank a block presses, and whether firmly.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Touch {
    flank: Flank,
    is_firm: bool,
}

impl Touch {
    /// None in the gap, or where the force is unknown.
    fn of(force: f64) -> Option<Self> {
        let flank = if force > 0.0 {
            Flank::Upper
        } else if force < 0.0 {
            Flank::Lower
        } else {
            return None;
        };
        Some(Self { flank, is_firm: force.abs() > FIRM_SHARE })
    }
}

/// For how many blocks a flank has been kept.
#[derive(Debug, Default)]
struct Keeping {
    last: Option<Touch>,
    /// Blocks on the flank of the last one, and how many of the latest were firm without a break.
    blocks: u32,
    firm_blocks: u32,
}

impl Keeping {
    /// Takes the next block. Gives the touch of the one before it where flank and firmness were kept for
    /// two blocks before that and are kept in this one.
    #[inline]
    fn push(&mut self, next: Option<Touch>) -> Option<Touch> {
        let before = std::mem::replace(&mut self.last, next);
        let Some(touch) = next else {
            (self.blocks, self.firm_blocks) = (0, 0);
            return None;
        };
        if before.is_none_or(|before| before.flank != touch.flank) {
            (self.blocks, self.firm_blocks) = (0, 0);
        }
        self.blocks += 1;
        self.firm_blocks = if touch.is_firm { self.firm_blocks + 1 } else { 0 };
        before.filter(|before| {
            let kept = if before.is_firm { self.firm_blocks } else { self.blocks };
            kept >= KEPT_BLOCKS
        })
    }
}

/// What a block's row holds whatever the state: found once, used in every turn.
#[derive(Debug)]
pub(super) struct Pace {
    /// t, from −1 to 1.
    time: Vec<f64>,
    /// Ẋ₁ over its scale.
    speed: Vec<f64>,
    /// Ḟ over its scale; NaN where the flight has only begun.
    load_rate: Vec<f64>,
    stretch: Vec<u32>,
}

impl Pace {
    pub(super) fn of(blocks: &Blocks, frame: &Frame) -> Self {
        let mut speed = blocks.rates(&blocks.motor_m);
        speed.iter_mut().for_each(|speed| *speed /= SPEED_M_PER_S);
        let mut load_rate = blocks.rates(&blocks.load_n);
        for (rate, &time_s) in load_rate.iter_mut().zip(&blocks.time_s) {
            *rate = if time_s > START_S { *rate * LATE_S / frame.load_n } else { f64::NAN };
        }
        Self {
            time: blocks.time_s.iter().map(|t| (t - frame.time_s.0) / frame.time_s.1).collect(),
            speed,
            load_rate,
            stretch: blocks.time_s.iter().map(|t| (t / STRETCH_S) as u32).collect(),
        }
    }
}

/// Where rows are made from: blocks, what they hold whatever the state, and the scales.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ground<'a> {
    pub(super) blocks: &'a Blocks,
    pub(super) pace: &'a Pace,
    pub(super) frame: &'a Frame,
}

/// Rows of all blocks that have kept their flank for two blocks before and one after, and their
/// firmness as well, so that no row mixes flank and gap.
pub(super) fn rows<const N: usize>(ground: Ground<'_>, state: &State) -> Design<N> {
    let Ground { blocks, frame, .. } = ground;
    let mut design = Design { firm: Vec::new(), light: Vec::new(), touched_s: (0.0, 0.0) };
    let (mut walk, mut keeping) = (Walk::new(state), Keeping::default());
    let mut presses = Presses::default();
    let mut open: Option<(Touch, usize)> = None;
    let mut starts = blocks.starts.iter().copied().peekable();
    for (next, (&motor_m, &load_n)) in blocks.motor_m.iter().zip(&blocks.load_n).enumerate() {
        if starts.next_if_eq(&next).is_some() {
            walk.restart();
            keeping = Keeping::default();
        }
        let press = Press::of(walk.step(motor_m, load_n), frame);
        presses.put(next, press);
        let steady = keeping.push(Touch::of(press.force)).filter(|_| ground.is_sound(next - 1));
        if let Some((touch, first)) = open
            && (steady != Some(touch) || !ground.joins(first, next - 1))
        {
            design.close(touch, &ground.sum(&presses, first..next - 1, touch.flank.sign()), blocks.period_s);
            open = None;
        }
        open = open.or(steady.map(|touch| (touch, next - 1)));
    }
    if let Some((touch, first)) = open {
        let row = ground.sum(&presses, first..blocks.len() - 1, touch.flank.sign());
        design.close(touch, &row, blocks.period_s);
    }
    design
}

impl<const N: usize> Design<N> {
    /// Takes in a row that is full.
    fn close(&mut self, touch: Touch, sum: &Row<N>, period_s: f64) {
        if !touch.is_firm {
            self.light.push(sum.mean());
            return;
        }
        match touch.flank {
            Flank::Upper => self.touched_s.0 += sum.blocks * period_s,
            Flank::Lower => self.touched_s.1 += sum.blocks * period_s,
        }
        self.firm.push(sum.mean());
    }
}

/// Single blocks as rows, every so many, whether in contact or in the gap.
pub(super) fn every(ground: Ground<'_>, state: &State, stride: usize) -> Vec<Row<LINEAR>> {
    let blocks = ground.blocks;
    let mut walk = Walk::new(state);
    let mut starts = blocks.starts.iter().copied().peekable();
    let mut rows = Vec::with_capacity(blocks.len() / stride + 1);
    let mut presses = Presses::default();
    for (k, (&motor_m, &load_n)) in blocks.motor_m.iter().zip(&blocks.load_n).enumerate() {
        if starts.next_if_eq(&k).is_some() {
            walk.restart();
        }
        let coupling = walk.step(motor_m, load_n);
        if k % stride == 0 {
            let force_n = coupling.force_n;
            let side = if force_n == 0.0 { 0.0 } else { force_n.signum() };
            if ground.is_sound(k) {
                presses.put(k, Press::of(coupling, ground.frame));
                rows.push(ground.sum(&presses, k..k + 1, side));
            }
        }
    }
    rows.retain(|row| row.x[FORCE].is_finite());
    rows
}

/// The coupling of a block over the 95 % load.
#[derive(Debug, Clone, Copy, Default)]
struct Press {
    force: f64,
    by_dry: f64,
    by_share: f64,
}

impl Press {
    #[inline]
    fn of(coupling: Coupling, frame: &Frame) -> Self {
        let Coupling { force_n, by_dry, by_share_n } = coupling;
        Self { force: force_n * frame.per_load, by_dry, by_share: by_share_n * frame.per_load }
    }
}

/// The couplings of the latest blocks: of as many at least as belong to a row.
#[derive(Debug, Default)]
struct Presses([Press; Self::KEPT]);

impl Presses {
    const KEPT: usize = 32;

    #[inline]
    fn put(&mut self, k: usize, press: Press) {
        self.0[k % Self::KEPT] = press;
    }

    #[inline]
    fn of(&self, k: usize) -> &Press {
        &self.0[k % Self::KEPT]
    }
}

impl Ground<'_> {
    /// Whether nothing of a block is missing and the flight has more than begun.
    #[inline]
    fn is_sound(&self, k: usize) -> bool {
        let Self { blocks, pace, .. } = self;
        (blocks.dx_m[k] + pace.speed[k] + pace.load_rate[k]).is_finite()
    }

    /// Whether a block may belong to a row from another on: one of no more blocks than a row holds, and of one stretch.
    #[inline]
    fn joins(&self, first: usize, k: usize) -> bool {
        k - first < self.frame.row_blocks && self.pace.stretch[first] == self.pace.stretch[k]
    }

    /// The sums of a row of sound blocks.
    fn sum<const N: usize>(&self, presses: &Presses, within: Range<usize>, side: f64) -> Row<N> {
        let Self { blocks, pace, frame } = self;
        let stretch = pace.stretch[within.start];
        let mut sum = Row { stretch, blocks: within.len() as f64, ..Row::ZERO };
        let channels = blocks.motor_m[within.clone()].iter().zip(&blocks.dx_m[within.clone()]);
        let paces = pace.time[within.clone()].iter().zip(&pace.speed[within.clone()]);
        let paces = paces.zip(&pace.load_rate[within.clone()]);
        for ((k, (&motor_m, &dx_m)), ((&time, &speed), &load_rate)) in within.zip(channels).zip(paces) {
            let place = (motor_m + dx_m - frame.place_m.0) * frame.per_place;
            let moment = Moment { time, speed, load_rate, place };
            moment.add(&mut sum.x, presses.of(k), side);
            sum.y_m += dx_m;
        }
        sum
    }
}

/// What a sound block adds to a row beside its coupling.
struct Moment {
    time: f64,
    speed: f64,
    load_rate: f64,
    /// The screw's own: its transducer's slope acts on the gap as well.
    place: f64,
}

impl Moment {
    /// Adds a block to the sums of a row.
    #[inline]
    fn add<const N: usize>(&self, sums: &mut [f64; N], press: &Press, side: f64) {
        let &Self { time, speed, load_rate, place } = self;
        let bends = if N == CURVED { bends(press.force.abs()) } else { [0.0; CURVED - LINEAR] };
        // Each entry by itself: an array that is filled in pieces must be read back piece by piece.
        for (column, sum) in sums.iter_mut().enumerate() {
            *sum += match column {
                ORIGIN => 1.0,
                GAP => 0.5 * side,
                FORCE => press.force,
                DRY => press.by_dry,
                SHARE => press.by_share,
                SPEED => speed,
                DRIFT => time,
                DRIFT_SQUARE => time * time,
                PLACE => place,
                PLACE_SQUARE => place * place,
                PLACE_CUBE => place * place * place,
                LOAD_RATE => load_rate,
                bend => side * bends[bend - BEND],
            };
        }
    }
}

/// Deflections of a soft flank under a force over the 95 % load, all zero at zero force: Hertz's law,
/// δ ∝ c^(2/3), and three springs that bottom out.
pub(super) fn bends(force: f64) -> [f64; CURVED - LINEAR] {
    let root = cube_root(force);
    [root * root, force.min(KNEES[0]), force.min(KNEES[1]), force.min(KNEES[2])]
}

/// ∛x of no negative x to 1e-13 of itself, which is enough for a column of a regression and a fifth of the time of
/// the correctly rounded one: two rounds of Halley's from the third part of the exponent.
#[inline]
fn cube_root(x: f64) -> f64 {
    /// Two thirds of the exponent's bias, and what makes the first guess least wrong.
    const THIRDS: u64 = 0x2a9f_7893_782d_a1ce;
    let closer = |y: f64| {
        let cube = y * y * y;
        y * ((cube + 2.0 * x) / (2.0 * cube + x))
    };
    closer(closer(f64::from_bits(x.to_bits() / 3 + THIRDS)))
}

impl<const N: usize> Row<N> {
    const ZERO: Self = Self { x: [0.0; N], y_m: 0.0, blocks: 0.0, stretch: 0 };

    fn mean(&self) -> Self {
        let share = self.blocks.recip();
        Self { x: self.x.map(|x| x * share), y_m: self.y_m * share, ..*self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cube_root_is_one_over_all_that_a_force_may_be() {
        for exponent in -300..300 {
            let x = 1.37_f64.powi(exponent);
            assert!((cube_root(x) / x.cbrt() - 1.0).abs() < 1e-13, "{x}");
        }
        assert!(cube_root(0.0) < 1e-90 && cube_root(f64::NAN).is_nan());
    }
}
