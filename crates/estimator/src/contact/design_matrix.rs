//! Blocks in contact as rows of a regression: averaged over stretches that stay on one flank.

use super::PartPrior;
use std::f64::consts::TAU;
use std::ops::Range;

use super::acceptance::Rejection;
use super::block_means::BlockMeans;
use super::coupling_path::{CouplingPath, PathColumns, Touch};
use super::friction_model::FrictionState;
use crate::gap::load_band::quantiles;
use crate::gap::statistic::extremes;
use crate::simd::dispatch::{Lanes, simd_dispatch};

/// Columns of the regression.
pub(super) const COLUMNS: usize = 16;

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
/// ∂c/∂p over the 95 % load.
pub(super) const STRIBECK: usize = 5;
/// Ẋ₁ over a reference speed: its coefficient is the skew.
pub(super) const SPEED: usize = 6;
/// Ḟ: a load channel that lags.
pub(super) const LOAD_RATE: usize = 7;
/// Drift: t and t², from −1 to 1.
pub(super) const DRIFT: usize = 8;
const DRIFT_SQUARE: usize = 9;
/// Transducer error: X, X² and X³, from −1 to 1.
pub(super) const PLACE: usize = 10;
const PLACE_SQUARE: usize = 11;
const PLACE_CUBE: usize = 12;
/// c·t: a stiffness that drifts within the flight.
pub(super) const FORCE_DRIFT: usize = 13;
/// Errors periodic in position: sine and cosine.
pub(super) const PERIODIC: usize = 14;
const PERIODIC_COSINE: usize = 15;

/// Forces over the 95 % load below which flanks may be soft.
pub(super) const FIRM_SHARE: f64 = 0.12;
/// Speed that scales the skew's column, m/s.
pub(super) const SPEED_M_PER_S: f64 = 0.02;
/// Time that scales the load rate's column, s.
pub(super) const LATE_S: f64 = 0.01;
/// Blocks in a row, at least and at most; long flights need no finer rows.
const ROW_BLOCKS: (usize, usize) = (25, 100);
/// The 95 % load must exceed the force the model does not know by this factor, or friction alone may hold the
/// screw within the gap for the whole flight.
const LEAST_LOAD: f64 = 1.5;
/// Blocks of flight for each block in a row, so that long flights have no more rows than they need.
const BLOCKS_PER_ROW_BLOCK: usize = 10_000;

