//! A flight in blocks of 12 ms, or of 4 ms under a vibrating load: means of complete samples without spikes.

use std::ops::Range;

use crate::Samples;
use crate::contact::codes::Rejection;
use crate::contact::friction::friction_model::{Coupling, Drive, FrictionState};
use crate::contact::stats::{LOOKS, median, middle_and_half, second_differences};
use crate::contact::types::PartPrior;
use crate::gap::load_band::{quantiles, reversals};

/// Length of a block, s: short against vibration of the load, which would mix both flanks in one mean.
const PERIOD_S: f64 = 0.004;
/// Length of a block, s, where the load hardly vibrates.
const CALM_PERIOD_S: f64 = 0.012;
/// Half of the time over which the speed of the motor is averaged, s.
const SPEED_S: f64 = 0.03;
/// Reading of the load cell at the middle of δX, over the 95 % load, from which its zero may be far off.
const FAR_ZERO: f64 = 0.08;
/// Number of blocks in each window of an excerpt.
const WINDOW_BLOCKS: usize = 500;
/// Minimum time of sound blocks, s: a flight with less is rejected.
pub(crate) const SHORTEST_S: f64 = 9.0;
/// Length of the windows that standstill is looked for in, s: so much of it before and after each motion counts.
const STILL_S: f64 = 2.0;
/// Shares of the stroke seen and of the load's range below which a window is standstill.
const STILL: (f64, f64) = (0.02, 0.1);

/// Means over blocks; NaN where fewer than half of a block's samples are sound.
#[derive(Debug, Default)]
pub(crate) struct BlockMeans {
    /// Length of a block, s.
    pub(crate) period_s: f64,
    /// One over the length of two blocks, 1/s.
    pub(crate) per_two_s: f64,
    /// Whether the load hardly vibrates, so that longer blocks mix no flanks.
    is_calm: bool,
    /// Whether standstill was left out.
    is_without_standstill: bool,
    /// The blocks of each segment.
    pub(crate) segments: Vec<Range<usize>>,
    /// Middle of each block, s from the first sample of the log.
    pub(crate) time_s: Vec<f64>,
    /// X₁, m.
    pub(crate) motor_m: Vec<f64>,
    /// δX, m: as logged, then with the screw's channel brought to the motor's clock.
    pub(crate) dx_m: Vec<f64>,
    /// F, N: as logged, then brought to the motor's clock.
    pub(crate) load_n: Vec<f64>,
    /// Loads that are not clipped at an end of the load cell's range, N: blocks with other loads give no row.
    pub(crate) in_range_n: Range<f64>,
    /// e^−(v/v_s)²: how near the motor is to rest.
    pub(crate) slowness: Vec<f64>,
    /// X₂ as it was logged, m.
    screw_m: Vec<f64>,
    /// F as it was logged, N.
    pub(crate) logged_n: Vec<f64>,
    /// Sine and cosine of the screw's position within the period of its errors; empty where no period is configured.
    pub(crate) phases: Vec<[f64; 2]>,
    /// The coupling at each block, once it is integrated.
    pub(crate) couplings: Vec<Coupling>,
}

impl BlockMeans {
    /// Replaces the blocks by those of a flight, in the same memory, without standstill unless it is wanted.
    ///
    /// # Errors
    /// [`Rejection::ChannelConstant`], [`Rejection::TooShort`].
    pub(crate) fn gather(
        &mut self,
        samples: &Samples<'_>,
        prior: &PartPrior,
        with_standstill: bool,
    ) -> Result<(), Rejection> {
        self.take_means(samples)?;
        let moving = if with_standstill { None } else { self.moving_segments(samples) };
        self.is_without_standstill = moving.is_some();
        if let Some(moving) = moving {
            self.take_means(&Samples { segments: &moving, ..*samples })?;
        }
        self.screw_m.extend(self.motor_m.iter().zip(&self.dx_m).map(|(x, dx)| x + dx));
        self.logged_n.extend_from_slice(&self.load_n);
        self.find_slowness();
        self.in_range_n = -self.clipped_above_n(-1.0)..self.clipped_above_n(1.0);
        let (motor_m, screw_m) = (middle_and_half(&self.motor_m).1, middle_and_half(&self.screw_m).1);
        // A dead sensor, or that of a locked surface, repeats one value; a billionth of the motor's travel is rounding.
        if !prior.output_locked && (0.0..=1e-9 * motor_m).contains(&screw_m) {
            return Err(Rejection::ChannelConstant);
        }
        let sound = self.dx_m.iter().filter(|y| y.is_finite()).count();
        if (sound as f64) * self.period_s < SHORTEST_S { Err(Rejection::TooShort) } else { Ok(()) }
    }

