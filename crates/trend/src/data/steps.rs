//! A step that wear cannot make, found by comparing lines on both sides of every flight.

use std::ops::Range;

use crate::data::outliers::WeightedGap;

/// Numbers of estimates on each side of a candidate, from the shortest window to the longest.
const REACHES: [usize; 4] = [15, 30, 60, FARTHEST];
const FARTHEST: usize = 120;

/// Distance between the places that are tested first.
const STRIDE: usize = 3;

/// Fewest estimates on either side.
const MIN_ESTIMATES: usize = 6;

/// Standard errors from which a step is significant.
const BELIEVED: f64 = 6.5;

/// Estimates on each side of the near window, in which a bend of the wear is no step.
const NEAR: usize = 20;

/// Estimates of one side's slope, and on each side of a change of installation.
const SIDE: usize = 60;

/// Standard errors, and share of the step, required in the near window.
const NEAR_BELIEVED: f64 = 3.5;
const NEAR_SHARE: f64 = 0.6;

/// Estimates on each side of a found step among which its place is sought.
const LOCATE: usize = 10;

/// Fewest estimates on either side of a located step.
const LEAST_SIDE: usize = 3;

/// Spread of wear rates about zero in the prior of a slope, shares of the limit per hour.
const RATE_SPREAD: f64 = 5e-4;

/// Variance of the wear per wear between the middles of both sides, a share of the limit: wear comes in
/// spurts, which must not pass for steps.
pub(crate) const WEAR_NOISE: f64 = 0.002;

#[derive(Debug, Clone, Copy)]
pub(crate) struct StepChange {
    /// The first estimate after it.
    pub(crate) at: usize,
    /// Its size and standard error, the wear going on as before.
    pub(crate) step_m: f64,
    pub(crate) se_m: f64,
    /// Its size and standard error where the wear after it has a rate of its own, as after a reset.
    pub(crate) jump_m: f64,
    pub(crate) jump_se_m: f64,
}

/// Places searched at once: far more than a window reaches, so that the search grows with the history's length alone.
const BLOCK: usize = 480;

/// All steps of a history, by place: in each block the largest first, then those on either side of it.
pub(crate) fn detect_steps(estimates: &[WeightedGap], limit_m: f64) -> Vec<StepChange> {
    let sums = PrefixSums::new(estimates, limit_m);
    let mut found: Vec<StepChange> = Vec::new();
    // Ranges between two steps, and the first place of the block in each.
    let mut open = vec![(0..estimates.len(), 0)];
    while let Some((range, from)) = open.pop() {
        let mut to = (from + BLOCK).min(range.end);
        let mut step = sums.largest(&range, from..to);
        // A larger step may follow just after the block.
        while to < range.end && step.is_some_and(|step| step.at + FARTHEST > to) {
            to = (to + BLOCK).min(range.end);
            step = sums.largest(&range, from..to);
        }
        if let Some(step) = step {
            // Places before the block hold no step, unless the new one changes their windows.
            let again = from.saturating_sub(FARTHEST).max(range.start);
            open.extend([(step.at..range.end, step.at), (range.start..step.at, again)]);
            found.push(step);
        } else if to < range.end {
            open.push((range, to));
        }
    }
    found.sort_unstable_by_key(|step| step.at);
    found
}

/// Squared steps at changes of installation, less what their errors explain, and how many there are.
///
/// Half of the mean is the variance of what one installation adds to every gap measured in it.
pub(crate) fn installation_steps(estimates: &[WeightedGap], limit_m: f64) -> (f64, f64) {
    let largest_m = LARGEST_BIAS * limit_m;
    let sums = PrefixSums::new(estimates, limit_m);
    let changes = (MIN_ESTIMATES..estimates.len().saturating_sub(MIN_ESTIMATES))
        .filter(|&i| estimates[i].installation != estimates[i - 1].installation);
    changes.fold((0.0, 0.0), |(squares, count), at| {
        let Offset { step_m, se_m, .. } = sums.offset(&(0..estimates.len()), at, SIDE);
        if step_m.abs() > largest_m || se_m > 0.5 * largest_m {
            return (squares, count);
        }
        (squares + step_m * step_m - se_m * se_m, count + 1.0)
    })
}

