//! A mixture over the bank made small: of many nodes some, in single precision.

use crate::inference::posterior::{AgeAssumption, Component, Posterior};
use crate::prior::fleet_prior::FleetPrior;
use crate::wear::bank::WearLaw;

/// Nodes kept at most.
const MOST: usize = 96;

/// A node's law, its age in hours, and its numbers in metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct StoredComponent {
    pub(crate) law: WearLaw,
    pub(crate) onset_pending: bool,
    pub(crate) age_begin: f32,
    pub(crate) amplitude_m: f32,
    pub(crate) level_m: f32,
    pub(crate) new_m: f32,
    pub(crate) seasonal_m: f32,
    pub(crate) weight: f32,
}

/// What the nodes of a [`Posterior`] share, and those that stand for all.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Mixture {
    /// Judged without the fleet.
    pub(crate) is_single_unit: bool,
    /// Usage from the segment's begin to its end, and from its last bin.
    pub(crate) span: f64,
    pub(crate) since: f64,
    pub(crate) level_m2: f64,
    pub(crate) growth_m2: f64,
    pub(crate) seasonal_m2: f64,
    pub(crate) level_seasonal_m2: f64,
    pub(crate) components: Vec<StoredComponent>,
}

impl Mixture {
    /// Compresses a posterior at the end of its segment.
    pub(crate) fn of(posterior: &Posterior, span: f64, is_single_unit: bool) -> Self {
        let Posterior { since, level_m2, growth_m2, seasonal_m2, level_seasonal_m2, .. } = *posterior;
        let components = thin(&posterior.components);
        Self { is_single_unit, span, since, level_m2, growth_m2, seasonal_m2, level_seasonal_m2, components }
    }

    /// The stored posterior, without its evidence and age assumptions, which only the learning of a fleet prior uses.
    pub(crate) fn posterior(&self, prior: &FleetPrior) -> Posterior {
        let component = |component: &StoredComponent| {
            let age_begin = f64::from(component.age_begin);
            Component {
                law: component.law,
                age_begin,
                age_now: age_begin + self.span,
                amplitude_m: f64::from(component.amplitude_m),
                ln_life: prior.ln_life,
                level_m: f64::from(component.level_m),
                new_m: f64::from(component.new_m),
                seasonal_m: f64::from(component.seasonal_m),
                age_assumption: AgeAssumption::NotNeeded,
                onset_pending: component.onset_pending,
                weight: f64::from(component.weight),
            }
        };
        let Self { since, level_m2, growth_m2, seasonal_m2, level_seasonal_m2, .. } = *self;
        let components = self.components.iter().map(component).collect();
        Posterior {
            components,
            since,
            level_m2,
            growth_m2,
            seasonal_m2,
            level_seasonal_m2,
            log_evidence: 0.0,
        }
    }
}

/// As many nodes as are kept: the heavy ones as they are, and of the light ones, which lie in the order of
/// the bank, one at every share of their weight (Fearnhead and Clifford 2003, without its random numbers).
fn thin(components: &[Component]) -> Vec<StoredComponent> {
    let share = light_share(components);
    let (mut passed, mut due) = (0.0, 0.5 * share);
    let mut stored = Vec::with_capacity(components.len().min(MOST + 1));
    for component in components {
        if component.weight > share {
            stored.push(to_stored(component, component.weight));
            continue;
        }
        passed += component.weight;
        if passed > due {
            due += share;
            stored.push(to_stored(component, share));
        }
    }
    stored
}

/// Weight threshold of the systematic resampling: components below it are resampled to this weight; `None` where all
/// components fit.
fn light_share(components: &[Component]) -> f64 {
    if components.len() <= MOST {
        return 0.0;
    }
    let mut weights: Vec<f64> = components.iter().map(|component| component.weight).collect();
    weights.sort_unstable_by(|a, b| b.total_cmp(a));
    let mut left: f64 = weights.iter().sum();
    for (heavy, weight) in weights.iter().take(MOST - 1).enumerate() {
        let share = left / (MOST - heavy) as f64;
        if *weight <= share {
            return share;
        }
        left -= weight;
    }
    left
}

fn to_stored(component: &Component, weight: f64) -> StoredComponent {
    StoredComponent {
        law: component.law,
        onset_pending: component.onset_pending,
        age_begin: component.age_begin as f32,
        amplitude_m: component.amplitude_m as f32,
        level_m: component.level_m as f32,
        new_m: component.new_m as f32,
        seasonal_m: component.seasonal_m as f32,
        weight: weight as f32,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn components(weights: impl Iterator<Item = f64>) -> Vec<Component> {
        let component = |(k, weight): (usize, f64)| Component {
            law: WearLaw::None,
            age_begin: 0.0,
            age_now: 1.0,
            amplitude_m: 0.0,
            ln_life: 0.0,
            level_m: k as f64,
            new_m: 0.0,
            seasonal_m: 0.0,
            age_assumption: AgeAssumption::NotNeeded,
            onset_pending: false,
            weight,
        };
        weights.enumerate().map(component).collect()
    }

    /// A heavy node among a thousand light ones, of half the weight.
    #[test]
    fn heavy_nodes_stay_and_light_ones_are_thinned_evenly_without_loss_of_weight() {
        let weights = (0..1001).map(|k| if k == 400 { 0.5 } else { 0.0005 });
        let components = thin(&components(weights));
        assert!(components.len().abs_diff(MOST) <= 1, "{}", components.len());
        let total: f64 = components.iter().map(|p| f64::from(p.weight)).sum();
        assert!((total - 1.0).abs() < 0.005, "{total}");
        let heavy = components.iter().find(|p| p.level_m as usize == 400).map(|p| p.weight);
        assert_eq!(heavy, Some(0.5));
        let steps: Vec<f32> = components.windows(2).map(|pair| pair[1].level_m - pair[0].level_m).collect();
        let farthest = (1000_f32 / (MOST - 1) as f32).ceil();
        assert!(steps.iter().all(|step| (1.0..=farthest).contains(step)), "{steps:?}");
        let mean: f64 = components.iter().map(|p| f64::from(p.weight * p.level_m)).sum();
        assert!((mean - (200.0 + 0.5 * 500.2)).abs() < 2.0, "{mean}");
    }

    #[test]
    fn few_nodes_are_kept_as_they_are() {
        let weights: Vec<f64> = (1..=MOST).map(|k| k as f64).collect();
        let kept: Vec<f64> =
            thin(&components(weights.iter().copied())).iter().map(|p| f64::from(p.weight)).collect();
        assert_eq!(kept, weights);
    }
}