    /// Fills the channels from the samples of all segments.
    fn take_means(&mut self, samples: &Samples<'_>) -> Result<(), Rejection> {
        let shortest = ((PERIOD_S / samples.step_s).round() as usize).max(1);
        let is_calm = is_calm(samples, shortest);
        let count = (CALM_PERIOD_S / (shortest as f64 * samples.step_s)).ceil() as usize;
        let each = if is_calm { shortest * count } else { shortest };
        // Where the load vibrates, a mean would mix both flanks: the first sample of a block stands for it.
        let taken = if is_calm { each } else { 1 };
        longest_step(samples.motor_m, samples.segments)?;
        let steps =
            [longest_step(samples.dx_m, samples.segments)?, longest_step(samples.load_n, samples.segments)?];
        self.clear(samples.dx_m.len() / each, each as f64 * samples.step_s);
        for segment in samples.segments {
            let first = self.len();
            let middle_s = |start: usize| (start as f64 + 0.5 * (taken as f64 - 1.0)) * samples.step_s;
            let end = segment.start + segment.len() / each * each;
            for start in (segment.start..end).step_by(each) {
                self.time_s.push(middle_s(start));
                let [motor_m, dx_m, load_n] = mean(samples, start..start + taken, steps);
                self.motor_m.push(motor_m);
                self.dx_m.push(dx_m);
                self.load_n.push(load_n);
            }
            self.segments.push(first..self.len());
        }
        self.is_calm = is_calm;
        Ok(())
    }

    /// The samples near motion, where standstill fills more than half of a log and enough remains. Standstill shows nothing of
    /// the gap, but would set the load's scale and the scatter that is usual.
    fn moving_segments(&self, samples: &Samples<'_>) -> Option<Vec<Range<usize>>> {
        let least = [(&self.motor_m, STILL.0), (&self.load_n, STILL.1)];
        let least = least.map(|(values, share)| (values, share * middle_and_half(values).1));
        let moves = |window: &Range<usize>| {
            least.iter().any(|(values, least)| middle_and_half(&values[window.clone()]).1 > *least)
        };
        let in_window = (STILL_S / self.period_s).ceil() as usize;
        let in_block = (self.period_s / samples.step_s).round() as usize;
        let mut moving: Vec<Range<usize>> = Vec::new();
        for (segment, of_samples) in self.segments.iter().zip(samples.segments) {
            let starts = segment.clone().step_by(in_window);
            let windows: Vec<_> = starts.map(|start| start..(start + in_window).min(segment.end)).collect();
            let moves: Vec<bool> = windows.iter().map(moves).collect();
            let is_near = |k: usize| moves[k.saturating_sub(1)..moves.len().min(k + 2)].contains(&true);
            let sample = |block: usize| of_samples.start + (block - segment.start) * in_block;
            for (_, window) in windows.iter().enumerate().filter(|(k, _)| is_near(*k)) {
                let window = sample(window.start)..sample(window.end);
                match moving
                    .last_mut()
                    .filter(|last| last.end == window.start && last.start >= of_samples.start)
                {
                    Some(last) => last.end = window.end,
                    None => moving.push(window),
                }
            }
        }
        let blocks = moving.iter().map(Range::len).sum::<usize>() / in_block;
        (2 * blocks < self.len() && blocks as f64 * self.period_s > SHORTEST_S).then_some(moving)
    }

