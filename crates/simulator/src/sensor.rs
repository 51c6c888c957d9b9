//! What the recorder makes of the truth: delay, distortion, noise, resolution, and the faults of a bus.
//!
//! Position channels are described in metres at the screw, the load channel in newtons, whatever unit
//! they are logged in later. Delay acts where the plant is sampled; all else acts here.

use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

use crate::error::{Error, finite, not_negative, within};
use crate::random::stream;

/// Height of `u − u³` at its peak, which `nonlinearity` is scaled by: `2/(3√3)`.
const CUBIC_PEAK: f64 = 0.384_900_179_459_750_5;

/// One channel; every default is zero, a perfect channel. Lengths in the channel's own unit, m or N.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Channel {
    /// White noise, rms.
    pub noise_rms: f64,
    /// The least step the channel can tell.
    pub resolution: f64,
    /// Reading over truth, minus one.
    pub gain_error: f64,
    /// A constant added.
    pub bias: f64,
    /// Added in proportion to time, this much by the end of the flight.
    pub drift: f64,
    /// Peak of an S-shaped error over the stroke, zero at its middle and ends; positions only.
    pub nonlinearity: f64,
    /// The reading shows the truth of so long ago, seconds, −0.5 to 0.5; any part of a sample.
    pub delay_s: f64,
    /// Share of samples missing (NaN), in bursts of about five.
    pub dropout_share: f64,
    /// Single wild samples per minute.
    pub spikes_per_minute: f64,
    /// Height of a wild sample, either way.
    pub spike: f64,
    /// How often per minute the channel repeats itself for a while.
    pub freezes_per_minute: f64,
    /// For how long, seconds.
    pub freeze_s: f64,
}

/// Mean length of a burst of missing samples.
const BURST: f64 = 5.0;

impl Channel {
    pub(crate) fn check(&self, key: &str) -> Result<(), Error> {
        let named = |name: &str| format!("sensors.{key}.{name}");
        not_negative(&named("noise_rms"), self.noise_rms)?;
        not_negative(&named("resolution"), self.resolution)?;
        within(&named("gain_error"), self.gain_error, -0.5, 0.5, "between -0.5 and 0.5")?;
        finite(&named("bias"), self.bias)?;
        finite(&named("drift"), self.drift)?;
        finite(&named("nonlinearity"), self.nonlinearity)?;
        within(&named("delay_s"), self.delay_s, -0.5, 0.5, "between -0.5 and 0.5 s")?;
        within(&named("dropout_share"), self.dropout_share, 0.0, 0.5, "between 0 and 0.5")?;
        not_negative(&named("spikes_per_minute"), self.spikes_per_minute)?;
        finite(&named("spike"), self.spike)?;
        not_negative(&named("freezes_per_minute"), self.freezes_per_minute)?;
        not_negative(&named("freeze_s"), self.freeze_s)
    }

    /// Turns the truth at the sample instants into readings.
    pub(crate) fn read(
        &self,
        mut values: Vec<f64>,
        rate_hz: f64,
        stroke_m: f64,
        rng: &mut ChaCha8Rng,
    ) -> Vec<f64> {
        let last = (values.len().max(2) - 1) as f64;
        for (k, value) in values.iter_mut().enumerate() {
            let u = (*value / stroke_m).clamp(-1.0, 1.0);
            let bent = self.nonlinearity * (u - u.powi(3)) / CUBIC_PEAK;
            let white: f64 = StandardNormal.sample(rng);
            let level = (*value + bent) * (1.0 + self.gain_error) + self.bias + self.drift * k as f64 / last;
            *value = self.rounded(level + self.noise_rms * white);
        }
        self.freeze(&mut values, rate_hz, rng);
        self.spike(&mut values, rate_hz, rng);
        self.drop_out(&mut values, rng);
        values
    }

    fn rounded(&self, value: f64) -> f64 {
        if self.resolution > 0.0 { (value / self.resolution).round() * self.resolution } else { value }
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

/// The recorder's clock. The samples are even; the stamps need not be.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Clock {
    /// White error of each stamp, rms, seconds. Default 0.
    pub jitter_s: f64,
    /// Stamps are multiples of this, seconds; 0 for full resolution. Default 0.
    pub tick_s: f64,
}

impl Clock {
    /// The stamps of evenly spaced samples; with jitter they may run backwards.
    pub(crate) fn stamps(&self, samples: usize, rate_hz: f64, rng: &mut ChaCha8Rng) -> Vec<f64> {
        let stamp = |k: usize| {
            let white: f64 = StandardNormal.sample(rng);
            let time_s = k as f64 / rate_hz + self.jitter_s * white;
            if self.tick_s > 0.0 { (time_s / self.tick_s).round() * self.tick_s } else { time_s }
        };
        (0..samples).map(stamp).collect()
    }
}

/// All sensors of one actuator.
///
/// Defaults are good ones: noise of 1 and 3 µm and 40 N, steps of 0.3 and 2.3 µm and 10 N, no fault. A
/// channel that a spec writes down starts from a perfect one instead: what it does not say is zero.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Sensors {
    /// The motor's resolver, in metres at the screw.
    pub motor: Channel,
    /// The screw's position transducer, metres.
    pub screw: Channel,
    /// The load cell, N.
    pub load: Channel,
    /// The time stamps.
    pub clock: Clock,
}

