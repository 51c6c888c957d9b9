//! From the true course of a quantity to one channel's samples: hysteresis, lag, averaging, delay.

use crate::load::flight_profile::Profile;
use crate::sensors::sensor::Channel;

/// Samples one quantity at even instants minus a delay, by straight lines between steps.
#[derive(Debug)]
pub(crate) struct ChannelSampler {
    samples: Vec<f64>,
    wanted: usize,
    rate_hz: f64,
    step_s: f64,
    channel: Channel,
    /// The hysteretic error of the sensor, within ± `hysteresis`, and the output of its lag.
    error: f64,
    lagged: f64,
    /// What the sensor showed at the end of the last step.
    shown: f64,
    average: Option<BoxAverage>,
}

impl ChannelSampler {
    /// A sampler of a quantity that has rested at its initial value.
    pub(crate) fn new(channel: &Channel, profile: &Profile, step_s: f64, initial: f64) -> Self {
        let rate_hz = channel.own_rate_hz(profile.sample_rate_hz);
        let wanted = channel.own_samples(profile);
        Self {
            samples: Vec::with_capacity(wanted),
            wanted,
            rate_hz,
            step_s,
            channel: channel.clone(),
            error: 0.0,
            lagged: initial,
            shown: initial,
            average: channel.box_average.then(BoxAverage::default),
        }
    }

    pub(crate) fn is_full(&self) -> bool {
        self.samples.len() == self.wanted
    }

    /// The samples at the channel's own rate.
    pub(crate) fn into_samples(self) -> Vec<f64> {
        self.samples
    }

    /// One step of the integrator, in which the quantity goes from one value to the next.
    pub(crate) fn pass(&mut self, from_s: f64, before: f64, after: f64) {
        let (before, after) = if self.channel.hysteresis == 0.0 && self.channel.lag_s == 0.0 {
            (before, after)
        } else {
            let shown = self.shown;
            self.shown = self.follow(before, after);
            (shown, self.shown)
        };
        while !self.is_full() {
            // The first instant of an average ends no period: it opens the first one.
            let is_closed = self.average.as_ref().is_some_and(|average| !average.is_open);
            let instant = self.samples.len() as f64 - f64::from(u8::from(is_closed));
            let part = (instant / self.rate_hz - self.channel.delay_s - from_s) / self.step_s;
            if part > 1.0 {
                break;
            }
            match &mut self.average {
                None => self.samples.push(before + part * (after - before)),
                Some(average) => {
                    if average.is_open {
                        let rest = integral(before, after, average.since, part, self.step_s);
                        self.samples.push((average.integral + rest) * self.rate_hz);
                    }
                    *average = BoxAverage { is_open: true, integral: 0.0, since: part };
                }
            }
        }
        if let Some(average) = &mut self.average {
            average.integral += integral(before, after, average.since, 1.0, self.step_s);
            average.since = 0.0;
        }
    }

    /// What the sensor shows after a step in which its input moves evenly between two values.
    ///
    /// The hysteretic error obeys `de = (H sgn dx − e) |dx|/ℓ`, and the lag `τ y' = x − y`; both are
    /// integrated exactly.
    fn follow(&mut self, before: f64, after: f64) -> f64 {
        let Channel { hysteresis, hysteresis_length, lag_s, .. } = self.channel;
        let mut input = (before, after);
        if hysteresis > 0.0 {
            let (moved, error) = (after - before, self.error);
            let towards = hysteresis.copysign(moved);
            self.error = towards + (error - towards) * (-moved.abs() / hysteresis_length).exp();
            input = (before - error, after - self.error);
        }
        if lag_s == 0.0 {
            return input.1;
        }
        // The input is a ramp: the output trails it by τ times the slope, and forgets its start.
        let trail = (input.1 - input.0) / self.step_s * lag_s;
        let forgotten = (-self.step_s / lag_s).exp();
        self.lagged = input.1 - trail + (self.lagged - input.0 + trail) * forgotten;
        self.lagged
    }
}