    /// Removes all blocks, and reserves memory for new ones.
    fn clear(&mut self, blocks: usize, period_s: f64) {
        let Self { segments, time_s, motor_m, screw_m, dx_m, load_n, slowness, logged_n, .. } = self;
        for column in [time_s, motor_m, screw_m, dx_m, load_n, slowness, logged_n] {
            column.clear();
            column.reserve(blocks);
        }
        segments.clear();
        self.phases.clear();
        (self.period_s, self.per_two_s) = (period_s, (2.0 * period_s).recip());
    }

    /// The load of one side beyond which the load cell is clipped, N; infinite if it is not.
    ///
    /// Large loads are rare. At the end of a cell's range they pile up instead: near the 99.8 % quantile, in a band of 3 %
    /// of it.
    fn clipped_above_n(&self, side: f64) -> f64 {
        // Means of several blocks, as noise would spread a pile.
        let count = (CALM_PERIOD_S / self.period_s).ceil() as usize;
        let sided_n: Vec<f64> =
            self.load_n.chunks(count).map(|loads_n| side * mean_of_sound(loads_n)).collect();
        let all = 0..sided_n.len();
        let Some([top_n]) = quantiles(&sided_n, std::slice::from_ref(&all), [0.998]) else {
            return f64::INFINITY;
        };
        let width_n = 0.03 * top_n;
        let between = |low_n: f64, high_n: f64| {
            sided_n.iter().filter(|load_n| (low_n..high_n).contains(*load_n)).count() as f64
        };
        let pile = between(top_n - width_n, f64::INFINITY);
        let below = between(top_n - 3.0 * width_n, top_n - width_n);
        // `pile / below` is 0.5 for evenly spread loads and 1.35 for a sine; a pile lasts for a second or more.
        let is_pile = pile > 2.0 * below && pile * count as f64 * self.period_s > 1.0;
        if is_pile { top_n - width_n } else { f64::INFINITY }
    }

    /// Whether standstill was left out that may be needed: of a flight whose only reversals are small, rejected for `why`.
    pub(crate) fn needs_standstill(&self, why: Rejection) -> bool {
        self.is_without_standstill && matches!(why, Rejection::NoLoadReversal | Rejection::OneSideBrief)
    }

    /// Whether loads pile up at the largest value of a side.
    pub(crate) fn is_clipped(&self) -> bool {
        self.in_range_n.start.is_finite() || self.in_range_n.end.is_finite()
    }

    /// Load at which δX passes the middle between its 5 % and 95 % quantiles, N, if far from zero: a candidate for the load zero.
    /// Mean of the medians of rising and falling passes, which friction and delays shift in opposite directions.
    pub(crate) fn far_zero_n(&self, load_n: f64) -> Option<f64> {
        let all = 0..self.len();
        let [low_m, high_m] = quantiles(&self.dx_m, std::slice::from_ref(&all), [0.05, 0.95])?;
        let is_above = |k: usize| self.dx_m[k] > 0.5 * (low_m + high_m);
        let of_way = |is_rising: bool| {
            let passes =
                (1..self.len()).filter(|&k| is_above(k) == is_rising && is_above(k - 1) != is_rising);
            let readings_n = passes.map(|k| 0.5 * (self.load_n[k - 1] + self.load_n[k]));
            let mut readings_n: Vec<f64> = readings_n.filter(|n| n.is_finite()).collect();
            (!readings_n.is_empty()).then(|| median(&mut readings_n))
        };
        let zero_n = 0.5 * (of_way(true)? + of_way(false)?);
        (zero_n.abs() > FAR_ZERO * load_n).then_some(zero_n)
    }

    /// What drives the coupling at a block.
    #[inline(always)]
    #[allow(clippy::inline_always, reason = "compiled within each version of its caller")]
    pub(crate) fn drive(&self, k: usize) -> Drive {
        Drive { motor_m: self.motor_m[k], load_n: self.load_n[k], slowness: self.slowness[k] }
    }

    pub(crate) fn len(&self) -> usize {
        self.time_s.len()
    }

    /// The number of the stretch of 2 s that contains a block: residuals within it are taken as dependent.
    pub(crate) fn stretch(&self, k: usize) -> u32 {
        (self.time_s[k] / 2.0) as u32
    }