/// A step larger than this share of the limit at a change of installation was more than the change.
const LARGEST_BIAS: f64 = 0.08;

/// Weighted sums up to each estimate, from which the line over any range follows.
struct PrefixSums {
    sums: Vec<[f64; 6]>,
    usages: Vec<f64>,
    /// Information of the prior that draws a slope to zero, h²/m².
    slope_information: f64,
    /// Variance of the wear per metre of wear, metres.
    wear_noise_m: f64,
}

/// A place where the lines on both sides, of one slope, are apart.
#[derive(Clone, Copy)]
struct Offset {
    at: usize,
    step_m: f64,
    variance: f64,
    se_m: f64,
    slope: f64,
}

/// Variance, means and centred sums of squares of a range.
struct WindowStats {
    variance: f64,
    x: f64,
    y: f64,
    xx: f64,
    xy: f64,
    yy: f64,
}

impl PrefixSums {
    fn new(estimates: &[WeightedGap], limit_m: f64) -> Self {
        let origin = estimates.first().map_or((0.0, 0.0), |e| (e.usage, e.gap_m));
        let mut sums = Vec::with_capacity(estimates.len() + 1);
        let mut sum = [0.0; 6];
        sums.push(sum);
        for e in estimates {
            let (w, x, y) = (e.weight, e.usage - origin.0, e.gap_m - origin.1);
            for (s, term) in sum.iter_mut().zip([w, w * x, w * y, w * x * x, w * x * y, w * y * y]) {
                *s += term;
            }
            sums.push(sum);
        }
        let slope_information = (RATE_SPREAD * limit_m).powi(-2);
        let usages = estimates.iter().map(|e| e.usage - origin.0).collect();
        Self { sums, usages, slope_information, wear_noise_m: WEAR_NOISE * limit_m }
    }

    fn window_stats(&self, window: Range<usize>) -> WindowStats {
        let (a, b) = (&self.sums[window.start], &self.sums[window.end]);
        let weight = b[0] - a[0];
        let variance = weight.recip();
        let (x, y) = ((b[1] - a[1]) * variance, (b[2] - a[2]) * variance);
        let centred = |i: usize, square: f64| b[i] - a[i] - weight * square;
        WindowStats { variance, x, y, xx: centred(3, x * x), xy: centred(4, x * y), yy: centred(5, y * y) }
    }

    /// The windows of as many estimates before and after a place of a range.
    fn sides(&self, range: &Range<usize>, at: usize, reach: usize) -> [WindowStats; 2] {
        let Range { start, end } = around(range, at, reach);
        [self.window_stats(start..at), self.window_stats(at..end)]
    }

    /// The step at a place of a range, by as many estimates on each side.
    fn offset(&self, range: &Range<usize>, at: usize, reach: usize) -> Offset {
        let [left, right] = self.sides(range, at, reach);
        let slope_variance = (left.xx + right.xx + self.slope_information).recip();
        let slope = (left.xy + right.xy) * slope_variance;
        let apart = right.x - left.x;
        let variance = left.variance + right.variance + apart * apart * slope_variance;
        Offset { at, step_m: right.y - left.y - slope * apart, variance, se_m: variance.sqrt(), slope }
    }

    /// Whether the step is more than the measurement's errors and a spurt of the wear explain.
    fn is_beyond_wear(&self, range: &Range<usize>, step: &Offset) -> bool {
        let [left, right] = self.sides(range, step.at, NEAR);
        let worn_m = (step.slope * (right.x - left.x)).abs();
        step.step_m.powi(2) > BELIEVED * BELIEVED * (step.se_m.powi(2) + self.wear_noise_m * worn_m)
    }

