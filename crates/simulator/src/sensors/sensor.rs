//! Sensors and recorder: delay, distortion, noise, resolution, and the faults of a bus.
//!
//! Position channels are described in metres at the screw, the load channel in newtons, whatever unit
//! they are logged in later. Hysteresis, lag, averaging and delay act where the plant is sampled; all
//! else acts here.
#![expect(missing_docs, reason = "docs/simulator.md explains each key")]

use std::f64::consts::TAU;

use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;

use crate::load::flight_profile::Profile;
use crate::seeded_streams::seeded_rng;

/// Height of `u − u³` at its peak, which `nonlinearity` is scaled by: `2/(3√3)`.
const CUBIC_PEAK: f64 = 0.384_900_179_459_750_5;

/// An error that repeats with the travel: a pitch error, a gear or a resolver's harmonic.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PeriodicError {
    pub amplitude: f64,
    pub period: f64,
    pub phase_rad: f64,
}

impl PeriodicError {
    fn at(&self, position: f64) -> f64 {
        if self.amplitude == 0.0 {
            return 0.0;
        }
        self.amplitude * (TAU * position / self.period + self.phase_rad).sin()
    }
}

/// The spectrum of a channel's coloured noise.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum NoiseColour {
    /// White noise through a first-order low-pass at `coloured_hz`.
    #[default]
    FirstOrder,
    /// About 1/f between `coloured_hz` and half the sample rate: two low-passes a decade.
    Flicker,
}

/// One channel; every default is zero, a perfect channel. Lengths in the channel's own unit, m or N.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, SmartDefault)]
#[serde(deny_unknown_fields, default)]
pub struct Channel {
    pub noise_rms: f64,
    pub resolution: f64,
    pub gain_error: f64,
    pub bias: f64,
    pub drift: f64,
    pub nonlinearity: f64,
    pub delay_s: f64,
    pub dropout_share: f64,
    pub spikes_per_minute: f64,
    pub spike: f64,
    pub freezes_per_minute: f64,
    pub freeze_s: f64,
    pub hysteresis: f64,
    #[default(1000.0)]
    pub hysteresis_length: f64,
    pub clip: f64,
    pub lag_s: f64,
    pub box_average: bool,
    pub rate_hz: f64,
    pub periodic: Vec<PeriodicError>,
    pub coloured_rms: f64,
    #[default(1.0)]
    pub coloured_hz: f64,
    pub coloured_form: NoiseColour,
}

/// Mean length of a burst of missing samples.
const BURST: f64 = 5.0;

impl Channel {
    /// The rate at which the channel itself is sampled, within a log of the given rate.
    pub(crate) fn own_rate_hz(&self, log_rate_hz: f64) -> f64 {
        if self.rate_hz > 0.0 { self.rate_hz.min(log_rate_hz) } else { log_rate_hz }
    }

    /// How many samples the channel itself takes during a log.
    pub(crate) fn own_samples(&self, profile: &Profile) -> usize {
        let log_rate_hz = profile.sample_rate_hz;
        let rate_hz = self.own_rate_hz(log_rate_hz);
        if rate_hz < log_rate_hz {
            return held_index(profile.samples().max(1) - 1, log_rate_hz, rate_hz) + 1;
        }
        profile.samples()
    }