    /// Whether a block and its neighbours miss no value, and its load is in range. The first second is left out: offsets
    /// settle, and logs start in motion.
    #[inline]
    pub(crate) fn is_complete(&self, k: usize) -> bool {
        let change = |values: &[f64]| Some(values.get(k + 1)? - values.get(k.wrapping_sub(1))?);
        let changes = change(&self.motor_m).zip(change(&self.load_n));
        changes.is_some_and(|(motor_m, load_n)| (self.dx_m[k] + motor_m + load_n).is_finite())
            && self.time_s[k] > 1.0
            && self.in_range_n.contains(&self.load_n[k])
    }

    /// Whether the flight is much longer than an excerpt of `blocks` blocks.
    pub(crate) fn is_longer(&self, blocks: usize) -> bool {
        self.len() >= blocks * 3 / 2
    }

    /// Fills the blocks from an excerpt of a flight: windows of `most` blocks in total, or all of a flight that is hardly
    /// longer. Where the load hardly vibrates, blocks are joined to longer ones. δX and the load follow when [delays are
    /// applied](Self::apply_delays).
    pub(crate) fn excerpt_of(&mut self, whole: &Self, load_n: f64, most: usize) {
        let count =
            if whole.is_calm { ((2.0 * CALM_PERIOD_S / whole.period_s).round() as usize).max(1) } else { 1 };
        self.clear(most.min(whole.len()), whole.period_s * count as f64);
        self.in_range_n = whole.in_range_n.clone();
        let windows = if whole.is_longer(most) {
            whole.windows(load_n, most / WINDOW_BLOCKS)
        } else {
            whole.segments.clone()
        };
        for window in windows {
            let first = self.len();
            for (taken, column) in [
                (&mut self.time_s, &whole.time_s),
                (&mut self.motor_m, &whole.motor_m),
                (&mut self.screw_m, &whole.screw_m),
                (&mut self.slowness, &whole.slowness),
                (&mut self.logged_n, &whole.logged_n),
            ] {
                taken.extend(column[window.clone()].chunks_exact(count).map(mean_of_sound));
            }
            self.segments.push(first..self.len());
        }
    }

    /// The windows of an excerpt in order of time: one half by the number of load reversals in them, which pass 15 % of the
    /// 95 % load on either side, the other evenly among the rest. The load alone selects, so that what is estimated does
    /// not select its own data.
    fn windows(&self, load_n: f64, count: usize) -> Vec<Range<usize>> {
        let of_segment = |segment: &Range<usize>| {
            let starts = segment.clone().step_by(WINDOW_BLOCKS).take(segment.len() / WINDOW_BLOCKS);
            starts.map(|from| from..from + WINDOW_BLOCKS)
        };
        let mut chosen: Vec<Range<usize>> = self.segments.iter().flat_map(of_segment).collect();
        chosen.sort_by_cached_key(|window| {
            std::cmp::Reverse(reversals(&self.logged_n[window.clone()], 0.15 * load_n))
        });
        let mut rest = chosen.split_off(chosen.len().min(count / 2));
        rest.sort_unstable_by_key(|window| window.start);
        let stride = rest.len().div_ceil((count - chosen.len()).max(1)).max(1);
        chosen.extend(rest.into_iter().step_by(stride));
        chosen.sort_unstable_by_key(|window| window.start);
        chosen
    }

    /// Speed of the motor by the difference over [`SPEED_S`] on either side, m/s; NaN at the ends and near gaps.
    pub(crate) fn speed_m_per_s(&self, at: usize) -> f64 {
        let reach = ((SPEED_S / self.period_s).round() as usize).max(1);
        let Some(from) = at.checked_sub(reach) else { return f64::NAN };
        let to_m = self.motor_m.get(at + reach).copied().unwrap_or(f64::NAN);
        (to_m - self.motor_m[from]) / (2.0 * reach as f64 * self.period_s)
    }

