//! What a channel looks like before anything is estimated: so that a mapping error is seen in seconds, and
//! a sensor that lies is not believed.

use std::ops::Range;

use multiversion::multiversion;

use crate::channel::noise_floor::white_noise_of;
use crate::channel::stats::{ChannelStats, StatsAccumulator, range};
use crate::mapping::Role;
use crate::time::zero_order_hold::median_sample_interval;

/// One channel, described.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quality {
    /// Samples that count, missing ones included.
    pub samples: usize,
    /// Share of samples without a value.
    pub missing_share: f64,
    /// Smallest value.
    pub min: f64,
    /// Largest value.
    pub max: f64,
    /// Smallest step between neighbours that differ: the resolution actually seen.
    pub resolution: Option<f64>,
    /// Most samples in a row that repeat one value.
    pub longest_run: usize,
    /// Their share of all samples.
    pub frozen_share: f64,
    /// How often a value comes, Hz: the rate actually seen.
    pub rate_hz: f64,
    /// Share of samples at the smallest or largest value, as if clipped there.
    pub saturated_share: f64,
    /// Single samples far from the line of their neighbours.
    pub spikes: usize,
}

impl Quality {
    /// Describes a channel, by its statistics where they exist already; missing samples are NaN, and `excluded` of them were
    /// left out by a filter.
    pub(crate) fn of(
        values: &[f64],
        segments: &[Range<usize>],
        seen: Option<ChannelStats>,
        step_s: f64,
        excluded: usize,
    ) -> Self {
        let seen = &seen.unwrap_or_else(|| StatsAccumulator::default().end(values));
        let (samples, missing) = (values.len() - excluded, seen.missing - excluded);
        let share = |count: usize| count as f64 / samples.max(1) as f64;
        let resolution = resolution(values, seen);
        let longest_run = seen.longest_run.min(samples - missing);
        Self {
            samples,
            missing_share: share(missing),
            min: seen.min,
            max: seen.max,
            resolution,
            longest_run,
            frozen_share: share(longest_run),
            rate_hz: (step_s * if missing == 0 { 1 } else { median_sample_interval(values) } as f64).recip(),
            saturated_share: share(saturated(values, seen)),
            spikes: spikes(values, segments, resolution, seen.max_second_difference, step_s),
        }
    }

    /// Smallest and largest value; none where there is no value at all.
    pub fn span(&self) -> Option<(f64, f64)> {
        (self.min <= self.max).then_some((self.min, self.max))
    }

    /// Whether the channel never moves.
    pub fn is_constant(&self) -> bool {
        self.max <= self.min
    }

    /// Whether every value is zero.
    pub fn is_zero(&self) -> bool {
        self.is_constant() && self.max == 0.0
    }
}

/// Steps below this share of the range are the rounding of arithmetic, not of a sensor.
const ROUNDING: f64 = 1e-10;

fn resolution(values: &[f64], seen: &ChannelStats) -> Option<f64> {
    let least = ROUNDING * (seen.max - seen.min);
    if seen.min_step > least {
        return seen.min_step.is_finite().then_some(seen.min_step);
    }
    let steps = values.windows(2).map(|w| (w[1] - w[0]).abs()).filter(|step| *step > least);
    steps.min_by(f64::total_cmp)
}

/// Stretches of `least` samples or more that repeat one value while another position travels further than `travel_m` and
/// than a share of its range; a channel that never changes has none.
#[expect(clippy::float_cmp, reason = "a frozen channel repeats its bits")]
fn still_runs(
    values: &[f64],
    partner_m: &[f64],
    least: usize,
    travel_m: f64,
    share: f64,
) -> impl Iterator<Item = Range<usize>> {
    let travel_m = travel_m.max(share * range(partner_m));
    let mut end = 0;
    values.chunk_by(|a, b| a == b).filter_map(move |run| {
        let start = end;
        end += run.len();
        let is_part = run.len() >= least && run.len() < values.len();
        (is_part && range(&partner_m[start..end]) > travel_m).then_some(start..end)
    })
}

