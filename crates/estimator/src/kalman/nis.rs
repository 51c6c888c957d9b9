//! Mean normalised innovation squared, with its standard error from blocks.

/// Samples of a block outside the eight parts of a long run.
pub(crate) const BLOCK_SAMPLES: usize = 512;
/// Fewer blocks give no standard error.
const MIN_BLOCKS: f64 = 8.0;

/// How well the model explained a flight's measurements.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Nis {
    /// Mean normalised innovation squared (NIS, e²/(C P Cᵀ + V_d), Bar-Shalom, Li and Kirubarajan 2001, section 5.4) over
    /// the measured samples; 1 for a true model.
    pub mean: f64,
    /// Its standard error from the means of successive blocks of hundreds of samples, which neighbouring innovations
    /// hardly couple (ratio estimator, Cochran 1977, section 6.3); none below eight blocks.
    pub standard_error: Option<f64>,
    /// Measured samples.
    pub measured: usize,
}

/// Sums over the blocks of a flight: of q, the sum of a block's normalised squares, and of n, its number of samples.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct NisBlocks {
    blocks: f64,
    q_q: f64,
    q_n: f64,
    n_n: f64,
    open: (f64, usize),
}

impl NisBlocks {
    /// Adds a block.
    pub(crate) fn add(&mut self, q: f64, samples: usize) {
        if samples > 0 {
            let n = samples as f64;
            self.blocks += 1.0;
            self.q_q += q * q;
            self.q_n += q * n;
            self.n_n += n * n;
        }
    }

    /// Adds one sample, to a block that closes when it is full.
    pub(crate) fn add_sample(&mut self, square: f64) {
        let (q, samples) = &mut self.open;
        *q += square;
        *samples += 1;
        if *samples == BLOCK_SAMPLES {
            let (q, samples) = std::mem::take(&mut self.open);
            self.add(q, samples);
        }
    }

    /// The mean of all samples, with its standard error: √(B/(B−1) Σ(q − mean·n)²) / Σn.
    pub(crate) fn finish(mut self, sum: f64, measured: usize) -> Nis {
        let (q, samples) = std::mem::take(&mut self.open);
        self.add(q, samples);
        let mean = sum / measured as f64;
        let scatter = (self.q_q - 2.0 * mean * self.q_n + mean * mean * self.n_n).max(0.0);
        let standard_error = (self.blocks >= MIN_BLOCKS)
            .then(|| (self.blocks / (self.blocks - 1.0) * scatter).sqrt() / measured as f64)
            .filter(|se| se.is_finite());
        Nis { mean, standard_error, measured }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]
mod tests {
    use super::*;

    /// Blocks of equal length: the textbook's standard error of a mean.
    #[test]
    fn equal_blocks_give_the_standard_error_of_their_means() {
        let means = [0.9, 1.3, 1.1, 0.7, 1.0, 1.2, 0.8, 1.4, 1.05];
        let mut blocks = NisBlocks::default();
        means.iter().for_each(|mean| blocks.add(mean * 100.0, 100));
        let found = blocks.finish(means.iter().sum::<f64>() * 100.0, 900);
        let mean = means.iter().sum::<f64>() / 9.0;
        let variance = means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / 8.0;
        assert!((found.mean - mean).abs() < 1e-12);
        assert!((found.standard_error.unwrap() - (variance / 9.0).sqrt()).abs() < 1e-12);
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
        let squares: Vec<f64> = (0..200_000).map(|_| normal().powi(2)).collect();
        let mut blocks = NisBlocks::default();
        squares.iter().for_each(|square| blocks.add_sample(*square));
        let found = blocks.finish(squares.iter().sum(), squares.len());
        let expected = (2.0 / squares.len() as f64).sqrt();
        assert!((found.standard_error.unwrap() / expected - 1.0).abs() < 0.15, "{found:?}");
    }

    #[test]
    fn few_blocks_give_none() {
        let mut blocks = NisBlocks::default();
        (0..3_000).for_each(|_| blocks.add_sample(1.0));
        assert_eq!(blocks.finish(3_000.0, 3_000), Nis { mean: 1.0, standard_error: None, measured: 3_000 });
    }
}
