//! Bias between estimate and inspection (Bland and Altman 1986).

use records::uncertainty::NORMAL_95;

/// Mean difference of two measurements of the same gap.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Agreement {
    /// Mean of estimate minus inspection, m.
    pub(crate) bias_m: f64,
    /// 90 % interval of the bias, m: half its width.
    pub(crate) half_width_m: f64,
}

impl Agreement {
    /// Computes the bias from differences, m; `None` for fewer than three.
    pub(crate) fn of(differences_m: &[f64]) -> Option<Self> {
        let n = differences_m.len() as f64;
        let bias_m = differences_m.iter().sum::<f64>() / n;
        let square: f64 = differences_m.iter().map(|difference| (difference - bias_m).powi(2)).sum();
        let half_width_m = NORMAL_95 * (square / (n - 1.0) / n).sqrt();
        (differences_m.len() >= 3).then_some(Self { bias_m, half_width_m })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Differences 1, 2 and 3 µm: mean 2, standard deviation 1, by hand.
    #[test]
    fn three_pairs_by_hand_and_two_show_no_spread() {
        let a = Agreement::of(&[1e-6, 2e-6, 3e-6]).unwrap();
        assert!((a.bias_m - 2e-6).abs() < 1e-15);
        assert!((a.half_width_m - 1.644_854e-6 / 3f64.sqrt()).abs() < 1e-12);
        assert_eq!(Agreement::of(&[0.0, 0.0]), None);
    }
}
