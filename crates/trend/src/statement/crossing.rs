//! When the limit is met: every node's crossing, added up.

use crate::inference::posterior::Posterior;
use crate::math::quadrature::{GAUSS_HERMITE_3, GAUSS_HERMITE_5, WAIT_QUANTILES};
use crate::math::weighted::WeightedSamples;
use crate::prior::fleet_prior::FleetPrior;
use crate::settings::Settings;
use crate::statement::types::Crossing;
use crate::wear::bank::WearLaw;
use crate::wear::component::Component;

/// Weight above which a node deserves the longer rule.
const NOTABLE: f64 = 0.02;

/// Cells of the distribution, even in ln hours from one hour to the horizon.
const CELLS: usize = 240;

/// The distribution of the hours left.
#[derive(Debug, Clone)]
pub(crate) struct RulDistribution {
    cells: Vec<f64>,
    over: f64,
    horizon_hours: f64,
    /// Cells for each ln hour.
    scale: f64,
    /// Factor of the interval's width.
    width: f64,
}

impl RulDistribution {
    /// Adds up the crossings of the act limit; usage turns to hours by `hours_per_usage`, and undone
    /// offsets leave `offset_m2` in the level.
    pub(crate) fn new(
        posterior: &Posterior,
        prior: &FleetPrior,
        settings: &Settings,
        hours_per_usage: f64,
        offset_m2: f64,
    ) -> Self {
        let Settings { limit_m, horizon_hours, .. } = *settings;
        // Cells are of equal width in the logarithm of the hours from one hour on.
        let scale = CELLS as f64 / horizon_hours.max(std::f64::consts::E).ln();
        let mut remaining =
            Self { cells: vec![0.0; CELLS], over: 0.0, horizon_hours, scale, width: prior.interval_width };
        let spread_m2 = posterior.level_m2 + offset_m2 + prior.bias_sd_m.powi(2);
        let kept: f64 = posterior.significant_components().map(|n| n.weight).sum();
        for component in posterior.significant_components() {
            let component = &Component { weight: component.weight / kept, ..*component };
            remaining.add_component(component, prior, limit_m, spread_m2, hours_per_usage);
        }
        remaining
    }

    fn add_component(
        &mut self,
        component: &Component,
        prior: &FleetPrior,
        limit_m: f64,
        spread_m2: f64,
        hours_per_usage: f64,
    ) {
        let left_m = limit_m - component.level_m;
        let sd_m = (spread_m2 + prior.wear_noise_m * left_m.max(0.0)).sqrt();
        let rule: &[(f64, f64)] =
            if component.weight > NOTABLE { &GAUSS_HERMITE_5 } else { &GAUSS_HERMITE_3 };
        let height_now = component.law.value(component.age_now);
        for &(z, share) in rule {
            let left_m = left_m + z * sd_m;
            let weight = component.weight * share;
            if left_m <= 0.0 {
                self.over += weight;
            } else if component.onset_pending {
                let wear_hours = component.ln_life.exp() * left_m / prior.span_m;
                for wait_hours in prior.onset_wait_quantiles() {
                    self.add((wait_hours + wear_hours) * hours_per_usage, weight / WAIT_QUANTILES as f64);
                }
            } else if component.law != WearLaw::None {
                let value = height_now + left_m / component.amplitude_m;
                self.add((component.law.inverse(value) - component.age_now) * hours_per_usage, weight);
            }
        }
    }

    fn add(&mut self, hours: f64, weight: f64) {
        let place = hours.max(1.0).ln() * self.scale;
        if let Some(cell) = self.cells.get_mut(place as usize) {
            *cell += weight;
        }
    }