/// Wind-ups that the motor must travel: at rest, friction and a gap cannot be told apart.
const LEAST_TRAVEL: f64 = 3.0;
/// Periods that the travel must show for their errors to be told apart from a drift.
const PERIODS: f64 = 3.0;

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
    /// Sense in which the motor drives the friction model: −1 where the load is the motor's own.
    pub(super) motor_sense: f64,
    /// 2π over the travel of a period, 1/m; zero where nothing repeats, or too little of it is seen.
    pub(super) per_period: f64,
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
        if !prior.output_locked && 2.0 * place_m.1 < LEAST_TRAVEL * load_n / prior.stiffness_n_per_m {
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
            // A locked screw shows nothing of its transducer.
            per_place: if prior.output_locked { 0.0 } else { place_m.1.recip() },
            per_time: time_s.1.recip(),
            per_speed: (two_blocks_s * SPEED_M_PER_S).recip(),
            per_load_rate: LATE_S / (two_blocks_s * load_n),
            row_blocks: (blocks.len() / BLOCKS_PER_ROW_BLOCK).clamp(fewest, most),
            motor_sense: if prior.output_locked { -1.0 } else { 1.0 },
            per_period: prior.period_m.filter(|m| 2.0 * place_m.1 > PERIODS * m).map_or(0.0, |m| TAU / m),
        })
    }

    /// The wind-up of the part at the 95 % load, m.
    pub(super) fn windup_m(&self) -> f64 {
        self.load_n / self.stiffness_n_per_m
    }

    /// A time from −1 at the start of the flight to 1 at its end.
    pub(super) fn time_share(&self, time_s: f64) -> f64 {
        (time_s - self.time_s.0) * self.per_time
    }

    /// The middle of a row, s from the first sample of the log.
    pub(super) fn moment_s(&self, row: &DesignRow<COLUMNS>) -> f64 {
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
pub(super) struct DesignMatrix {
    /// Rows beyond the share of the load below which flanks may be soft.
    pub(super) firm: Vec<DesignRow<COLUMNS>>,
    /// Rows below it.
    pub(super) light: Vec<DesignRow<COLUMNS>>,
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
    pub(super) scaling: &'a Scaling,
}

/// Rows of all blocks that keep their flank, none of which mixes flank and gap.
///
/// Under vibration a flank is touched for milliseconds at a time: a row gathers such touches of one flank until it is
/// full or its correlation block ends.
pub(super) fn rows(source: RowSource<'_>, state: &FrictionState, path: &mut CouplingPath) -> DesignMatrix {
    let RowSource { blocks, scaling } = source;
    path.integrate(source, state);
    path.mark_stable(blocks, scaling);
    let mut design = DesignMatrix { firm: Vec::new(), light: Vec::new(), touched_s: (0.0, 0.0) };
    let mut open: [DesignRow<COLUMNS>; 4] = [DesignRow::ZERO; 4];
    let mut stretch = None;
    for segment in blocks.segments() {
        let mut first = segment.start;
        while let Some((touch, run)) = path.next_stable_run(blocks, first..segment.end, scaling.row_blocks) {
            first = run.end;
            let here = blocks.stretch(run.start);
            if stretch != Some(here) {
                design.close_all(&mut open, blocks.period_s);
                stretch = Some(here);
            }
            let sum = source.sum(&path.columns, run, touch.flank().sign());
            let row = &mut open[touch.index()];
            if row.blocks > 0.0 && row.blocks + sum.blocks > scaling.row_blocks as f64 {
                design.close(touch.index(), row, blocks.period_s);
            }
            row.add(&sum);
        }
    }
    design.close_all(&mut open, blocks.period_s);
    design
}

impl DesignMatrix {
    /// Takes in the rows that are open.
    fn close_all(&mut self, open: &mut [DesignRow<COLUMNS>; 4], period_s: f64) {
        for (index, row) in open.iter_mut().enumerate() {
            if row.blocks > 0.0 {
                self.close(index, row, period_s);
            }
        }
    }

    /// Takes in a row, and empties it.
    fn close(&mut self, index: usize, row: &mut DesignRow<COLUMNS>, period_s: f64) {
        let mean = std::mem::replace(row, DesignRow::ZERO).mean();
        if !Touch::is_firm_index(index) {
            self.light.push(mean);
            return;
        }
        if mean.x[GAP] > 0.0 {
            self.touched_s.0 += mean.blocks * period_s;
        } else {
            self.touched_s.1 += mean.blocks * period_s;
        }
        self.firm.push(mean);
    }
}

impl RowSource<'_> {
    /// The sums of a row of complete blocks.
    pub(super) fn sum(&self, path: &PathColumns, within: Range<usize>, side: f64) -> DesignRow<COLUMNS> {
        let Self { blocks, scaling } = self;
        let (first, end) = (within.start, within.end);
        let mut sum =
            DesignRow { stretch: blocks.stretch(first), blocks: within.len() as f64, ..DesignRow::ZERO };
        // Central differences of neighbours: all but the first and last two cancel.
        let change = |values: &[f64]| values[end] + values[end - 1] - values[first] - values[first - 1];
        sum.x[ORIGIN] = sum.blocks;
        sum.x[GAP] = 0.5 * side * sum.blocks;
        sum.x[SPEED] = change(&blocks.motor_m) * scaling.per_speed;
        sum.x[LOAD_RATE] = change(&blocks.load_n) * scaling.per_load_rate;
        let sums = channel_sums(
            [&blocks.motor_m[within.clone()], &blocks.dx_m[within.clone()], &blocks.time_s[within.clone()]],
            [
                &path.force_n[within.clone()],
                &path.dforce_ddry[within.clone()],
                &path.dforce_dloss_n[within.clone()],
                &path.dforce_dstribeck_n[within],
            ],
            (scaling.time_s.0, scaling.per_time),
            (scaling.place_m.0, scaling.per_place),
        );
        sum.y_m = sums[0];
        sum.x[FORCE] = sums[1] * scaling.per_load;
        sum.x[DRY] = sums[2];
        sum.x[SHARE] = sums[3] * scaling.per_load;
        sum.x[STRIBECK] = sums[4] * scaling.per_load;
        sum.x[DRIFT] = sums[5];
        sum.x[DRIFT_SQUARE] = sums[6];
        sum.x[PLACE] = sums[7];
        sum.x[PLACE_SQUARE] = sums[8];
        sum.x[PLACE_CUBE] = sums[9];
        sum.x[FORCE_DRIFT] = sums[10] * scaling.per_load;
        if let Some(phases) = blocks.phases.get(first..end) {
            for [sine, cosine] in phases {
                sum.x[PERIODIC] += sine;
                sum.x[PERIODIC_COSINE] += cosine;
            }
        }
        sum
    }
}

