//! Blocks in contact as rows of a regression: averaged over stretches that stay on one flank.

use std::ops::Range;

use crate::contact::blocks::block_means::BlockMeans;
use crate::contact::fit::scaling::Scaling;
use crate::contact::friction::coupling_path::{CouplingPath, Touch};
use crate::contact::friction::friction_model::{Coupling, FrictionState};

/// Columns of the regression.
pub(crate) const COLUMNS: usize = 17;

/// δX₀.
pub(crate) const ORIGIN: usize = 0;
/// s/2: its coefficient is the gap.
pub(crate) const GAP: usize = 1;
/// c over the 95 % load.
pub(crate) const FORCE: usize = 2;
/// ∂c/∂F_d, whose coefficient is what F_d lacks, over K.
pub(crate) const DRY: usize = 3;
/// ∂c/∂η over the 95 % load.
pub(crate) const SHARE: usize = 4;
/// ∂c/∂p over the 95 % load.
pub(crate) const STRIBECK: usize = 5;
/// Ẋ₁ over a reference speed: its coefficient is the skew.
pub(crate) const SPEED: usize = 6;
/// Ḟ: a load channel that lags.
pub(crate) const LOAD_RATE: usize = 7;
/// Drift: t and t², from −1 to 1.
pub(crate) const DRIFT: usize = 8;
const DRIFT_SQUARE: usize = 9;
/// Transducer error: X, X² and X³, from −1 to 1.
pub(crate) const PLACE: usize = 10;
const PLACE_SQUARE: usize = 11;
const PLACE_CUBE: usize = 12;
/// c·t: a stiffness that drifts within the flight.
pub(crate) const FORCE_DRIFT: usize = 13;
/// Errors periodic in position: sine and cosine.
pub(crate) const PERIODIC: usize = 14;
const PERIODIC_COSINE: usize = 15;
/// s·c, the size of c: its coefficient is half the difference of the compliances of both flanks.
pub(crate) const SIDE_FORCE: usize = 16;

/// The mean of some blocks in contact on one flank.
#[derive(Debug, Clone, Copy)]
pub(crate) struct DesignRow<const N: usize> {
    /// Regressors.
    pub(crate) x: [f64; N],
    /// δX, m.
    pub(crate) y_m: f64,
    /// How many blocks.
    pub(crate) blocks: f64,
    /// Rows of one stretch are taken as dependent.
    pub(crate) stretch: u32,
}

/// All rows, and how long each flank was touched.
#[derive(Debug)]
pub(crate) struct DesignMatrix {
    /// Rows beyond the share of the load below which flanks may be soft.
    pub(crate) firm: Vec<DesignRow<COLUMNS>>,
    /// Rows below it.
    pub(crate) light: Vec<DesignRow<COLUMNS>>,
    /// Time in firm contact on the upper and the lower flank, s.
    pub(crate) touched_s: (f64, f64),
}

/// Where rows are made from: blocks and the scales.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RowSource<'a> {
    pub(crate) blocks: &'a BlockMeans,
    pub(crate) scaling: &'a Scaling,
}

