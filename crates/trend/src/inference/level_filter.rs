//! One Kalman filter for every curve: the level that walks, with the same gains whatever is regressed on it.
//!
//! Given an amplitude A, the gaps less A·F are a level N that walks and is measured with noise. Its
//! gains depend on the variances alone, so each curve costs one pass of a scalar filter over its own
//! heights, and the likelihood is a quadratic in A:
//!
//! ```text
//! e(y − A F) = e(y) − A e(F)        innovations are linear
//! −2 ln L(A) = Σ e²/s = Syy − 2 A Sfy + A² Sff   (+ terms without A)
//! ```

use crate::data::bins::Bin;

/// Initial standard deviation of the level, a share of the limit: far larger than any gap, so that the data determine
/// the level.
const DIFFUSE: f64 = 10.0;

/// Gains of the filter at one bin.
#[derive(Debug, Clone, Copy)]
struct Step {
    gain: f64,
    precision: f64,
    /// Weight of the innovation in the smoothed first level.
    to_start: f64,
}

/// The shared filter over one segment's bins.
#[derive(Debug, Clone)]
pub(crate) struct Filter {
    steps: Vec<Step>,
    /// Sum of ln s.
    pub(crate) log_variance: f64,
    /// Variance of the level at the last bin.
    pub(crate) end_m2: f64,
    /// Variance of the smoothed level at the first.
    pub(crate) start_m2: f64,
}

/// Result of a pass over one sequence: innovations times their precision, and the level at both ends.
#[derive(Debug, Clone)]
pub(crate) struct Pass {
    weighted: Vec<f64>,
    /// Sum of e²/s.
    pub(crate) square: f64,
    pub(crate) end: f64,
    pub(crate) start: f64,
}

/// Weighted products of a curve's pass with itself, the gaps and the season, and its level at both ends.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Regression {
    pub(crate) sff: f64,
    pub(crate) sfy: f64,
    pub(crate) sfs: f64,
    pub(crate) end: f64,
    pub(crate) start: f64,
}

impl Filter {
    /// Gains for bins and the variance by which the level walks before each (the first is not used), of a unit
    /// with an act limit.
    pub(crate) fn new(bins: &[Bin], walk_m2: &[f64], limit_m: f64) -> Self {
        let start = (DIFFUSE * limit_m).powi(2);
        let (mut p, mut reach, mut start_m2, mut log_variance) = (start, 1.0, start, 0.0);
        let mut steps = Vec::with_capacity(bins.len());
        for (k, bin) in bins.iter().enumerate() {
            if k > 0 {
                p += walk_m2[k];
            }
            let s = p + bin.variance_m2;
            let gain = p / s;
            let covariance = start * reach;
            log_variance += s.ln();
            start_m2 -= covariance * covariance / s;
            steps.push(Step { gain, precision: 1.0 / s, to_start: covariance / s });
            reach *= 1.0 - gain;
            p *= 1.0 - gain;
        }
        Self { steps, log_variance, end_m2: p, start_m2: start_m2.max(0.0) }
    }

    pub(crate) fn pass(&self, values: impl Iterator<Item = f64>) -> Pass {
        let (mut end, mut start, mut square) = (0.0, 0.0, 0.0);
        let weighted = self.steps.iter().zip(values).map(|(step, value)| {
            let e = value - end;
            end += step.gain * e;
            start += step.to_start * e;
            square += step.precision * e * e;
            step.precision * e
        });
        let weighted = weighted.collect();
        Pass { weighted, square, end, start }
    }

    /// Filters the basis values of several curves at once, with the passes of the gaps and of the season.
    ///
    /// Each step of a curve waits for the one before it; other curves fill the time.
    pub(crate) fn regress_lanes<const N: usize>(
        &self,
        gaps: &Pass,
        season: &Pass,
        basis_values: &[[f64; N]],
    ) -> [Regression; N] {
        let mut lanes = [Regression::default(); N];
        let others = gaps.weighted.iter().zip(&season.weighted);
        for ((step, basis_values), (gap, wave)) in self.steps.iter().zip(basis_values).zip(others) {
            for (lane, value) in lanes.iter_mut().zip(basis_values) {
                let e = value - lane.end;
                lane.end += step.gain * e;
                lane.start += step.to_start * e;
                lane.sff += step.precision * e * e;
                lane.sfy += gap * e;
                lane.sfs += wave * e;
            }
        }
        lanes
    }

    /// Filters one sequence, with two other passes.
    pub(crate) fn regress(&self, gaps: &Pass, season: &Pass, basis_values: &[f64]) -> Regression {
        let [regression] = self.regress_lanes(gaps, season, basis_values.as_chunks::<1>().0);
        regression
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two measurements of a constant level: the smoothed first level is their mean, and its
    /// variance the half of one's, by hand.
    #[test]
    fn a_constant_level_is_the_mean_of_its_measurements() {
        let bins = [1.0, 3.0].map(|um| Bin {
            usage: um,
            departure_us: 0.0,
            installation: 0,
            gap_m: um * 1e-6,
            variance_m2: 1e-12,
        });
        let filter = Filter::new(&bins, &[0.0; 2], 1e-4);
        let pass = filter.pass(bins.iter().map(|b| b.gap_m));
        assert!((pass.start - 2e-6).abs() < 1e-11 && (pass.end - 2e-6).abs() < 1e-11, "{pass:?}");
        assert!(
            (filter.start_m2 / 0.5e-12 - 1.0).abs() < 1e-5 && (filter.end_m2 / 0.5e-12 - 1.0).abs() < 1e-5
        );
    }
}