impl RowSource<'_> {
    /// The columns of a block that do not depend on the force in the coupling, and δX, m.
    pub(super) fn slow_columns(&self, k: usize) -> ([f64; COLUMNS], f64) {
        let Self { blocks, scaling } = self;
        let time = scaling.time_share(blocks.time_s[k]);
        let place = (blocks.motor_m[k] + blocks.dx_m[k] - scaling.place_m.0) * scaling.per_place;
        let mut x = [0.0; COLUMNS];
        x[ORIGIN] = 1.0;
        x[SPEED] = (blocks.motor_m[k + 1] - blocks.motor_m[k - 1]) * scaling.per_speed;
        x[LOAD_RATE] = (blocks.load_n[k + 1] - blocks.load_n[k - 1]) * scaling.per_load_rate;
        (x[DRIFT], x[DRIFT_SQUARE]) = (time, time * time);
        (x[PLACE], x[PLACE_SQUARE], x[PLACE_CUBE]) = (place, place * place, place * place * place);
        if let Some([sine, cosine]) = blocks.phases.get(k) {
            (x[PERIODIC], x[PERIODIC_COSINE]) = (*sine, *cosine);
        }
        (x, blocks.dx_m[k])
    }
}

/// What [`channel_sums`] sums: δX, c, its three derivatives, t, t², X, X², X³ and c·t.
const SUMS: usize = 11;

simd_dispatch! {
    /// Sums over the blocks of a run, in eight lanes: `[X₁, δX, time]` and `[c, ∂c/∂F_d, ∂c/∂η, ∂c/∂p]`; time and
    /// position from a middle and times a scale.
    fn channel_sums(
        channels: [&[f64]; 3],
        coupling: [&[f64]; 4],
        time: (f64, f64),
        place: (f64, f64),
    ) -> [f64; SUMS] {
        let mut lanes = [Lanes::ZERO; SUMS];
        let blocks = channels[0].len();
        let mut first = 0;
        while first < blocks {
            let count = if blocks - first < Lanes::COUNT { blocks - first } else { Lanes::COUNT };
            if count == Lanes::COUNT {
                for lane in 0..Lanes::COUNT {
                    let k = first + lane;
                    let (motor_m, dx_m) = (channels[0][k], channels[1][k]);
                    let t = (channels[2][k] - time.0) * time.1;
                    // The screw's own: its transducer's slope acts on the gap as well.
                    let x = (motor_m + dx_m - place.0) * place.1;
                    let force_n = coupling[0][k];
                    lanes[0].0[lane] += dx_m;
                    lanes[1].0[lane] += force_n;
                    lanes[2].0[lane] += coupling[1][k];
                    lanes[3].0[lane] += coupling[2][k];
                    lanes[4].0[lane] += coupling[3][k];
                    lanes[5].0[lane] += t;
                    lanes[6].0[lane] += t * t;
                    lanes[7].0[lane] += x;
                    lanes[8].0[lane] += x * x;
                    lanes[9].0[lane] += x * x * x;
                    lanes[10].0[lane] += force_n * t;
                }
            } else {
                for k in first..blocks {
                    let (motor_m, dx_m) = (channels[0][k], channels[1][k]);
                    let t = (channels[2][k] - time.0) * time.1;
                    let x = (motor_m + dx_m - place.0) * place.1;
                    let force_n = coupling[0][k];
                    let all = [
                        dx_m, force_n, coupling[1][k], coupling[2][k], coupling[3][k], t, t * t, x, x * x,
                        x * x * x, force_n * t,
                    ];
                    for sum in 0..SUMS {
                        lanes[sum].0[k - first] += all[sum];
                    }
                }
            }
            first += count;
        }
        let mut sums = [0.0; SUMS];
        for sum in 0..SUMS {
            for lane in 0..Lanes::COUNT {
                sums[sum] += lanes[sum].0[lane];
            }
        }
        sums
    }
}

impl<const N: usize> DesignRow<N> {
    const ZERO: Self = Self { x: [0.0; N], y_m: 0.0, blocks: 0.0, stretch: 0 };

    fn add(&mut self, other: &Self) {
        self.x.iter_mut().zip(&other.x).for_each(|(sum, x)| *sum += x);
        self.y_m += other.y_m;
        self.blocks += other.blocks;
        self.stretch = other.stretch;
    }

    fn mean(&self) -> Self {
        let share = self.blocks.recip();
        Self { x: self.x.map(|x| x * share), y_m: self.y_m * share, ..*self }
    }
}
