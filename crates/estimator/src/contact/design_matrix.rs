//! Blocks in contact as rows of a regression: averaged over stretches that stay on one flank.

use super::PartPrior;
use std::ops::Range;

use super::acceptance::Rejection;
use super::block_means::BlockMeans;
use super::coupling_path::{CouplingPath, Touch};
use super::friction_model::FrictionState;
use crate::gap::load_band::quantiles;
use crate::gap::statistic::extremes;

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
/// Blocks in a row, at least and at most; long flights need no finer rows.
const ROW_BLOCKS: (usize, usize) = (6, 25);
/// The 95 % load must exceed the force the model does not know by this factor, or friction alone may hold the
/// screw within the gap for the whole flight.
const LEAST_LOAD: f64 = 1.5;
/// Blocks of flight for each block in a row, so that long flights have no more rows than they need.
const BLOCKS_PER_ROW_BLOCK: usize = 2000;

/// Scales that bring every column to about one.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scaling {
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
    per_time: f64,
    /// What brings a difference over two blocks to the column of the speed, 1/m, and of the load's rate, 1/N.
    per_speed: f64,
    per_load_rate: f64,
    row_blocks: usize,
}

impl Scaling {
    /// # Errors
    /// [`Rejection::TooShort`], [`Rejection::LoadTooSmall`], [`Rejection::TravelTooSmall`].
    pub(super) fn of(blocks: &BlockMeans, prior: &PartPrior) -> Result<Self, Rejection> {
        let sizes_n: Vec<f64> = blocks.load_n.iter().map(|f| f.abs()).collect();
        let whole = 0..sizes_n.len();
        let [load_n] =
            quantiles(&sizes_n, std::slice::from_ref(&whole), [0.95]).ok_or(Rejection::TooShort)?;
        if load_n <= prior.unknown_force_n.map_or(0.0, |force_n| LEAST_LOAD * force_n) {
            return Err(Rejection::LoadTooSmall);
        }
        let place_m = middle_and_half(&blocks.motor_m);
        if 2.0 * place_m.1 < load_n / prior.stiffness_n_per_m {
            return Err(Rejection::TravelTooSmall);
        }
        let (fewest, most) = ROW_BLOCKS;
        let (time_s, two_blocks_s) = (middle_and_half(&blocks.time_s), 2.0 * blocks.period_s);
        Ok(Self {
            load_n,
            stiffness_n_per_m: prior.stiffness_n_per_m,
            time_s,
            place_m,
            per_load: load_n.recip(),
            per_place: place_m.1.recip(),
            per_time: time_s.1.recip(),
            per_speed: (two_blocks_s * SPEED_M_PER_S).recip(),
            per_load_rate: LATE_S / (two_blocks_s * load_n),
            row_blocks: (blocks.len() / BLOCKS_PER_ROW_BLOCK).clamp(fewest, most),
        })
    }

    /// The wind-up of the part at the 95 % load, m.
    pub(super) fn windup_m(&self) -> f64 {
        self.load_n / self.stiffness_n_per_m
    }