/// Samples at a rail: the channel comes to its smallest or largest value at full speed, stays there, and
/// leaves it at full speed, more than once. A position that comes to rest slows down first.
#[expect(clippy::float_cmp, reason = "a rail repeats its bits")]
fn saturated(values: &[f64], seen: &ChannelStats) -> usize {
    const LEAST_RUN: usize = 5;
    let &ChannelStats { min, max, longest_run, .. } = seen;
    if longest_run < LEAST_RUN {
        return 0;
    }
    let (mut at_rails, mut from) = (Vec::new(), 0);
    // Few samples are at a rail: only there a run is followed to its end.
    while let Some(after) = values[from..].iter().position(|v| *v == min || *v == max) {
        let start = from + after;
        from = start + values[start..].iter().take_while(|v| **v == values[start]).count();
        if from - start >= LEAST_RUN {
            at_rails.push(start..from);
        }
    }
    if at_rails.is_empty() {
        return 0;
    }
    // Half the mean of the steps that are steps at all.
    let steps = values.windows(2).map(|w| (w[1] - w[0]).abs()).filter(|step| *step > 0.0);
    let (sum, steps) = steps.fold((0.0, 0_usize), |(sum, n), step| (sum + step, n + 1));
    let speed = 0.5 * (sum / steps.max(1) as f64);
    let mut count = [0, 0];
    let mut samples = 0;
    for run in at_rails {
        let at = values[run.start];
        // Two samples away, since the step that reaches the limit is shortened.
        let before = run.start.checked_sub(2).map(|i| values[i]);
        let (Some(before), Some(after)) = (before, values.get(run.end + 1)) else { continue };
        if (before - at).abs() >= speed && (after - at).abs() >= speed {
            count[usize::from(at == max)] += 1;
            samples += run.len();
        }
    }
    if count.iter().any(|c| *c > 1) { samples } else { 0 }
}

/// Single samples far from the line of their neighbours.
///
/// The fourth difference over 6 is an outlier's height; smooth motion hardly shows in it. An outlier gives −4/6, 1,
/// −4/6 in three neighbouring differences; a step of the position or of its speed does not. The height must exceed six
/// standard deviations of the channel's noise, nine times the impacts that recur every few seconds, and twice what its
/// surroundings show.
fn spikes(
    values: &[f64],
    segments: &[Range<usize>],
    resolution: Option<f64>,
    max_second_difference: f64,
    step_s: f64,
) -> usize {
    const FAR: f64 = 6.0;
    const IMPACTS: f64 = 9.0;
    const LOCAL_SHARE: f64 = 0.45;
    const SHAPE_TOLERANCE: f64 = 0.3;
    const REACH: usize = 12;
    /// Impacts recur where at least twenty are higher than some height, and one in every six seconds.
    const EVERY_S: f64 = 6.0;
    const FEWEST_IMPACTS: usize = 20;
    /// For the uncertainty of the noise itself.
    const NOISE_MARGIN: f64 = 1.05;
    /// Enough for a threshold: the noise is known to about 3 %.
    const NOISE_SAMPLES: usize = 1 << 14;
    let step = resolution.unwrap_or(0.0);
    if max_second_difference <= 4.0 * step || values.len() < 7 {
        return 0;
    }
    let noise = white_noise_of(values, resolution, NOISE_SAMPLES)
        .map_or(0.0, |noise| noise.rms)
        .hypot(step / 12.0_f64.sqrt());
    let far = (FAR * DIFFERENCE_NOISE * noise).max(4.0 * step);
    if max_second_difference <= far {
        return 0;
    }
    // A window across a break in time shows the break.
    let inner: Vec<Range<usize>> =
        segments.iter().map(|s| s.start + 3..s.end.saturating_sub(3)).filter(|s| !s.is_empty()).collect();
    let places = inner.iter().map(Range::len).sum::<usize>();
    let rank = ((places as f64 * step_s / EVERY_S) as usize).max(FEWEST_IMPACTS);
    // Two-sided tail of the normal distribution, to within 3 % for these ranks.
    let deviate = (2.0 * (places as f64 / rank as f64).ln()).sqrt() - 0.35;
    let explained = NOISE_MARGIN * deviate.max(0.0) * DIFFERENCE_NOISE * noise;
    // The height that recurring impacts must exceed to raise the threshold.
    let least = (far / IMPACTS).hypot(explained).min(far);
    let (high, recurring) = highest(values, &inner, least, rank);
    let impact = (recurring * recurring - explained * explained).max(0.0).sqrt();
    let far = far.max(IMPACTS * impact);
    let height = |i: usize| height(values, i);
    let is_outlier = |i: usize| {
        let at = height(i);
        let (before, after) = (height(i - 1) / at, height(i + 1) / at);
        let fits = |share: f64| (share + 4.0 / 6.0).abs() < SHAPE_TOLERANCE;
        let mut around = (i.saturating_sub(REACH).max(2)..(i + REACH + 1).min(values.len() - 2))
            .filter(|j| j.abs_diff(i) > 2)
            .map(|j| height(j).abs());
        fits(before)
            && fits(after)
            && (before - after).abs() < SHAPE_TOLERANCE
            && !around.any(|other| other >= LOCAL_SHARE * at.abs())
    };
    high.iter().filter(|(at, i)| *at > far && is_outlier(*i)).count()
}

/// Standard deviation of the fourth difference over 6, for white noise of 1: √70/6.
const DIFFERENCE_NOISE: f64 = 1.394;

/// The fourth difference over 6 about a sample.
fn height(values: &[f64], i: usize) -> f64 {
    fourth_difference(&std::array::from_fn(|k| values[i + k - 2])) / 6.0
}