/// The mean over one sample period, which ends at the sample instant.
#[derive(Debug, Default)]
struct BoxAverage {
    /// Whether the first period has begun.
    is_open: bool,
    /// The integral since the period began.
    integral: f64,
    /// Where within the present step the period began, 0 to 1.
    since: f64,
}

/// The integral of a straight line over a part of a step.
fn integral(before: f64, after: f64, from: f64, to: f64, step_s: f64) -> f64 {
    (to - from) * step_s * (before + 0.5 * (from + to) * (after - before))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    const STEP_S: f64 = 1e-4;

    /// Samples of a function of time, from two seconds before the log on.
    fn sampled(channel: &Channel, profile: &Profile, of: impl Fn(f64) -> f64) -> Vec<f64> {
        let mut sampler = ChannelSampler::new(channel, profile, STEP_S, of(-2.0));
        let mut k = 0.0;
        while !sampler.is_full() {
            let from_s = k * STEP_S - 2.0;
            sampler.pass(from_s, of(from_s), of(from_s + STEP_S));
            k += 1.0;
        }
        sampler.into_samples()
    }

    fn profile() -> Profile {
        Profile { duration_s: 6.0, sample_rate_hz: 50.0, ..Profile::default() }
    }

    /// A sine through a lag: amplitude `1/√(1 + (ωτ)²)`, phase `−atan ωτ`.
    #[test]
    fn a_lag_turns_and_shrinks_a_sine() {
        let (lag_s, omega) = (0.05, TAU * 3.0);
        let values = sampled(&Channel { lag_s, ..Channel::default() }, &profile(), |t| (omega * t).sin());
        let phase = (omega * lag_s).atan();
        for (k, value) in values.iter().enumerate() {
            let expected = phase.cos() * (omega * k as f64 / 50.0 - phase).sin();
            assert!((value - expected).abs() < 1e-5, "{value} for {expected}");
        }
    }

    /// The mean of a sine over a period T that ends at t: `(cos ω(t−T) − cos ωt)/ωT`.
    #[test]
    fn a_box_average_is_the_mean_over_the_sample_period() {
        let omega = TAU * 7.3;
        let channel = Channel { box_average: true, delay_s: 0.003_37, ..Channel::default() };
        for (k, value) in sampled(&channel, &profile(), |t| (omega * t).sin()).iter().enumerate() {
            let end = k as f64 / 50.0 - 0.003_37;
            let expected = ((omega * (end - 0.02)).cos() - (omega * end).cos()) / (omega * 0.02);
            // Straight lines between steps leave (ωh)²/12 = 2e-6.
            assert!((value - expected).abs() < 5e-6, "{value} for {expected}");
        }
    }

    /// Cycled far beyond its length, the error is `H (1 − 2 e^(−Δ/ℓ))` after a turn and a travel Δ; the
    /// loop is twice that wide, 2H in the end.
    #[test]
    fn a_hysteresis_loop_is_as_wide_as_stated() {
        let channel = Channel { hysteresis: 40.0, hysteresis_length: 1000.0, ..Channel::default() };
        let triangle = |t: f64| 8000.0 * ((t + 2.0).rem_euclid(2.0) - 1.0).abs();
        let values = sampled(&channel, &profile(), triangle);
        // Falls from 8000 at t = 0 to 0 at t = 1, then rises again.
        let error = |k: usize| triangle(k as f64 / 50.0) - values[k];
        let (falling, rising) = (error(25), error(75));
        let width = 80.0 * (1.0 - 2.0 * (-4.0_f64).exp());
        assert!((rising - falling - width).abs() < 1e-2, "{}", rising - falling);
        let turned = error(55) - 40.0 * (1.0 - 2.0 * (-0.8_f64).exp());
        assert!(turned.abs() < 0.5, "{turned}");
    }

    #[test]
    fn a_slow_channel_is_sampled_at_its_own_rate() {
        let channel = Channel { rate_hz: 20.0, ..Channel::default() };
        let values = sampled(&channel, &profile(), |t| t);
        assert!((values[7] - 0.35).abs() < 1e-9);
        assert_eq!(values.len(), 120);
    }
}
