//! Digital filters that give white noise a spectrum.

use std::f64::consts::TAU;

use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Quality factors of the two sections of a fourth-order Butterworth filter.
const BUTTERWORTH_Q: [f64; 2] = [0.541_196_100_146_197, 1.306_562_964_876_376_5];

/// One section of a recursive filter, of third order at most, in transposed direct form II.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Section {
    b: [f64; 4],
    a: [f64; 4],
    memory: [f64; 3],
}

impl Section {
    /// The bilinear transform `s = 2/T (1 − z⁻¹)/(1 + z⁻¹)` of a rational transfer function.
    ///
    /// Numerator and denominator are polynomials in `s`, lowest power first.
    pub(crate) fn bilinear(numerator: [f64; 4], denominator: [f64; 4], step_s: f64) -> Self {
        let (b, a) = (in_delays(numerator, 2.0 / step_s), in_delays(denominator, 2.0 / step_s));
        Self { b: b.map(|v| v / a[0]), a: a.map(|v| v / a[0]), memory: [0.0; 3] }
    }

    /// One second-order section of a Butterworth low-pass or high-pass, with its corner kept in place.
    fn butterworth(corner_hz: f64, q: f64, is_high_pass: bool, step_s: f64) -> Self {
        let (sine, cosine) = (TAU * corner_hz * step_s).sin_cos();
        let alpha = sine / (2.0 * q);
        let sign = if is_high_pass { -1.0 } else { 1.0 };
        let side = 0.5 * (1.0 - sign * cosine) / (1.0 + alpha);
        Self {
            b: [side, 2.0 * sign * side, side, 0.0],
            a: [1.0, -2.0 * cosine / (1.0 + alpha), (1.0 - alpha) / (1.0 + alpha), 0.0],
            memory: [0.0; 3],
        }
    }

    fn pass(&mut self, input: f64) -> f64 {
        let output = self.b[0] * input + self.memory[0];
        for k in 0..3 {
            let next = if k < 2 { self.memory[k + 1] } else { 0.0 };
            self.memory[k] = next + self.b[k + 1] * input - self.a[k + 1] * output;
        }
        output
    }
}

/// A polynomial in `s` as one in `z⁻¹`, multiplied by `(1 + z⁻¹)³`.
fn in_delays(polynomial: [f64; 4], two_over_step: f64) -> [f64; 4] {
    // (1 − z⁻¹)^n (1 + z⁻¹)^(3 − n), lowest power of z⁻¹ first.
    const PRODUCTS: [[f64; 4]; 4] =
        [[1.0, 3.0, 3.0, 1.0], [1.0, 1.0, -1.0, -1.0], [1.0, -1.0, -1.0, 1.0], [1.0, -3.0, 3.0, -1.0]];
    let mut delays = [0.0; 4];
    for (power, (weight, product)) in polynomial.iter().zip(PRODUCTS).enumerate() {
        let weight = weight * two_over_step.powi(power as i32);
        delays.iter_mut().zip(product).for_each(|(sum, term)| *sum += weight * term);
    }
    delays
}

/// White noise through a chain of sections, scaled to unit variance.
#[derive(Debug, Clone)]
pub(crate) struct ShapedNoise {
    sections: Vec<Section>,
    scale: f64,
    rng: ChaCha8Rng,
}

impl ShapedNoise {
    /// Noise of unit variance that is stationary from its first value on.
    ///
    /// `settle_steps` is the number of steps after which the impulse response has died out. The
    /// variance is the sum of the squared impulse response, so the scale is exact.
    pub(crate) fn new(sections: Vec<Section>, settle_steps: usize, rng: ChaCha8Rng) -> Self {
        let mut noise = Self { sections, scale: 1.0, rng };
        let mut variance = noise.filter(1.0).powi(2);
        for _ in 0..settle_steps {
            variance += noise.filter(0.0).powi(2);
        }
        noise.scale = variance.sqrt().recip();
        noise.sections.iter_mut().for_each(|section| section.memory = [0.0; 3]);
        for _ in 0..settle_steps {
            noise.next();
        }
        noise
    }

    /// Noise between two frequencies: Butterworth of fourth order at either edge.
    pub(crate) fn band(low_hz: f64, high_hz: f64, step_s: f64, rng: ChaCha8Rng) -> Self {
        let section = |corner_hz, is_high_pass| {
            BUTTERWORTH_Q.map(|q| Section::butterworth(corner_hz, q, is_high_pass, step_s))
        };
        let sections = section(low_hz, true).into_iter().chain(section(high_hz, false)).collect();
        // The slowest pole of the high-pass decays with 0.38·2πf; twelve of its time constants.
        Self::new(sections, (5.0 / (low_hz * step_s)).ceil() as usize, rng)
    }

    pub(crate) fn next(&mut self) -> f64 {
        let white: f64 = StandardNormal.sample(&mut self.rng);
        self.scale * self.filter(white)
    }

    fn filter(&mut self, input: f64) -> f64 {
        self.sections.iter_mut().fold(input, |value, section| section.pass(value))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seeded_streams::seeded_rng;

    /// Amplitude of the filtered sine, by correlation over whole periods.
    fn gain(noise: &mut ShapedNoise, frequency_hz: f64, step_s: f64) -> f64 {
        let period = (1.0 / (frequency_hz * step_s)).round() as usize;
        let omega = TAU / period as f64;
        for k in 0..200 * period {
            noise.filter((omega * k as f64).sin());
        }
        let (mut sine, mut cosine) = (0.0, 0.0);
        for k in 0..50 * period {
            let phase = omega * k as f64;
            let value = noise.filter(phase.sin());
            sine += value * phase.sin();
            cosine += value * phase.cos();
        }
        f64::hypot(sine, cosine) / (25.0 * period as f64)
    }

    /// Butterworth of fourth order: |H|² = 1/(1 + (f/f_c)^8), and its mirror image.
    #[test]
    fn the_edges_of_a_band_are_butterworth() {
        for frequency_hz in [2.5, 5.0, 20.0, 50.0, 100.0] {
            let mut noise = ShapedNoise::band(5.0, 50.0, 1e-3, seeded_rng(1, &["band"]));
            let high = 1.0 / (1.0 + (5.0_f64 / frequency_hz).powi(8));
            // The bilinear transform maps f to tan(π f T).
            let tan = |f: f64| (std::f64::consts::PI * f * 1e-3).tan();
            let low = 1.0 / (1.0 + (tan(frequency_hz) / tan(50.0)).powi(8));
            let measured = gain(&mut noise, frequency_hz, 1e-3);
            assert!((measured / (high * low).sqrt() - 1.0).abs() < 2e-2, "{frequency_hz} Hz: {measured}");
        }
    }

    #[test]
    fn shaped_noise_has_unit_variance_from_its_first_value() {
        let first: f64 = (0..4000)
            .map(|seed| ShapedNoise::band(20.0, 60.0, 2e-3, seeded_rng(seed, &["unit"])).next().powi(2))
            .sum();
        assert!((first / 4000.0 - 1.0).abs() < 0.07, "{first}");
        let mut noise = ShapedNoise::band(5.0, 60.0, 1e-3, seeded_rng(2, &["unit"]));
        let power: f64 = (0..400_000).map(|_| noise.next().powi(2)).sum();
        assert!((power / 4e5 - 1.0).abs() < 0.03, "{power}");
    }
}