    /// Reads the screw's channel and the load a delay later, by a cubic through four blocks (Catmull–Rom), so that all
    /// three channels belong to one moment.
    pub(crate) fn apply_delays(&mut self, state: &FrictionState) {
        for (logged, delay_s, read) in [
            (&self.screw_m, state.skew_s, &mut self.dx_m),
            (&self.logged_n, state.load_delay_s, &mut self.load_n),
        ] {
            read.resize(logged.len(), f64::NAN);
            // Nothing is read across the end of a segment.
            for segment in &self.segments {
                read_later(&logged[segment.clone()], delay_s / self.period_s, &mut read[segment.clone()]);
            }
        }
        self.dx_m.iter_mut().zip(&self.motor_m).for_each(|(dx, x)| *dx -= x);
    }

    /// Sine and cosine of the screw's position times `per_period`, which is 2π over the period, 1/m; none if it is zero.
    pub(crate) fn find_phases(&mut self, per_period: f64) {
        if per_period > 0.0 {
            self.phases.extend(self.screw_m.iter().map(|m| <[f64; 2]>::from((m * per_period).sin_cos())));
        }
    }

    /// e^−(v/v_s)² of every block with v_s = 3 mm/s, at which most of the excess friction of rest is gone; 0 where the
    /// speed is not known.
    fn find_slowness(&mut self) {
        let slowness = |k| {
            let square = (self.speed_m_per_s(k) / 3e-3).powi(2);
            // One over the series of the exponential up to the fourth power: off by 0.02 at most, and faster.
            let series = 1.0 + square * (1.0 + square * (0.5 + square * (1.0 / 6.0 + square / 24.0)));
            if square.is_finite() { series.recip() } else { 0.0 }
        };
        self.slowness = (0..self.len()).map(slowness).collect();
    }
}

/// Whether the load hardly vibrates: the rms of the second difference of its sums over `summed` samples is less than 5 %
/// of their rms.
fn is_calm(samples: &Samples<'_>, summed: usize) -> bool {
    let sums = samples.segments.iter().flat_map(|segment| {
        let parts = samples.load_n[segment.clone()].chunks_exact(summed);
        // No difference reaches across the end of a segment.
        parts.map(|part| part.iter().sum::<f64>()).chain([f64::NAN])
    });
    let [differences, loads, _] = second_differences(sums);
    differences < 0.05 * 0.05 * loads
}

/// Reads a channel `shift` blocks later; NaN outside the flight.
fn read_later(logged: &[f64], shift: f64, read: &mut [f64]) {
    let u = shift - shift.floor();
    let (square, cube) = (u * u, u * u * u);
    // Weights of four blocks for a point between the middle two.
    let [a, b, c, d] = [
        0.5 * (2.0 * square - cube - u),
        0.5 * (3.0 * cube - 5.0 * square + 2.0),
        0.5 * (4.0 * square - 3.0 * cube + u),
        0.5 * (cube - square),
    ];
    let (from, len) = ((shift.floor() as isize).saturating_sub(1), logged.len());
    // The points whose four blocks lie within the flight.
    let begin = len.min(from.saturating_neg().max(0) as usize);
    let end = len.saturating_sub(from.saturating_add(3).max(0) as usize).max(begin);
    read[..begin].fill(f64::NAN);
    read[end..].fill(f64::NAN);
    let first = begin.wrapping_add_signed(from);
    for (read, four) in
        read[begin..end].iter_mut().zip(logged.get(first..).unwrap_or(&[]).array_windows::<4>())
    {
        *read = a * four[0] + b * four[1] + c * four[2] + d * four[3];
    }
}

/// Mean of the finite values; NaN where they are fewer than half.
fn mean_of_sound(values: &[f64]) -> f64 {
    let (sum, count) =
        values.iter().filter(|v| v.is_finite()).fold((0.0, 0_usize), |(s, n), v| (s + v, n + 1));
    if 2 * count < values.len() { f64::NAN } else { sum / count as f64 }
}

