//! Turbulence of the Dryden and von Kármán forms: the vertical gust of MIL-F-8785C, at unit variance.
//!
//! With `u = 2πfL/V = f/corner` the spectra are
//!
//! ```text
//! Dryden        Φ(u) ∝ (1 + 3u²) / (1 + u²)²
//! von Kármán    Φ(u) ∝ (1 + 8/3 (1.339u)²) / (1 + (1.339u)²)^(11/6)
//! ```

use std::f64::consts::TAU;

use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::load::shaping_filter::{Section, ShapedNoise};

/// The spectrum of the gust load.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GustForm {
    /// Two equal low-pass filters: the spectrum falls with the fourth power beyond the corner frequency.
    #[default]
    LowPass,
    /// Dryden: the spectrum falls with the second power.
    Dryden,
    /// Von Kármán: the spectrum falls with the power 5/3, by the rational fit of MIL-HDBK-1797.
    VonKarman,
}

impl GustForm {
    /// The turbulence filter, discretised with a step, s; `None` for the low-pass form.
    pub(crate) fn noise(self, corner_hz: f64, step_s: f64, rng: ChaCha8Rng) -> Option<ShapedNoise> {
        let scale_s = (TAU * corner_hz).recip();
        let (numerator, denominator) = match self {
            Self::LowPass => return None,
            Self::Dryden => ([1.0, 3f64.sqrt(), 0.0, 0.0], [1.0, 2.0, 1.0, 0.0]),
            Self::VonKarman => ([1.0, 2.7478, 0.3398, 0.0], [1.0, 2.9958, 1.9754, 0.1539]),
        };
        let scaled = |polynomial: [f64; 4]| {
            std::array::from_fn(|power| polynomial[power] * scale_s.powi(power as i32))
        };
        let section = Section::bilinear(scaled(numerator), scaled(denominator), step_s);
        Some(ShapedNoise::new(vec![section], (40.0 * scale_s / step_s).ceil() as usize, rng))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seeded_streams::seeded_rng;

    fn spectrum(values: &[f64], frequency_hz: f64, step_s: f64) -> f64 {
        let (mut re, mut im) = (0.0, 0.0);
        for (k, value) in values.iter().enumerate() {
            let (sine, cosine) = (TAU * frequency_hz * step_s * k as f64).sin_cos();
            re += value * cosine;
            im += value * sine;
        }
        (re * re + im * im) * step_s / values.len() as f64
    }

    /// The autocorrelation of Dryden's vertical gust is `e^(−t/T) (1 − t/2T)`, with `T = 1/2πf`.
    #[test]
    fn dryden_turbulence_has_its_autocorrelation() {
        let mut noise = GustForm::Dryden.noise(1.0, 0.005, seeded_rng(4, &["gust"])).unwrap();
        let values: Vec<f64> = (0..800_000).map(|_| noise.next()).collect();
        for lag in [0, 8, 32, 64, 128] {
            let pairs = values.iter().zip(&values[lag..]);
            let measured = pairs.map(|(a, b)| a * b).sum::<f64>() / (values.len() - lag) as f64;
            let t = lag as f64 * 0.005 * TAU;
            let expected = (-t).exp() * (1.0 - 0.5 * t);
            assert!((measured - expected).abs() < 0.03, "lag {lag}: {measured} for {expected}");
        }
    }

    /// Averaged periodograms against von Kármán's formula, one-sided at unit variance: `Φ(f) = 2/πf₀ · …/2`.
    #[test]
    fn von_karman_turbulence_has_its_spectrum() {
        let corner_hz = 0.5;
        let mut noise = GustForm::VonKarman.noise(corner_hz, 0.005, seeded_rng(5, &["gust"])).unwrap();
        for frequency_hz in [0.25, 0.5, 1.0, 2.5, 5.0] {
            let mean: f64 = (0..200)
                .map(|_| {
                    let values: Vec<f64> = (0..4000).map(|_| noise.next()).collect();
                    spectrum(&values, frequency_hz, 0.005)
                })
                .sum::<f64>()
                / 200.0;
            let w2 = (1.339 * frequency_hz / corner_hz).powi(2);
            let shape = (1.0 + 8.0 / 3.0 * w2) / (1.0 + w2).powf(11.0 / 6.0);
            // σ² L/(πV) in rad/s, two-sided in Hz: T/1 · shape with T = 1/(2πf₀).
            let expected = shape / (TAU * corner_hz);
            assert!((mean / expected - 1.0).abs() < 0.25, "{frequency_hz} Hz: {mean} for {expected}");
        }
    }
}