    /// Whether the step is there between the nearest flights too, whichever slope is taken off: the
    /// common one, that of the left or that of the right.
    ///
    /// A bend, as at the onset of wear, makes a far line miss on one side; it does not make neighbours
    /// differ.
    fn is_near(&self, range: &Range<usize>, step: &Offset) -> bool {
        let [left, right] = self.sides(range, step.at, NEAR);
        let se_m = (left.variance + right.variance).sqrt();
        let [before, after] = self.sides(range, step.at, SIDE).map(|side| self.slope(&side, step.slope));
        [step.slope, before, after].into_iter().all(|slope| {
            let step_m = right.y - left.y - slope * (right.x - left.x);
            step_m / step.step_m > NEAR_SHARE && step_m.abs() > NEAR_BELIEVED * se_m
        })
    }

    /// Slope of one side, drawn to another so far as it is uncertain.
    fn slope(&self, side: &WindowStats, other: f64) -> f64 {
        (side.xy + self.slope_information * other) / (side.xx + self.slope_information)
    }

    /// The step with the largest ratio to its standard error, over some places of a range and all window lengths.
    ///
    /// Every third place is tested first, then all places near those with half the required ratio.
    fn largest(&self, range: &Range<usize>, block: Range<usize>) -> Option<StepChange> {
        let ratio = |step: &Offset| (step.step_m / step.se_m).abs();
        let places = block.start.max(range.start + MIN_ESTIMATES)
            ..(range.end + 1).saturating_sub(MIN_ESTIMATES).min(block.end);
        let is_half = |at: usize, reach: usize| {
            let Offset { step_m, variance, .. } = self.offset(range, at, reach);
            step_m * step_m > (0.6 * BELIEVED).powi(2) * variance
        };
        let promising = |&at: &usize| REACHES.into_iter().any(|reach| is_half(at, reach));
        let near: Vec<usize> = places.clone().step_by(STRIDE).filter(promising).collect();
        let mut all: Vec<usize> =
            near.into_iter().flat_map(|at| at.saturating_sub(STRIDE - 1)..at + STRIDE).collect();
        all.dedup();
        all.into_iter()
            .filter(|at| places.contains(at))
            .flat_map(|at| REACHES.map(|reach| (self.offset(range, at, reach), reach)))
            .filter(|(found, _)| self.is_beyond_wear(range, found) && self.is_near(range, found))
            .max_by(|(a, _), (b, _)| ratio(a).total_cmp(&ratio(b)))
            .map(|(step, reach)| self.located(range, step.at, reach))
    }

    /// The step at the place near a found one where two lines leave the smallest squares, and its size there.
    ///
    /// The largest ratio of a step to its error lies up to three flights from where the step happened: next to
    /// it the common slope takes up a part of the step.
    fn located(&self, range: &Range<usize>, found: usize, reach: usize) -> StepChange {
        let near = around(range, found, NEAR);
        let places = found.saturating_sub(LOCATE).max(near.start + LEAST_SIDE)
            ..=(found + LOCATE).min(near.end.saturating_sub(LEAST_SIDE));
        let squares_about_line =
            |WindowStats { xx, xy, yy, .. }: WindowStats| yy - xy * xy / (xx + self.slope_information);
        let squares = |at: usize| {
            let [before, after] = self.sides(&near, at, 2 * NEAR).map(squares_about_line);
            before + after
        };
        let at = places.min_by(|a, b| squares(*a).total_cmp(&squares(*b))).unwrap_or(found);
        let Offset { step_m, se_m, slope: common, .. } = self.offset(range, at, reach);
        // Where the lines of both sides, each with a slope of its own, meet in time: the growth from one flight to the next is
        // no part of the jump.
        let x = self.usages[at - 1].midpoint(self.usages[at]);
        let end = |side: WindowStats| {
            let away = x - side.x;
            let variance = side.variance + away * away / (side.xx + self.slope_information);
            (side.y + away * self.slope(&side, common), variance)
        };
        let [(before_m, before_m2), (after_m, after_m2)] = self.sides(range, at, SIDE).map(end);
        StepChange { at, step_m, se_m, jump_m: after_m - before_m, jump_se_m: (before_m2 + after_m2).sqrt() }
    }
}

/// The part of a range that reaches as far from a place on both sides.
fn around(range: &Range<usize>, at: usize, reach: usize) -> Range<usize> {
    at.saturating_sub(reach).max(range.start)..(at + reach).min(range.end)
}