/// Rows of all blocks that keep their flank, none of which mixes flank and gap.
///
/// Under vibration a flank is touched for milliseconds at a time: a row gathers such touches of one flank until it is
/// full or its correlation block ends.
pub(crate) fn rows(source: RowSource<'_>, state: &FrictionState, path: &mut CouplingPath) -> DesignMatrix {
    let RowSource { blocks, scaling } = source;
    path.integrate(blocks, state, scaling.motor_sense);
    path.mark_stable(blocks, scaling.load_n);
    let mut design = DesignMatrix { firm: Vec::new(), light: Vec::new(), touched_s: (0.0, 0.0) };
    let mut open: [DesignRow<COLUMNS>; 4] = [DesignRow::ZERO; 4];
    let mut stretch = None;
    let row_blocks = scaling.row_blocks(blocks.period_s);
    for segment in blocks.segments() {
        let mut first = segment.start;
        while let Some((touch, run)) = path.next_stable_run(blocks, first..segment.end, row_blocks) {
            first = run.end;
            let here = blocks.stretch(run.start);
            if stretch != Some(here) {
                design.close_all(&mut open, blocks.period_s);
                stretch = Some(here);
            }
            let sum = source.sum(&path.couplings, run, touch.flank().sign());
            let row = &mut open[touch.index()];
            if row.blocks > 0.0 && row.blocks + sum.blocks > row_blocks as f64 {
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
    pub(crate) fn sum(&self, couplings: &[Coupling], within: Range<usize>, side: f64) -> DesignRow<COLUMNS> {
        let Self { blocks, scaling } = self;
        let (first, end) = (within.start, within.end);
        let mut sum =
            DesignRow { stretch: blocks.stretch(first), blocks: within.len() as f64, ..DesignRow::ZERO };
        // Central differences of neighbours: all but the first and last two cancel.
        let change = |values: &[f64]| values[end] + values[end - 1] - values[first] - values[first - 1];
        sum.x[ORIGIN] = sum.blocks;
        sum.x[GAP] = 0.5 * side * sum.blocks;
        sum.x[SPEED] = change(&blocks.motor_m) * blocks.per_two_s * scaling.per_speed;
        sum.x[LOAD_RATE] = change(&blocks.load_n) * blocks.per_two_s * scaling.per_load_rate;
        for k in within {
            let (time, place) = self.time_and_place(k);
            let Coupling { force_n, dforce_ddry, dforce_dloss_n, dforce_dstribeck_n, .. } = couplings[k];
            sum.y_m += blocks.dx_m[k];
            sum.x[FORCE] += force_n;
            sum.x[DRY] += dforce_ddry;
            sum.x[SHARE] += dforce_dloss_n;
            sum.x[STRIBECK] += dforce_dstribeck_n;
            sum.x[DRIFT] += time;
            sum.x[DRIFT_SQUARE] += time * time;
            sum.x[PLACE] += place;
            sum.x[PLACE_SQUARE] += place * place;
            sum.x[PLACE_CUBE] += place * place * place;
            sum.x[FORCE_DRIFT] += force_n * time;
        }
        for column in [FORCE, SHARE, STRIBECK, FORCE_DRIFT] {
            sum.x[column] *= scaling.per_load;
        }
        sum.x[SIDE_FORCE] = side * sum.x[FORCE];
        if let Some(phases) = blocks.phases.get(first..end) {
            for [sine, cosine] in phases {
                sum.x[PERIODIC] += sine;
                sum.x[PERIODIC_COSINE] += cosine;
            }
        }
        sum
    }

    /// Time and screw position of a block, from −1 to 1. The screw's own position: its transducer's slope acts on the gap
    /// as well.
    fn time_and_place(&self, k: usize) -> (f64, f64) {
        let Self { blocks, scaling } = self;
        let screw_m = blocks.motor_m[k] + blocks.dx_m[k];
        (scaling.time_share(blocks.time_s[k]), (screw_m - scaling.place_m.0) * scaling.per_place)
    }

    /// δX of a block that has neighbours, without all that does not depend on the force in the coupling, m.
    pub(crate) fn without_slow_parts_m(&self, k: usize, beta: &[f64; COLUMNS]) -> f64 {
        let Self { blocks, scaling } = self;
        let (time, place) = self.time_and_place(k);
        let rate = |values: &[f64]| (values[k + 1] - values[k - 1]) * blocks.per_two_s;
        let delays_m = beta[SPEED] * scaling.per_speed * rate(&blocks.motor_m)
            + beta[LOAD_RATE] * scaling.per_load_rate * rate(&blocks.load_n);
        let drift_m = time * (beta[DRIFT] + time * beta[DRIFT_SQUARE]);
        let transducer_m = place * (beta[PLACE] + place * (beta[PLACE_SQUARE] + place * beta[PLACE_CUBE]));
        let periodic_m = blocks
            .phases
            .get(k)
            .map_or(0.0, |[sine, cosine]| beta[PERIODIC] * sine + beta[PERIODIC_COSINE] * cosine);
        blocks.dx_m[k] - delays_m - drift_m - transducer_m - periodic_m
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

impl DesignRow<COLUMNS> {
    /// The middle of a row, s from the first sample of the log.
    pub(crate) fn moment_s(&self, scaling: &Scaling) -> f64 {
        scaling.time_s.0 + self.x[DRIFT] * scaling.time_s.1
    }
}
