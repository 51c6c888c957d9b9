//! Mean normalised innovation squared, with its standard error from blocks.

use crate::error::Error;

/// Bounds of the samples of a block, an eighth of the flight: means of shorter neighbouring blocks are correlated.
const SHORTEST_BLOCK: usize = 512;
const LONGEST_BLOCK: usize = 2048;
/// Fewer blocks give no standard error.
const MIN_BLOCKS: usize = 8;

/// How well the model explained a flight's measurements.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Nis {
    /// Mean normalised innovation squared (NIS, e²/(C P Cᵀ + V_d), Bar-Shalom, Li and Kirubarajan 2001, section 5.4) over
    /// the measured samples; 1 for a true model.
    pub mean: f64,
    /// Standard error of the mean, from the scatter of blocks of hundreds of samples, which are hardly correlated (ratio
    /// estimator, Cochran 1977, section 6.3); none below eight blocks.
    pub standard_error: Option<f64>,
    /// Number of measured samples.
    pub measured: usize,
}

/// Sums over the blocks of a flight: of q, the sum of a block's normalised squares, and of n, its number of samples.
#[derive(Debug, Clone, Copy)]
pub(crate) struct NisBlocks {
    /// Samples of a full block.
    full: usize,
    blocks: f64,
    sum_q: f64,
    measured: usize,
    q_q: f64,
    q_n: f64,
    n_n: f64,
    /// q and n of the block that is not full.
    open: (f64, usize),
}

impl NisBlocks {
    /// Empty blocks for a flight of `samples` samples.
    pub(crate) fn new(samples: usize) -> Self {
        let full = (samples / MIN_BLOCKS).clamp(SHORTEST_BLOCK, LONGEST_BLOCK);
        Self { full, blocks: 0.0, sum_q: 0.0, measured: 0, q_q: 0.0, q_n: 0.0, n_n: 0.0, open: (0.0, 0) }
    }

    /// Adds one innovation, m, with its variance, m²; a missing innovation (NaN) is skipped.
    #[inline]
    pub(crate) fn add_sample(&mut self, innovation_m: f64, variance_m2: f64) {
        if !innovation_m.is_nan() {
            self.open.0 += innovation_m * innovation_m / variance_m2;
            self.open.1 += 1;
            if self.open.1 == self.full {
                self.close();
            }
        }
    }

    fn close(&mut self) {
        let (q, samples) = std::mem::take(&mut self.open);
        if samples > 0 {
            let n = samples as f64;
            self.blocks += 1.0;
            self.sum_q += q;
            self.measured += samples;
            self.q_q += q * q;
            self.q_n += q * n;
            self.n_n += n * n;
        }
    }

    /// The mean of all samples, with its standard error: √(B/(B−1) Σ(q − mean·n)²) / Σn.
    ///
    /// # Errors
    /// [`Error::NothingMeasured`] without a sample.
    pub(crate) fn finish(mut self) -> Result<Nis, Error> {
        self.close();
        if self.measured == 0 {
            return Err(Error::NothingMeasured);
        }
        let (measured, count) = (self.measured, self.measured as f64);
        let mean = self.sum_q / count;
        let scatter = (self.q_q - 2.0 * mean * self.q_n + mean * mean * self.n_n).max(0.0);
        let standard_error = (self.blocks >= MIN_BLOCKS as f64)
            .then(|| (self.blocks / (self.blocks - 1.0) * scatter).sqrt() / count)
            .filter(|se| se.is_finite());
        Ok(Nis { mean, standard_error, measured })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(squares: impl ExactSizeIterator<Item = f64>) -> Nis {
        let mut blocks = NisBlocks::new(squares.len());
        squares.for_each(|square| blocks.add_sample(square.sqrt(), 1.0));
        blocks.finish().unwrap()
    }

    /// Blocks of equal length: the textbook's standard error of a mean.
    #[test]
    fn equal_blocks_give_the_standard_error_of_their_means() {
        let means = [0.9, 1.3, 1.1, 0.7, 1.0, 1.2, 0.8, 1.4];
        let found = of((0..8 * SHORTEST_BLOCK).map(|k| means[k / SHORTEST_BLOCK]));
        let mean = means.iter().sum::<f64>() / 8.0;
        let variance = means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / 7.0;
        assert!((found.mean - mean).abs() < 1e-12);
        assert!((found.standard_error.unwrap() - (variance / 8.0).sqrt()).abs() < 1e-9);
    }

    /// Independent normal innovations: squares of variance 2.
    #[test]
    fn independent_samples_give_the_square_root_of_two_over_n() {
        use rand::{Rng, SeedableRng};
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(7);
        // Box and Muller.
        let mut normal = || {
            let (u, v): (f64, f64) = (random.random(), random.random());
            (-2.0 * (1.0 - u).ln()).sqrt() * (v * std::f64::consts::TAU).cos()
        };
        let found = of((0..200_000).map(|_| normal().powi(2)));
        let expected = (2.0 / found.measured as f64).sqrt();
        assert!((found.standard_error.unwrap() / expected - 1.0).abs() < 0.15, "{found:?}");
    }

    #[test]
    fn few_blocks_give_none() {
        assert_eq!(of((0..3_000).map(|_| 1.0)), Nis { mean: 1.0, standard_error: None, measured: 3_000 });
        assert_eq!(NisBlocks::new(9).finish(), Err(Error::NothingMeasured));
    }
}