/// Means of motor, δX and load over the complete samples of a block. Samples at which δX or the load has a spike, larger
/// than its `steps`, are left out; NaN if fewer than half remain.
fn mean(samples: &Samples<'_>, block: Range<usize>, steps: [f64; 2]) -> [f64; 3] {
    let Samples { motor_m, dx_m, load_n, .. } = *samples;
    let (mut sums, mut sound, least) = ([0.0; 3], 0.0, 0.5 * block.len() as f64);
    let before = block.start.saturating_sub(1);
    let (mut last_y, mut last_f) = (dx_m[before], load_n[before]);
    let positions = motor_m[block.clone()].iter().zip(&dx_m[block.clone()]);
    for (i, ((&x, &y), &f)) in block.clone().zip(positions.zip(&load_n[block])) {
        let leaps = (y - last_y).abs() > steps[0] || (f - last_f).abs() > steps[1];
        let is_wild = leaps && (is_spike(dx_m, i, steps[0]) || is_spike(load_n, i, steps[1]));
        if (x + y + f).is_finite() && !is_wild {
            sums = [sums[0] + x, sums[1] + y, sums[2] + f];
            sound += 1.0;
        }
        (last_y, last_f) = (y, f);
    }
    sums.map(|sum| if sound >= least { sum / sound } else { f64::NAN })
}

/// Whether a sample leaps by more than `longest`, and the next one leaps back: a new level is no spike.
fn is_spike(channel: &[f64], i: usize, longest: f64) -> bool {
    let from = channel[i] - channel[i.saturating_sub(1)];
    let back = || channel[i] - channel.get(i + 1).unwrap_or(&f64::NAN);
    from.abs() > longest && back() * from.signum() > longest
}

/// The longest step between samples of a channel that is no spike, in the channel's unit: eight times the 90 % quantile
/// of the nonzero steps within segments.
///
/// # Errors
/// [`Rejection::ChannelConstant`] for a channel that never moves.
fn longest_step(values: &[f64], segments: &[Range<usize>]) -> Result<f64, Rejection> {
    let steps = |stride: usize| -> Vec<f64> {
        let pairs = segments.iter().flat_map(|segment| values[segment.clone()].windows(2).step_by(stride));
        pairs.map(|pair| (pair[1] - pair[0]).abs()).filter(|step| *step > 0.0).collect()
    };
    let stride = (segments.iter().map(Range::len).sum::<usize>() / LOOKS).max(1);
    let looked_at = steps(stride);
    // A channel that holds its values may step only in the pairs that the subsample skips.
    let mut steps = if looked_at.is_empty() { steps(1) } else { looked_at };
    if steps.is_empty() {
        return Err(Rejection::ChannelConstant);
    }
    let at = steps.len() * 9 / 10;
    Ok(8.0 * *steps.select_nth_unstable_by(at, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use std::ops::Range;

    use super::is_spike;

    fn longest_step(values: &[f64], segment: Range<usize>) -> Option<f64> {
        super::longest_step(values, std::slice::from_ref(&segment)).ok()
    }

    /// By hand: away and back to either side; a new level is no spike, since a screw crosses its gap within a sample.
    #[test]
    fn a_spike_leaps_away_and_back() {
        let channel = [0.0, 0.0, 9.0, 0.0, -9.0, 0.0, 9.0, 9.0, 0.0, f64::NAN, 9.0, 9.0];
        let found: Vec<usize> = (0..channel.len()).filter(|&i| is_spike(&channel, i, 1.0)).collect();
        assert_eq!(found, [2, 4]);
    }

    /// The load is held for ten rows, and the subsample takes every forty-fifth pair of rows: in none does the load step.
    #[test]
    fn a_channel_that_is_held_moves() {
        let held: Vec<f64> = (0..180_000).map(|k| (f64::from(k / 10) * 0.01).sin()).collect();
        assert!(longest_step(&held, 0..held.len()).is_some_and(|step| (0.07..0.09).contains(&step)));
        assert!(longest_step(&vec![3.0; 50_000], 0..50_000).is_none());
    }

    /// A short segment of a long log is looked at as often as a log that consists of the segment.
    #[test]
    fn looks_fall_within_what_counts() {
        let wave: Vec<f64> = (0..9000).map(|k| (f64::from(k) * 0.01).sin()).collect();
        let mut long = vec![f64::NAN; 3_000_000];
        let counts = 1_234_567..1_234_567 + wave.len();
        long[counts.clone()].copy_from_slice(&wave);
        assert_eq!(longest_step(&long, counts), longest_step(&wave, 0..wave.len()));
    }
}