#[inline]
fn fourth_difference([a, b, c, d, e]: &[f64; 5]) -> f64 {
    a - 4.0 * b + 6.0 * c - 4.0 * d + e
}

/// Heights above `least` and their places, at most the `rank` + 1 highest where more than `rank` lie there. With them the
/// height that `rank` places exceed, zero where no more than `rank` lie above `least`.
fn highest(values: &[f64], places: &[Range<usize>], mut least: f64, rank: usize) -> (Vec<(f64, usize)>, f64) {
    const BLOCK: usize = 64;
    let mut found = Vec::new();
    for block in places.iter().flat_map(|s| s.clone().step_by(BLOCK).map(|k| k..s.end.min(k + BLOCK))) {
        if is_higher(&values[block.start - 2..block.end + 2], least) {
            let heights = block.map(|i| (height(values, i).abs(), i));
            found.extend(heights.filter(|(at, _)| *at > least));
        }
        // Kept short, however many of a long log are high.
        if found.len() > 2 * rank + BLOCK {
            least = keep_highest(&mut found, rank);
        }
    }
    let recurring = if found.len() > rank { keep_highest(&mut found, rank) } else { 0.0 };
    (found, recurring)
}

/// Keeps the `rank` highest and the next one, whose height it returns.
fn keep_highest(found: &mut Vec<(f64, usize)>, rank: usize) -> f64 {
    let level = found.select_nth_unstable_by(rank, |a, b| b.0.total_cmp(&a.0)).1.0;
    found.truncate(rank + 1);
    level
}

/// Whether the fourth difference over 6 exceeds a height at any but the two first and last values.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq", "x86_64+avx2"))]
fn is_higher(values: &[f64], height: f64) -> bool {
    let least = 6.0 * height;
    values.array_windows().fold(false, |is, window| is | (fourth_difference(window).abs() > least))
}

/// Quality flags of the motor, screw and load channels: stable codes.
pub(crate) fn quality_flags(channels: &[Quality; 3], step_s: f64) -> Vec<String> {
    const SATURATED: f64 = 0.002;
    const MISSING: f64 = 0.2;
    let mut found = Vec::new();
    for (quality, role) in channels.iter().zip(Role::NEEDED) {
        let slow_load = role == Role::Load && quality.rate_hz * step_s < 0.75;
        let said = [
            (quality.missing_share > MISSING && !slow_load, "missing"),
            (quality.saturated_share > SATURATED, "saturated"),
            (quality.spikes > 0, "spikes"),
        ];
        found.extend(said.iter().filter(|(is, _)| *is).map(|(_, what)| format!("{}_{what}", role.as_str())));
    }
    found
}

/// Positions whose resolution is coarse: the smallest step exceeds a twentieth of the range of the relative
/// position in the flight.
pub(crate) fn coarse_resolution(channels: &[Quality; 3], travel_m: f64) -> Vec<String> {
    const LARGEST_SHARE: f64 = 0.05;
    let most_m = LARGEST_SHARE * travel_m;
    let positions = channels.iter().zip(Role::NEEDED).take(2);
    let is_coarse = |q: &Quality| q.resolution.is_some_and(|step_m| step_m > most_m);
    positions.filter(|(q, _)| is_coarse(q)).map(|(_, role)| format!("{}_coarse", role.as_str())).collect()
}

/// Samples of a frozen position are no measurement: where one repeats its last value for half a second while the other
/// travels a millimetre and a twentieth of its range, it is marked as missing. Returns the codes of those that froze; no
/// value of either is repeated for longer than `longest_run` samples. A channel that never moves is rejected elsewhere.
pub(crate) fn drop_frozen_samples(
    motor_m: &mut [f64],
    screw_m: &mut [f64],
    longest_run: usize,
    step_s: f64,
) -> Vec<String> {
    const LEAST_S: f64 = 0.5;
    const LEAST_TRAVEL_M: f64 = 1e-3;
    const LEAST_SHARE: f64 = 0.05;
    let least = ((LEAST_S / step_s).ceil() as usize).max(3);
    if longest_run < least {
        return Vec::new();
    }
    let still = |values: &[f64], partner_m: &[f64]| -> Vec<Range<usize>> {
        still_runs(values, partner_m, least, LEAST_TRAVEL_M, LEAST_SHARE).collect()
    };
    let still = [still(motor_m, screw_m), still(screw_m, motor_m)];
    let mut found = Vec::new();
    for ((spans, values), role) in still.iter().zip([motor_m, screw_m]).zip([Role::Motor, Role::Screw]) {
        // The first of the repeated values was measured.
        spans.iter().for_each(|span| values[span.start + 1..span.end].fill(f64::NAN));
        if !spans.is_empty() {
            found.push(format!("{}_frozen", role.as_str()));
        }
    }
    found
}

