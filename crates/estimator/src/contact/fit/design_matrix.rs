//! Blocks in contact as rows of a regression: averaged over stretches that stay on one flank.

use crate::contact::block_means::BlockMeans;
use crate::contact::fit::scaling::{SPEED_M_PER_S, Scaling};
use crate::contact::friction::friction_model::Coupling;

/// Columns of the regression.
pub(crate) const COLUMNS: usize = 19;

/// δX₀.
pub(crate) const ORIGIN: usize = 0;
/// s/2: its coefficient is the gap.
pub(crate) const GAP: usize = 1;
/// c over the 95 % load.
pub(crate) const FORCE: usize = 2;
/// s·c, the size of c: its coefficient is half the difference of the compliances of both flanks.
pub(crate) const SIDE_FORCE: usize = 3;
/// ∂c/∂F_d: its coefficient is the error of F_d over K. The columns before this one are gap and wind-up.
pub(crate) const DRY: usize = 4;
/// ∂c/∂η over the 95 % load.
pub(crate) const SHARE: usize = 5;
/// ∂c/∂p over the 95 % load.
pub(crate) const STRIBECK: usize = 6;
/// c·t: a stiffness that drifts within the flight.
pub(crate) const FORCE_DRIFT: usize = 7;
/// c·X and c·X²: a stiffness that varies along the stroke.
pub(crate) const FORCE_PLACE: usize = 8;
/// Ẋ₁ over a reference speed: its coefficient is the skew. This column and all later ones do not depend on c.
pub(crate) const SPEED: usize = 10;
/// Ḟ: a load channel that lags.
pub(crate) const LOAD_RATE: usize = 11;
/// Drift: t and t², from −1 to 1.
pub(crate) const DRIFT: usize = 12;
/// Transducer error: X, X² and X³, from −1 to 1.
pub(crate) const PLACE: usize = 14;
/// Errors periodic in position: sine and cosine.
pub(crate) const PERIODIC: usize = 17;

/// Share of the 95 % load below which flanks may be soft.
pub(crate) const FIRM_SHARE: f64 = 0.12;
/// Number of blocks before a block that must press the same flank as firmly as it does; the next block must as well.
pub(crate) const BEFORE: usize = 2;

/// The mean of some blocks in contact on one flank.
#[derive(Debug, Clone, Copy)]
pub(crate) struct DesignRow<const N: usize> {
    /// Regressors.
    pub(crate) x: [f64; N],
    /// δX, m.
    pub(crate) y_m: f64,
    /// Number of blocks.
    pub(crate) blocks: f64,
    /// Number of the stretch of the flight; rows of one stretch are taken as correlated.
    pub(crate) stretch: u32,
}

/// All rows.
#[derive(Debug, Default)]
pub(crate) struct DesignMatrix {
    /// Rows with a force above [`FIRM_SHARE`] of the 95 % load.
    pub(crate) firm: Vec<DesignRow<COLUMNS>>,
    /// Rows with a smaller force.
    pub(crate) light: Vec<DesignRow<COLUMNS>>,
}

#[allow(clippy::inline_always, reason = "one row for each block: a call would put its numbers into memory")]
impl BlockMeans {
    /// Rows of all blocks whose neighbours press the same flank, after the screw first slipped: such a block does not mix
    /// flank and gap. Blocks of a firm row follow at least `settling` blocks that press the flank firmly.
    ///
    /// Under vibration a flank is touched for milliseconds at a time: a row gathers such touches of one flank until it is
    /// full or its stretch ends.
    pub(crate) fn rows(&self, scaling: &Scaling, settling: usize) -> DesignMatrix {
        let most = ((scaling.row_s / self.period_s).round() as usize).max(6);
        let firm = Vec::with_capacity(self.len() / most);
        let (mut design, most) = (DesignMatrix { firm, light: Vec::new() }, most as f64);
        // Open rows of the lower and the upper flank under light load, then of both under firm load.
        let mut open = [DesignRow::ZERO; 4];
        let firm_n = FIRM_SHARE * scaling.load_n;
        let (mut stretch, mut last) = (0, (0, 0));
        for segment in &self.segments {
            let mut pressed = 0;
            for (k, around) in (segment.start + BEFORE..).zip(self.couplings[segment.clone()].array_windows())
            {
                pressed = pressed_blocks(pressed, around[BEFORE].force_n, firm_n);
                // Before the screw slips for the first time, its friction may have any size.
                let has_slipped = around[BEFORE].dforce_ddry != 0.0;
                let is_settled =
                    |kind: &usize| has_slipped && (*kind < 2 || pressed.unsigned_abs() > settling);
                let kind = touch(around, firm_n).filter(is_settled);
                let Some(kind) = kind.filter(|_| self.is_complete(k)) else { continue };
                let here = self.stretch(k);
                if here != stretch {
                    open.iter_mut().enumerate().for_each(|(kind, row)| design.close(kind, row));
                    stretch = here;
                }
                // A second touch shares the row of the first if that leaves half of it free.
                let full = if last == (kind, k.wrapping_sub(1)) { most } else { 0.5 * most };
                last = (kind, k);
                if open[kind].blocks >= full {
                    design.close(kind, &mut open[kind]);
                }
                open[kind].add(&self.row(scaling, k));
            }
        }
        open.iter_mut().enumerate().for_each(|(kind, row)| design.close(kind, row));
        design
    }