    /// Turns the truth at the channel's own sample instants into readings at those of the log.
    pub(crate) fn read_log(
        &self,
        mut values: Vec<f64>,
        profile: &Profile,
        seed: u64,
        name: &str,
    ) -> Vec<f64> {
        let rate_hz = self.own_rate_hz(profile.sample_rate_hz);
        let coloured =
            self.coloured(values.len(), rate_hz, &mut seeded_rng(seed, &["sensor", name, "coloured"]));
        let rng = &mut seeded_rng(seed, &["sensor", name]);
        let last = (values.len().max(2) - 1) as f64;
        // The error of a channel whose nonlinearity is one: of a load over `load_n`, of a position over the stroke.
        let nonlinearity = |value: f64| match name {
            "load" => value * value.abs() / (profile.load_n * profile.load_n),
            _ => {
                let u = (value / profile.stroke_m).clamp(-1.0, 1.0);
                (u - u.powi(3)) / CUBIC_PEAK
            }
        };
        for (k, value) in values.iter_mut().enumerate() {
            let bent = self.nonlinearity * nonlinearity(*value)
                + self.periodic.iter().map(|error| error.at(*value)).sum::<f64>()
                + coloured.get(k).copied().unwrap_or(0.0);
            let white: f64 = StandardNormal.sample(rng);
            let level = (*value + bent) * (1.0 + self.gain_error) + self.bias + self.drift * k as f64 / last;
            let most = if self.clip > 0.0 { self.clip } else { f64::INFINITY };
            *value = rounded(level.clamp(-most, most) + self.noise_rms * white, self.resolution);
        }
        self.freeze(&mut values, rate_hz, rng);
        self.spike(&mut values, rate_hz, rng);
        self.drop_out(&mut values, rng);
        if rate_hz < profile.sample_rate_hz {
            let hold = |k| values[held_index(k, profile.sample_rate_hz, rate_hz)];
            return (0..profile.samples()).map(hold).collect();
        }
        values
    }

    /// Coloured noise of unit rms times `coloured_rms`; empty without.
    fn coloured(&self, samples: usize, rate_hz: f64, rng: &mut ChaCha8Rng) -> Vec<f64> {
        if self.coloured_rms == 0.0 {
            return Vec::new();
        }
        let corners: Vec<f64> = match self.coloured_form {
            NoiseColour::FirstOrder => vec![self.coloured_hz],
            NoiseColour::Flicker => {
                let half_decades = (2.0 * (0.5 * rate_hz / self.coloured_hz).log10()).max(0.0) as i32;
                (0..=half_decades).map(|k| self.coloured_hz * 10f64.powf(0.5 * f64::from(k))).collect()
            }
        };
        let rms = self.coloured_rms / (corners.len() as f64).sqrt();
        let mut sum = vec![0.0; samples];
        for corner_hz in corners {
            let pole = (-TAU * corner_hz / rate_hz).exp();
            let mut level: f64 = StandardNormal.sample(rng);
            for value in &mut sum {
                *value += rms * level;
                let white: f64 = StandardNormal.sample(rng);
                level = pole * level + (1.0 - pole * pole).sqrt() * white;
            }
        }
        sum
    }

    fn freeze(&self, values: &mut [f64], rate_hz: f64, rng: &mut ChaCha8Rng) {
        let chance = (self.freezes_per_minute / 60.0 / rate_hz).min(1.0);
        let length = (self.freeze_s * rate_hz) as usize;
        let mut held = None;
        for (k, value) in values.iter_mut().enumerate() {
            if rng.random_bool(chance) {
                held = Some((k + length, *value));
            }
            match held {
                Some((until, repeated)) if k <= until => *value = repeated,
                _ => held = None,
            }
        }
    }

    fn spike(&self, values: &mut [f64], rate_hz: f64, rng: &mut ChaCha8Rng) {
        let chance = (self.spikes_per_minute / 60.0 / rate_hz).min(1.0);
        for value in values {
            if rng.random_bool(chance) {
                *value += if rng.random() { self.spike } else { -self.spike };
            }
        }
    }

    /// A two-state chain: it stays down with probability 1 − 1/burst, and falls as often as the share asks.
    fn drop_out(&self, values: &mut [f64], rng: &mut ChaCha8Rng) {
        let fall = self.dropout_share / (1.0 - self.dropout_share) / BURST;
        let mut down = false;
        for value in values {
            down = rng.random_bool(if down { 1.0 - 1.0 / BURST } else { fall });
            if down {
                *value = f64::NAN;
            }
        }
    }
}

/// The nearest multiple of a step; any value where the step is zero.
fn rounded(value: f64, step: f64) -> f64 {
    if step > 0.0 { (value / step).round() * step } else { value }
}

/// The latest of a slow channel's samples at a sample of the log.
fn held_index(sample: usize, log_rate_hz: f64, rate_hz: f64) -> usize {
    // A billionth of a sample forgives the rounding of commensurate rates.
    (sample as f64 * rate_hz / log_rate_hz + 1e-9) as usize
}