    /// The middle of a row, s from the first sample of the log.
    pub(super) fn moment_s(&self, row: &DesignRow<LINEAR>) -> f64 {
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
pub(super) struct DesignRow<const N: usize> {
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
pub(super) struct DesignMatrix<const N: usize> {
    /// Rows beyond the share of the load below which flanks may be soft.
    pub(super) firm: Vec<DesignRow<N>>,
    /// Rows below it.
    pub(super) light: Vec<DesignRow<N>>,
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

/// Where rows are made from: blocks and the scales.
#[derive(Debug, Clone, Copy)]
pub(super) struct RowSource<'a> {
    pub(super) blocks: &'a BlockMeans,
    pub(super) frame: &'a Scaling,
}

/// Rows of all blocks that keep their flank, none of which mixes flank and gap.
pub(super) fn rows<const N: usize>(
    ground: RowSource<'_>,
    state: &FrictionState,
    course: &mut CouplingPath,
) -> DesignMatrix<N> {
    let RowSource { blocks, frame } = ground;
    course.follow(blocks, state);
    course.keep(blocks, frame);
    let mut design = DesignMatrix { firm: Vec::new(), light: Vec::new(), touched_s: (0.0, 0.0) };
    for segment in blocks.segments() {
        let mut first = segment.start;
        while let Some((touch, row)) = course.next_kept(blocks, first..segment.end, frame.row_blocks) {
            first = row.end;
            design.close(touch, &ground.sum(course, row, touch.flank().sign()), blocks.period_s);
        }
    }
    design
}

impl<const N: usize> DesignMatrix<N> {
    /// Takes in a row that is full.
    fn close(&mut self, touch: Touch, sum: &DesignRow<N>, period_s: f64) {
        if !touch.is_firm() {
            self.light.push(sum.mean());
            return;
        }
        match touch.flank() {
            Flank::Upper => self.touched_s.0 += sum.blocks * period_s,
            Flank::Lower => self.touched_s.1 += sum.blocks * period_s,
        }
        self.firm.push(sum.mean());
    }
}

/// Single blocks as rows, every so many, whether in contact or in the gap.
pub(super) fn every(
    ground: RowSource<'_>,
    state: &FrictionState,
    course: &mut CouplingPath,
    stride: usize,
) -> Vec<DesignRow<LINEAR>> {
    course.follow(ground.blocks, state);
    let sound = (0..ground.blocks.len()).step_by(stride).filter(|&k| ground.blocks.is_sound(k));
    let row = |k: usize| {
        let force_n = course.force_n[k];
        let side = if force_n == 0.0 { 0.0 } else { force_n.signum() };
        ground.sum(course, k..k + 1, side)
    };
    sound.map(row).filter(|row| row.x[FORCE].is_finite()).collect()
}

impl RowSource<'_> {
    /// The sums of a row of sound blocks.
    fn sum<const N: usize>(&self, course: &CouplingPath, within: Range<usize>, side: f64) -> DesignRow<N> {
        let Self { blocks, frame } = self;
        let (first, end) = (within.start, within.end);
        let mut sum =
            DesignRow { stretch: blocks.stretch(first), blocks: within.len() as f64, ..DesignRow::ZERO };
        // Central differences of neighbours: all but the first and last two cancel.
        let change = |values: &[f64]| values[end] + values[end - 1] - values[first] - values[first - 1];
        sum.x[ORIGIN] = sum.blocks;
        sum.x[GAP] = 0.5 * side * sum.blocks;
        sum.x[SPEED] = change(&blocks.motor_m) * frame.per_speed;
        sum.x[LOAD_RATE] = change(&blocks.load_n) * frame.per_load_rate;
        let channels = blocks.motor_m[within.clone()].iter().zip(&blocks.dx_m[within.clone()]);
        let coupling = course.force_n[within.clone()].iter().zip(&course.by_dry[within.clone()]);
        let coupling = coupling.zip(&course.by_share_n[within.clone()]);
        let all = channels.zip(coupling).zip(&blocks.time_s[within]);
        for (((&motor_m, &dx_m), ((&force_n, &by_dry), &by_share_n)), &time_s) in all {
            let time = (time_s - frame.time_s.0) * frame.per_time;
            let force = force_n * frame.per_load;
            // The screw's own: its transducer's slope acts on the gap as well.
            let place = (motor_m + dx_m - frame.place_m.0) * frame.per_place;
            sum.y_m += dx_m;
            sum.x[FORCE] += force;
            sum.x[DRY] += by_dry;
            sum.x[SHARE] += by_share_n * frame.per_load;
            sum.x[DRIFT] += time;
            sum.x[DRIFT_SQUARE] += time * time;
            sum.x[PLACE] += place;
            sum.x[PLACE_SQUARE] += place * place;
            sum.x[PLACE_CUBE] += place * place * place;
            if N == CURVED {
                for (sum, bend) in sum.x.iter_mut().skip(BEND).zip(bends(force.abs())) {
                    *sum += side * bend;
                }
            }
        }
        sum
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

impl<const N: usize> DesignRow<N> {
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
