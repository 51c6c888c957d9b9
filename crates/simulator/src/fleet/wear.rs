//! How a gap grows with a unit's hours: a mean law, and the unevenness of real wear.

use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Gamma};
use serde::{Deserialize, Serialize};

/// The mean growth of a gap since the unit was new.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum WearLaw {
    #[default]
    Steady,
    /// `rate · h`.
    Linear { rate_m_per_hour: f64 },
    /// `amplitude · (h / life)^exponent`.
    Power { amplitude_m: f64, life_hours: f64, exponent: f64 },
    /// `amplitude · (e^(h / life) − 1)`.
    Exponential { amplitude_m: f64, life_hours: f64 },
    /// Nothing until `onset_hours`, then `rate` per hour.
    Onset { onset_hours: f64, rate_m_per_hour: f64 },
}

impl WearLaw {
    /// Mean growth from new to an age, metres.
    pub(crate) fn growth_m(&self, unit_hours: f64) -> f64 {
        match *self {
            Self::Steady => 0.0,
            Self::Linear { rate_m_per_hour } => rate_m_per_hour * unit_hours,
            Self::Power { amplitude_m, life_hours, exponent } => {
                amplitude_m * (unit_hours / life_hours).powf(exponent)
            }
            Self::Exponential { amplitude_m, life_hours } => amplitude_m * (unit_hours / life_hours).exp_m1(),
            Self::Onset { onset_hours, rate_m_per_hour } => {
                rate_m_per_hour * (unit_hours - onset_hours).max(0.0)
            }
        }
    }
}

/// One unevenly worn step: a gamma process of the given mean, so wear never heals.
///
/// The variance is `scatter · mean`: with 1 µm of scatter a growth of 25 µm comes out as 25 ± 5 µm.
pub(crate) fn step_m(mean_m: f64, scatter_m: f64, rng: &mut ChaCha8Rng) -> f64 {
    match Gamma::new(mean_m / scatter_m, scatter_m) {
        Ok(gamma) if scatter_m > 0.0 => gamma.sample(rng),
        _ => mean_m,
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "these values are exact")]
mod tests {
    use super::*;
    use crate::seeded_streams::seeded_rng;

    #[test]
    fn every_law_starts_from_zero_and_follows_its_formula() {
        let power = WearLaw::Power { amplitude_m: 2e-5, life_hours: 100.0, exponent: 2.0 };
        assert_eq!((power.growth_m(0.0), power.growth_m(50.0)), (0.0, 5e-6));
        let onset = WearLaw::Onset { onset_hours: 10.0, rate_m_per_hour: 1e-6 };
        assert_eq!((onset.growth_m(9.0), onset.growth_m(12.0)), (0.0, 2e-6));
        let exponential = WearLaw::Exponential { amplitude_m: 1e-6, life_hours: 10.0 };
        assert!((exponential.growth_m(10.0) - 1e-6 * (std::f64::consts::E - 1.0)).abs() < 1e-18);
    }

    #[test]
    fn uneven_wear_has_the_mean_and_variance_it_states() {
        let mut rng = seeded_rng(5, &["wear"]);
        let steps: Vec<f64> = (0..100_000).map(|_| step_m(25e-6, 1e-6, &mut rng)).collect();
        let mean = steps.iter().sum::<f64>() / 1e5;
        let variance = steps.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / 1e5;
        assert!((mean / 25e-6 - 1.0).abs() < 0.01 && (variance / 25e-12 - 1.0).abs() < 0.05);
        assert_eq!(step_m(3e-6, 0.0, &mut rng), 3e-6);
        assert_eq!(step_m(0.0, 1e-6, &mut rng), 0.0);
    }
}