/// The recorder's clock. The samples are even; the stamps need not be.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Clock {
    pub jitter_s: f64,
    pub tick_s: f64,
}

impl Clock {
    /// The stamps of evenly spaced samples; with jitter they may run backwards. The same seed gives every actuator of a
    /// flight the same stamps.
    pub(crate) fn stamps(&self, samples: usize, rate_hz: f64, seed: u64) -> Vec<f64> {
        let mut rng = seeded_rng(seed, &["clock"]);
        let stamp = |k: usize| {
            let white: f64 = StandardNormal.sample(&mut rng);
            rounded(k as f64 / rate_hz + self.jitter_s * white, self.tick_s)
        };
        (0..samples).map(stamp).collect()
    }
}

/// All sensors of one actuator.
///
/// Defaults are good ones: noise of 1 and 3 µm and 40 N, steps of 0.3 and 2.3 µm and 10 N, no fault. A
/// channel that a spec writes down starts from a perfect one instead: every key left out is zero.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, SmartDefault)]
#[serde(deny_unknown_fields, default)]
pub struct Sensors {
    #[default(Channel { noise_rms: 1e-6, resolution: 3e-7, ..Channel::default() })]
    pub motor: Channel,
    #[default(Channel { noise_rms: 3e-6, resolution: 2.3e-6, ..Channel::default() })]
    pub screw: Channel,
    #[default(Channel { noise_rms: 40.0, resolution: 10.0, ..Channel::default() })]
    pub load: Channel,
    pub clock: Clock,
}

impl Sensors {
    /// Sensors that show the truth at the very instant.
    pub fn perfect() -> Self {
        let [motor, screw, load] = std::array::from_fn(|_| Channel::default());
        Self { motor, screw, load, clock: Clock::default() }
    }

    /// τ in `screw_logged(t) = X_screw(t − τ)`, against the motor channel, seconds: delays and lags.
    pub fn skew_s(&self) -> f64 {
        (self.screw.delay_s + self.screw.lag_s) - (self.motor.delay_s + self.motor.lag_s)
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "these values are exact")]
mod tests {
    use super::*;

    fn read(channel: &Channel, value: f64, samples: usize) -> Vec<f64> {
        let profile = Profile { stroke_m: 1.0, sample_rate_hz: 100.0, ..Profile::default() };
        channel.read_log(vec![value; samples], &profile, 3, "screw")
    }

    /// First-order noise: autocorrelation `e^(−2πft)`; flicker: equal power in each decade.
    #[test]
    fn coloured_noise_has_its_rms_and_spectrum() {
        let noise = |coloured_form, coloured_hz, seed| {
            let channel = Channel { coloured_rms: 2.0, coloured_hz, coloured_form, ..Channel::default() };
            channel.coloured(1_000_000, 100.0, &mut seeded_rng(seed, &["coloured"]))
        };
        let mean = |values: &[f64], lag: usize| {
            let pairs = values.iter().zip(&values[lag..]);
            pairs.map(|(a, b)| a * b).sum::<f64>() / (values.len() - lag) as f64
        };
        let first = noise(NoiseColour::FirstOrder, 1.0, 1);
        assert!((mean(&first, 0) / 4.0 - 1.0).abs() < 0.03);
        assert!((mean(&first, 10) / 4.0 - (-TAU * 0.1).exp()).abs() < 0.03);
        // Corners 0.1, 0.32, 1, 3.2, 10 and 32 Hz: the mean of their six autocorrelations.
        let flicker = noise(NoiseColour::Flicker, 0.1, 2);
        let expected = (0..6).map(|k| (-TAU * 0.1 * 10f64.powf(0.5 * f64::from(k)) * 0.1).exp()).sum::<f64>();
        assert!((mean(&flicker, 0) / 4.0 - 1.0).abs() < 0.1);
        assert!((mean(&flicker, 10) / 4.0 - expected / 6.0).abs() < 0.1);
    }