impl Default for Sensors {
    fn default() -> Self {
        let channel = |noise_rms, resolution| Channel { noise_rms, resolution, ..Channel::default() };
        Self {
            motor: channel(1e-6, 3e-7),
            screw: channel(3e-6, 2.3e-6),
            load: channel(40.0, 10.0),
            clock: Clock::default(),
        }
    }
}

impl Sensors {
    /// Sensors that show the truth at the very instant.
    pub fn perfect() -> Self {
        let channel = Channel::default();
        Self { motor: channel, screw: channel, load: channel, clock: Clock::default() }
    }

    /// τ in `screw_logged(t) = X_screw(t − τ)`, against the motor channel, seconds.
    pub fn skew_s(&self) -> f64 {
        self.screw.delay_s - self.motor.delay_s
    }

    /// Says whether these can be simulated.
    ///
    /// # Errors
    /// [`Error::Value`] for the first parameter outside its range.
    pub fn check(&self) -> Result<(), Error> {
        self.motor.check("motor")?;
        self.screw.check("screw")?;
        self.load.check("load")?;
        not_negative("sensors.clock.jitter_s", self.clock.jitter_s)?;
        not_negative("sensors.clock.tick_s", self.clock.tick_s)
    }

    /// The stamps of a log; the same seed gives every actuator of a flight the same clock.
    pub(crate) fn stamps(&self, samples: usize, rate_hz: f64, seed: u64) -> Vec<f64> {
        self.clock.stamps(samples, rate_hz, &mut stream(seed, &["clock"]))
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "these values are exact")]
mod tests {
    use super::*;

    fn read(channel: Channel, value: f64, samples: usize) -> Vec<f64> {
        channel.read(vec![value; samples], 100.0, 1.0, &mut stream(3, &["sensor"]))
    }

    #[test]
    fn a_perfect_channel_shows_the_truth() {
        assert_eq!(read(Channel::default(), 0.123, 50), vec![0.123; 50]);
    }

    #[test]
    fn gain_bias_and_drift_add_up_to_the_last_sample() {
        let channel = Channel { gain_error: 0.1, bias: 2.0, drift: 5.0, ..Channel::default() };
        let values = read(channel, 10.0, 11);
        assert!((values[0] - 13.0).abs() < 1e-12 && (values[10] - 18.0).abs() < 1e-12);
    }

    #[test]
    fn nonlinearity_peaks_at_its_stated_height() {
        let channel = Channel { nonlinearity: 20e-6, ..Channel::default() };
        let at = |u: f64| read(channel, u, 1)[0] - u;
        assert!((at(1.0 / 3f64.sqrt()) - 20e-6).abs() < 1e-12 && at(1.0).abs() < 1e-15);
    }

    #[test]
    fn dropouts_spikes_and_freezes_are_as_frequent_as_asked() {
        let lost = read(Channel { dropout_share: 0.1, ..Channel::default() }, 1.0, 200_000);
        let share = lost.iter().filter(|v| v.is_nan()).count() as f64 / 200_000.0;
        assert!((share - 0.1).abs() < 0.01, "{share}");
        let wild = read(Channel { spikes_per_minute: 60.0, spike: 5.0, ..Channel::default() }, 0.0, 200_000);
        let count = wild.iter().filter(|v| v.abs() > 0.0).count() as f64;
        assert!((count / 2000.0 - 1.0).abs() < 0.1, "{count}");
        let noisy = Channel { noise_rms: 1.0, freezes_per_minute: 6.0, freeze_s: 1.0, ..Channel::default() };
        let values = read(noisy, 0.0, 200_000);
        let repeats = values.windows(2).filter(|pair| pair[0] == pair[1]).count() as f64;
        assert!((repeats / 200_000.0 - 0.1).abs() < 0.03, "{repeats}");
    }

    #[test]
    fn stamps_fall_on_ticks() {
        let clock = Clock { jitter_s: 1e-3, tick_s: 0.02 };
        let stamps = clock.stamps(500, 100.0, &mut stream(1, &["clock"]));
        assert!(stamps.iter().all(|t| (t / 0.02 - (t / 0.02).round()).abs() < 1e-9));
    }
}