    /// Its 5 %, 50 % and 95 % quantiles, the interval widened on the logarithm of the time.
    ///
    /// A limit that is likely reached already, or likely beyond the horizon, has no width to be corrected.
    pub(crate) fn crossing(&self) -> Crossing {
        let [p05_hours, p50_hours, p95_hours] = [0.05, 0.5, 0.95].map(|p| self.quantile(p));
        let (Some(early), Some(middle)) = (p05_hours, p50_hours.filter(|hours| *hours > 0.0)) else {
            return Crossing { p05_hours, p50_hours, p95_hours };
        };
        let widened = |bound: f64| {
            let hours = middle * (bound.max(1.0) / middle).powf(self.width);
            (hours < self.horizon_hours).then_some(if hours > 1.0 { hours } else { 0.0 })
        };
        let crossing =
            Crossing { p05_hours: widened(early), p50_hours, p95_hours: p95_hours.and_then(widened) };
        debug_assert!(is_ordered(&crossing), "{crossing:?}");
        crossing
    }

    /// The hours by which the limit is met with this probability; nothing when that is beyond the horizon.
    fn quantile(&self, probability: f64) -> Option<f64> {
        let mut sum = self.over;
        if sum >= probability {
            return Some(0.0);
        }
        for (i, cell) in self.cells.iter().enumerate() {
            if sum + cell >= probability {
                let place = i as f64 + (probability - sum) / cell;
                return Some((place / self.scale).exp());
            }
            sum += cell;
        }
        None
    }

    /// Probability that the limit is met within some hours; the sum of the cells may round to more than one.
    pub(crate) fn within(&self, hours: f64) -> f64 {
        let place = hours.max(1.0).ln() * self.scale;
        let whole = (place as usize).min(CELLS);
        let part = self.cells.get(whole).map_or(0.0, |cell| cell * (place - whole as f64));
        (self.over + self.cells[..whole].iter().sum::<f64>() + part).min(1.0)
    }
}

/// 5 %, 50 % and 95 % bounds of the gap after more usage, as measured with some variance.
pub(crate) fn gap_quantiles(
    fitted: &Posterior,
    usage: f64,
    variance_m2: f64,
    prior: &FleetPrior,
) -> [f64; 3] {
    let mut points = Vec::with_capacity(GAUSS_HERMITE_5.len() * fitted.components.len() / 2);
    let mut add = |component: &Component, grown_m: f64, share: f64| {
        let sd_m = (fitted.level_m2 + variance_m2 + prior.wear_noise_m * grown_m).sqrt();
        let point = |(z, weight): (f64, f64)| {
            (component.level_m + grown_m + z * sd_m, component.weight * share * weight)
        };
        points.extend(GAUSS_HERMITE_5.map(point));
    };
    for component in fitted.significant_components() {
        if component.onset_pending {
            let rate = prior.span_m / component.ln_life.exp();
            for wait in prior.onset_wait_quantiles() {
                add(component, rate * (usage - wait).max(0.0), 1.0 / WAIT_QUANTILES as f64);
            }
        } else {
            let grown =
                component.law.value(component.age_now + usage) - component.law.value(component.age_now);
            add(component, component.amplitude_m * grown, 1.0);
        }
    }
    let points = WeightedSamples::new(points.into_iter());
    [0.05, 0.5, 0.95].map(|share| points.quantile(share))
}

/// Whether the quantiles increase; one beyond the horizon is larger than all others.
fn is_ordered(crossing: &Crossing) -> bool {
    let Crossing { p05_hours, p50_hours, p95_hours } = *crossing;
    [p05_hours, p50_hours, p95_hours].map(|hours| hours.unwrap_or(f64::INFINITY)).is_sorted()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// The probability within the hours of a quantile is that of the quantile, wherever it falls in a cell.
        #[test]
        fn the_probability_within_a_quantile_is_its_own(
            cells in prop::collection::vec(0.0..1.0_f64, CELLS),
            over in 0.0..1.0_f64,
            probability in 0.0..1.0_f64,
        ) {
            let total = over + cells.iter().sum::<f64>();
            let horizon_hours: f64 = 3000.0;
            let found = RulDistribution {
                cells: cells.iter().map(|cell| cell / total).collect(),
                over: over / total,
                horizon_hours,
                scale: CELLS as f64 / horizon_hours.ln(),
                width: 1.0,
            };
            let hours = found.quantile(probability);
            prop_assume!(hours.is_some_and(|hours| hours > 0.0));
            let within = found.within(hours.unwrap_or_default());
            prop_assert!((within - probability).abs() < 1e-9, "{within}, not {probability}");
        }
    }
}
