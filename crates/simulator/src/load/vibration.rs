//! Vibration: band-limited noise and spectral lines, made at the integrator's step.
#![expect(missing_docs, reason = "docs/simulator.md explains each key")]

use std::f64::consts::TAU;

use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;

use crate::load::shaping_filter::ShapedNoise;
use crate::seeded_streams::seeded_rng;

/// A narrow spectral line, such as a structural mode or a rotor's harmonic.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Line {
    pub frequency_hz: f64,
    pub amplitude: f64,
    pub phase_walk_rad: f64,
}

/// Vibration as noise in a band and lines.
///
/// Of the load, `rms` and `amplitude` are shares of `load_n`; of the motor, metres at the screw.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, SmartDefault)]
#[serde(deny_unknown_fields, default)]
pub struct Vibration {
    #[default(5.0)]
    pub low_hz: f64,
    #[default(60.0)]
    pub high_hz: f64,
    pub rms: f64,
    pub lines: Vec<Line>,
}

impl Vibration {
    /// Noise between two frequencies.
    pub fn band(low_hz: f64, high_hz: f64, rms: f64) -> Self {
        Self { low_hz, high_hz, rms, lines: Vec::new() }
    }
}

/// The state of a vibration: one value each step.
#[derive(Debug)]
pub(crate) struct VibrationSource {
    scale: f64,
    rms: f64,
    noise: Option<ShapedNoise>,
    lines: Vec<(Line, f64)>,
    step_s: f64,
    rng: ChaCha8Rng,
}

impl VibrationSource {
    /// `scale` turns the vibration's unit into the unit of the values.
    pub(crate) fn new(vibration: &Vibration, scale: f64, step_s: f64, seed: u64, name: &str) -> Self {
        let draw = |part: &str| seeded_rng(seed, &["vibration", name, part]);
        let mut rng = draw("lines");
        let live = vibration.lines.iter().copied().filter(|line| line.amplitude > 0.0);
        let lines = live.map(|line| (line, rng.random_range(0.0..TAU))).collect();
        let band = || ShapedNoise::band(vibration.low_hz, vibration.high_hz, step_s, draw("noise"));
        let noise = (vibration.rms > 0.0).then(band);
        Self { scale, rms: vibration.rms, noise, lines, step_s, rng }
    }

    /// The value at the next step; zero without vibration.
    pub(crate) fn next(&mut self) -> f64 {
        let noise = self.noise.as_mut().map_or(0.0, |noise| self.rms * noise.next());
        let (step_s, rng) = (self.step_s, &mut self.rng);
        let line = |(line, phase): &mut (Line, f64)| {
            let value = line.amplitude * phase.sin();
            *phase += TAU * line.frequency_hz * step_s;
            if line.phase_walk_rad > 0.0 {
                let white: f64 = StandardNormal.sample(rng);
                *phase += line.phase_walk_rad * step_s.sqrt() * white;
            }
            value
        };
        self.scale * (noise + self.lines.iter_mut().map(line).sum::<f64>())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values(vibration: &Vibration, seconds: f64, seed: u64) -> Vec<f64> {
        let mut source = VibrationSource::new(vibration, 1.0, 1e-3, seed, "load");
        (0..(seconds * 1e3) as usize).map(|_| source.next()).collect()
    }

    #[test]
    fn vibration_has_the_rms_of_its_noise_and_lines_together() {
        let line = Line { frequency_hz: 17.0, amplitude: 0.4, phase_walk_rad: 0.5 };
        let all = values(&Vibration { rms: 0.3, lines: vec![line], ..Vibration::default() }, 400.0, 1);
        let power = all.iter().map(|v| v * v).sum::<f64>() / all.len() as f64;
        assert!((power / (0.09 + 0.08) - 1.0).abs() < 0.03, "{power}");
    }

    /// A phase that walks: the mean of cos(φ(t) − φ(0)) is `e^(−w² t/2)`, seen in the autocorrelation.
    #[test]
    fn the_phase_of_a_line_walks_as_fast_as_stated() {
        let line = Line { frequency_hz: 20.0, amplitude: 1.0, phase_walk_rad: 1.0 };
        let all = values(&Vibration { lines: vec![line], ..Vibration::default() }, 4000.0, 3);
        let pairs = all.iter().zip(&all[1000..]);
        let measured = 2.0 * pairs.map(|(a, b)| a * b).sum::<f64>() / (all.len() - 1000) as f64;
        assert!((measured - (-0.5_f64).exp()).abs() < 0.05, "{measured}");
    }
}