/// Whether the load was constant for ten seconds in which the actuator moved a fifth of its range.
pub(crate) fn load_frozen(
    load_n: &[f64],
    motor_m: &[f64],
    longest_run: usize,
    step_s: f64,
) -> Option<String> {
    const LEAST_S: f64 = 10.0;
    const LEAST_SHARE: f64 = 0.2;
    let least = ((LEAST_S / step_s).ceil() as usize).max(2);
    if longest_run < least {
        return None;
    }
    let mut frozen = still_runs(load_n, motor_m, least, 0.0, LEAST_SHARE);
    frozen.next().map(|_| format!("{}_frozen", Role::Load.as_str()))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_channel_is_described_as_a_hand_would() {
        let q = described(&[1.0, 1.0, 1.0, f64::NAN, 1.5, 1.25, 3.0, 3.0], 0.01, 0);
        assert!((q.missing_share - 0.125).abs() < 1e-15);
        assert_eq!((q.min, q.max, q.resolution), (1.0, 3.0, Some(0.25)));
        assert!((q.frozen_share - 3.0 / 8.0).abs() < 1e-15);
        assert!(described(&[2.0; 9], 0.01, 0).is_constant());
    }

    /// Steps of 20 µm under a relative motion of 100 µm.
    #[test]
    fn a_position_in_steps_as_large_as_a_gap_is_coarse() {
        let stepped: Vec<f64> = wave(0.03).iter().map(|v| (v / 2e-5).round() * 2e-5).collect();
        let channels = [&wave(0.03), &stepped, &wave(8e3)].map(|values| described(values, 0.004, 0));
        assert_eq!(coarse_resolution(&channels, range(&wave(5e-5))), ["screw_coarse"]);
        assert!(coarse_resolution(&channels, range(&wave(5e-4))).is_empty());
    }

    proptest! {
        /// Against a list of all heights in order.
        #[test]
        fn the_highest_are_those_of_the_whole_order(
            values in proptest::collection::vec(prop_oneof![9 => -9.0..9.0, 1 => Just(f64::NAN)], 8..2000),
            middle in 0.0..1.0, least in 0.0..30.0, rank in 1_usize..40,
        ) {
            let middle = 2 + (middle * (values.len() - 4) as f64) as usize;
            let places = [2..middle, middle..values.len() - 2];
            let all = places.iter().cloned().flatten().map(|i| height(&values, i).abs());
            let mut all: Vec<f64> = all.filter(|at| *at > least).collect();
            all.sort_by(|a, b| b.total_cmp(a));
            let (found, recurring) = highest(&values, &places, least, rank);
            let mut found: Vec<f64> = found.into_iter().map(|(at, _)| at).collect();
            found.sort_by(|a, b| b.total_cmp(a));
            prop_assert_eq!(recurring.to_bits(), all.get(rank).copied().unwrap_or(0.0).to_bits());
            prop_assert_eq!(found, all[..all.len().min(rank + 1)].to_vec());
        }
    }

    fn described(values: &[f64], step_s: f64, excluded: usize) -> Quality {
        Quality::of(values, std::slice::from_ref(&(0..values.len())), None, step_s, excluded)
    }

    fn wave(amplitude: f64) -> Vec<f64> {
        (0..4000)
            .map(|k| amplitude * (f64::from(k) * 0.01).sin() + 1e-8 * f64::from(k * 7919 % 101))
            .collect()
    }

    #[test]
    fn a_clipped_channel_is_distinguished_from_a_resting_one() {
        let cut: Vec<f64> = wave(1.0).iter().map(|v| v.clamp(-0.8, 0.8)).collect();
        let whole = described(&wave(1.0), 0.01, 0);
        assert!(described(&cut, 0.01, 0).saturated_share > 0.2);
        assert!(whole.saturated_share == 0.0 && whole.spikes == 0, "{whole:?}");
    }

    /// A motor that is constant for 1 s while the screw moves is a dead sensor. While the screw moves
    /// within the gap, it is the gap.
    #[test]
    fn a_frozen_position_is_no_measurement() {
        let (mut motor, mut screw) = (wave(0.03), wave(0.03));
        let last = motor[999];
        motor[1000..1250].fill(last);
        let before = motor.clone();
        assert_eq!(drop_frozen_samples(&mut motor, &mut screw, 251, 0.004), ["motor_frozen"]);
        assert!(
            motor[1000..1250].iter().all(|m| m.is_nan())
                && motor[999].to_bits() == last.to_bits()
                && motor[1250].to_bits() == before[1250].to_bits()
        );
        let mut resting = vec![0.01; 4000];
        let mut within: Vec<f64> = wave(2e-4);
        resting[0] = 0.0;
        assert!(drop_frozen_samples(&mut resting, &mut within, 3999, 0.004).is_empty());
    }
}