    /// The row of one complete block.
    #[inline(always)]
    pub(crate) fn row(&self, scaling: &Scaling, k: usize) -> DesignRow<COLUMNS> {
        let mut x = [1.0; COLUMNS];
        x[GAP..SPEED].copy_from_slice(&self.coupling_columns(scaling, k));
        x[SPEED..].copy_from_slice(&self.slow_columns(scaling, k));
        DesignRow { x, y_m: self.dx_m[k], blocks: 1.0, stretch: self.stretch(k) }
    }

    /// The columns from [`GAP`] to [`FORCE_DRIFT`].
    #[inline]
    pub(crate) fn coupling_columns(&self, scaling: &Scaling, k: usize) -> [f64; SPEED - GAP] {
        let Coupling { force_n, dforce_ddry, dforce_dloss_n, dforce_dstribeck_n, .. } = self.couplings[k];
        let side = if force_n == 0.0 { 0.0 } else { 0.5 * force_n.signum() };
        let [force, loss, stribeck] =
            [force_n, dforce_dloss_n, dforce_dstribeck_n].map(|n| n * scaling.per_load);
        let drift = force * scaling.time_share(self.time_s[k]);
        let place = scaling.place_share(self.motor_m[k] + self.dx_m[k]);
        let at_place = force * place;
        [side, force, force.abs(), dforce_ddry, loss, stribeck, drift, at_place, at_place * place]
    }

    /// The columns from [`SPEED`] on, of a block that has neighbours.
    #[inline(always)]
    fn slow_columns(&self, scaling: &Scaling, k: usize) -> [f64; COLUMNS - SPEED] {
        let rate = |values: &[f64]| (values[k + 1] - values[k - 1]) * self.per_two_s;
        let time = scaling.time_share(self.time_s[k]);
        // The screw's own position: its transducer's slope acts on the gap as well.
        let place = scaling.place_share(self.motor_m[k] + self.dx_m[k]);
        let [sine, cosine] = self.phases.get(k).copied().unwrap_or_default();
        [
            rate(&self.motor_m) * SPEED_M_PER_S.recip(),
            rate(&self.load_n) * scaling.per_load_rate,
            time,
            time * time,
            place,
            place * place,
            place * place * place,
            sine,
            cosine,
        ]
    }

    /// δX of a block minus the fitted terms that do not depend on the coupling force, m; NaN if the block is incomplete.
    #[inline]
    pub(crate) fn without_slow_parts_m(&self, scaling: &Scaling, k: usize, beta: &[f64; COLUMNS]) -> f64 {
        if self.is_complete(k) {
            self.dx_m[k] - dot(&beta[SPEED..], &self.slow_columns(scaling, k))
        } else {
            f64::NAN
        }
    }
}

impl DesignMatrix {
    /// Adds the mean of an open row, unless it is empty, and empties the row.
    fn close(&mut self, kind: usize, row: &mut DesignRow<COLUMNS>) {
        if row.blocks > 0.0 {
            let rows = if kind < 2 { &mut self.light } else { &mut self.firm };
            rows.push(std::mem::replace(row, DesignRow::ZERO).mean());
        }
    }
}

/// Number of blocks on the flank with fewer blocks, times `each`: with a block's length in s, the time in contact, s.
pub(crate) fn less_pressed<'a>(rows: impl Iterator<Item = &'a DesignRow<COLUMNS>>, each: f64) -> f64 {
    let (mut upper, mut lower) = (0.0, 0.0);
    for row in rows {
        *(if row.x[GAP] > 0.0 { &mut upper } else { &mut lower }) += row.blocks * each;
    }
    f64::min(upper, lower)
}

/// Number of blocks with a force above `least_n`, on the flank with fewer of them.
pub(crate) fn less_pressed_blocks(forces_n: impl Iterator<Item = f64>, least_n: f64) -> f64 {
    let (mut upper, mut lower) = (0, 0);
    for force_n in forces_n {
        upper += usize::from(force_n > least_n);
        lower += usize::from(force_n < -least_n);
    }
    upper.min(lower) as f64
}

/// Kind of contact of a block: 0 lower, 1 upper flank, plus 2 if pressed firmly; `None` if a block around it is not in the
/// same contact.
#[inline]
fn touch(around: &[Coupling; BEFORE + 2], firm_n: f64) -> Option<usize> {
    let here_n = around[BEFORE].force_n;
    let is_firm = here_n.abs() > firm_n;
    let least_n = if is_firm { firm_n } else { 0.0 };
    let is_kept = if here_n > 0.0 {
        around.iter().all(|coupling| coupling.force_n > least_n)
    } else {
        around.iter().all(|coupling| coupling.force_n < -least_n)
    };
    is_kept.then_some(2 * usize::from(is_firm) + usize::from(here_n > 0.0))
}

/// Number of successive blocks, up to one with this force, that press one flank firmly: positive for the upper flank,
/// negative for the lower one.
fn pressed_blocks(before: isize, force_n: f64, firm_n: f64) -> isize {
    if force_n > firm_n {
        before.max(0) + 1
    } else if force_n < -firm_n {
        before.min(0) - 1
    } else {
        0
    }
}

pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

impl<const N: usize> DesignRow<N> {
    const ZERO: Self = Self { x: [0.0; N], y_m: 0.0, blocks: 0.0, stretch: 0 };

    #[inline]
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