    #[test]
    fn a_slow_channel_is_held_between_its_samples() {
        let profile = Profile { duration_s: 10.0, sample_rate_hz: 100.0, ..Profile::default() };
        let channel = Channel { rate_hz: 40.0, ..Channel::default() };
        let own: Vec<f64> = (0..channel.own_samples(&profile)).map(|k| k as f64).collect();
        assert_eq!(own.len(), 400);
        let held = channel.read_log(own, &profile, 1, "screw");
        assert_eq!(held[..8], [0.0, 0.0, 0.0, 1.0, 1.0, 2.0, 2.0, 2.0]);
        assert_eq!(held.len(), 1000);
    }

    /// Of eleven samples of a value, the error of one: a perfect channel has none; gain, bias and drift add up to the last
    /// sample; a bend peaks at its stated height at 1/√3 of the stroke; a periodic error repeats with the travel.
    #[test]
    fn errors_of_a_channel_follow_their_formulas() {
        let sloped = Channel { gain_error: 0.1, bias: 2.0, drift: 5.0, ..Channel::default() };
        let bent = Channel { nonlinearity: 20e-6, ..Channel::default() };
        let error = PeriodicError { amplitude: 4e-6, period: 5e-3, phase_rad: 0.3 };
        let periodic = Channel { periodic: vec![error], ..Channel::default() };
        let wave = |turns: f64| 4e-6 * (TAU * turns + 0.3).sin();
        for (channel, value, sample, error) in [
            (Channel::default(), 0.123, 10, 0.0),
            (sloped.clone(), 10.0, 0, 3.0),
            (sloped, 10.0, 10, 8.0),
            (bent.clone(), 1.0 / 3f64.sqrt(), 0, 20e-6),
            (bent, 1.0, 0, 0.0),
            (periodic.clone(), 0.0, 0, wave(0.0)),
            (periodic.clone(), 7e-3, 0, wave(0.4)),
            (periodic, 4.5e-3, 0, wave(0.9)),
        ] {
            let found = read(&channel, value, 11)[sample] - value;
            assert!((found - error).abs() <= 1e-15 * value.max(1.0), "{found} for {error} of {channel:?}");
        }
    }

    #[test]
    fn a_load_cell_departs_from_its_line_with_the_square_of_the_load() {
        let profile = Profile { load_n: 8e3, ..Profile::default() };
        let channel = Channel { nonlinearity: 80.0, ..Channel::default() };
        let loads = vec![-8e3, -4e3, 0.0, 4e3, 8e3];
        assert_eq!(
            channel.read_log(loads, &profile, 1, "load")[..5],
            [-8080.0, -4020.0, 0.0, 4020.0, 8080.0]
        );
    }

    #[test]
    fn dropouts_spikes_and_freezes_are_as_frequent_as_asked() {
        let lost = read(&Channel { dropout_share: 0.1, ..Channel::default() }, 1.0, 200_000);
        let share = lost.iter().filter(|v| v.is_nan()).count() as f64 / 200_000.0;
        assert!((share - 0.1).abs() < 0.01, "{share}");
        let wild = read(&Channel { spikes_per_minute: 60.0, spike: 5.0, ..Channel::default() }, 0.0, 200_000);
        let count = wild.iter().filter(|v| v.abs() > 0.0).count() as f64;
        assert!((count / 2000.0 - 1.0).abs() < 0.1, "{count}");
        let noisy = Channel { noise_rms: 1.0, freezes_per_minute: 6.0, freeze_s: 1.0, ..Channel::default() };
        let values = read(&noisy, 0.0, 200_000);
        let repeats = values.windows(2).filter(|pair| pair[0] == pair[1]).count() as f64;
        assert!((repeats / 200_000.0 - 0.1).abs() < 0.03, "{repeats}");
    }

    #[test]
    fn stamps_fall_on_ticks() {
        let clock = Clock { jitter_s: 1e-3, tick_s: 0.02 };
        let stamps = clock.stamps(500, 100.0, 1);
        assert!(stamps.iter().all(|t| (t / 0.02 - (t / 0.02).round()).abs() < 1e-9));
    }
}
