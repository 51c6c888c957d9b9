//! Bias and limits of agreement between estimate and inspection (Bland and Altman 1986).

use records::uncertainty::NORMAL_95;

/// Bias and limits of agreement of two measurements of the same gap.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Agreement {
    /// Pairs.
    pub(crate) pairs: usize,
    /// Mean of estimate minus inspection, m.
    pub(crate) bias_m: f64,
    /// 90 % interval of the bias, m: half its width.
    pub(crate) bias_half_width_m: f64,
    /// Bias less 1.96 standard deviations, m.
    pub(crate) lower_m: f64,
    /// Bias plus 1.96 standard deviations, m.
    pub(crate) upper_m: f64,
}

impl Agreement {
    /// Computes the agreement from pairs of estimate and inspection, m; `None` for fewer than three pairs.
    pub(crate) fn of(pairs: &[(f64, f64)]) -> Option<Self> {
        if pairs.len() < 3 {
            return None;
        }
        let n = pairs.len() as f64;
        let bias_m = pairs.iter().map(|(estimate, play)| estimate - play).sum::<f64>() / n;
        let square: f64 = pairs.iter().map(|(estimate, play)| (estimate - play - bias_m).powi(2)).sum();
        let sd_m = (square / (n - 1.0)).sqrt();
        Some(Self {
            pairs: pairs.len(),
            bias_m,
            bias_half_width_m: NORMAL_95 * sd_m / n.sqrt(),
            lower_m: bias_m - 1.96 * sd_m,
            upper_m: bias_m + 1.96 * sd_m,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Differences 1, 2 and 3 µm: mean 2, standard deviation 1, by hand.
    #[test]
    fn three_pairs_by_hand() {
        let a = Agreement::of(&[(11e-6, 10e-6), (22e-6, 20e-6), (33e-6, 30e-6)]).unwrap();
        assert!((a.bias_m - 2e-6).abs() < 1e-15);
        assert!((a.lower_m - 0.04e-6).abs() < 1e-12 && (a.upper_m - 3.96e-6).abs() < 1e-12);
        assert!((a.bias_half_width_m - 1.644_854e-6 / 3f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn two_pairs_show_no_spread() {
        assert!(Agreement::of(&[(1.0, 1.0), (2.0, 2.0)]).is_none());
    }
}
