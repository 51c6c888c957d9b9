//! What a channel looks like before anything is estimated: so that a mapping error is seen in seconds.

/// One channel, described.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quality {
    /// Samples, missing ones included.
    pub samples: usize,
    /// Share of samples without a value.
    pub missing_share: f64,
    /// Smallest value.
    pub min: f64,
    /// Largest value.
    pub max: f64,
    /// Smallest step between neighbours that differ: the resolution actually seen.
    pub resolution: Option<f64>,
    /// Longest share of samples, in a row, that repeat one value.
    pub frozen_share: f64,
}

impl Quality {
    /// Describes a channel; missing samples are NaN.
    pub fn of(values: &[f64]) -> Self {
        let present = || values.iter().copied().filter(|v| !v.is_nan());
        let samples = values.len();
        let share = |count: usize| count as f64 / samples.max(1) as f64;
        let min = present().fold(f64::INFINITY, f64::min);
        let max = present().fold(f64::NEG_INFINITY, f64::max);
        Self {
            samples,
            missing_share: share(samples - present().count()),
            min,
            max,
            resolution: resolution(values, ROUNDING * (max - min)),
            frozen_share: share(longest_run(values)),
        }
    }

    /// Whether the channel never moves.
    pub fn is_constant(&self) -> bool {
        self.max <= self.min
    }
}

/// Steps below this share of the range are the rounding of arithmetic, not of a sensor.
const ROUNDING: f64 = 1e-10;

fn resolution(values: &[f64], least: f64) -> Option<f64> {
    let steps = values.windows(2).map(|w| (w[1] - w[0]).abs()).filter(|step| *step > least);
    steps.min_by(f64::total_cmp)
}

#[expect(clippy::float_cmp, reason = "a frozen channel repeats its bits")]
fn longest_run(values: &[f64]) -> usize {
    let (mut longest, mut run) = (usize::from(!values.is_empty()), 1);
    for pair in values.windows(2) {
        run = if pair[0] == pair[1] { run + 1 } else { 1 };
        longest = longest.max(run);
    }
    longest
}

/// Slope of one position on the other, by least squares about their means: 1 when both are mapped
/// right, −1 when a sign is wrong, another number when a ratio is.
///
/// Nothing when the motor does not move.
pub fn slope(motor_m: &[f64], dx_m: &[f64]) -> Option<f64> {
    let pairs = || motor_m.iter().zip(dx_m).filter(|(m, d)| !m.is_nan() && !d.is_nan());
    let count = pairs().count() as f64;
    let (motor_sum, dx_sum) = pairs().fold((0.0, 0.0), |(a, b), (m, d)| (a + m, b + d));
    let (motor_mean, dx_mean) = (motor_sum / count, dx_sum / count);
    let (mut mm, mut md) = (0.0, 0.0);
    for (m, d) in pairs() {
        mm += (m - motor_mean) * (m - motor_mean);
        md += (m - motor_mean) * (d - dx_mean);
    }
    (mm > 0.0).then(|| 1.0 + md / mm)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_channel_is_described_as_a_hand_would() {
        let q = Quality::of(&[1.0, 1.0, 1.0, f64::NAN, 1.5, 1.25, 3.0, 3.0]);
        assert!((q.missing_share - 0.125).abs() < 1e-15);
        assert_eq!((q.min, q.max, q.resolution), (1.0, 3.0, Some(0.25)));
        assert!((q.frozen_share - 3.0 / 8.0).abs() < 1e-15);
        assert!(Quality::of(&[2.0; 9]).is_constant());
    }

    #[test]
    fn a_flipped_sign_and_a_wrong_ratio_show_in_the_slope() {
        let motor: Vec<f64> = (0..100).map(|i| (f64::from(i) * 0.1).sin()).collect();
        for ratio in [1.0, -1.0, 25.4] {
            let dx: Vec<f64> = motor.iter().map(|m| (ratio - 1.0) * m + 0.01).collect();
            assert!((slope(&motor, &dx).unwrap() - ratio).abs() < 1e-12);
        }
        assert_eq!(slope(&[0.0; 5], &[1.0; 5]), None);
    }
}
