//! When the limit is met: the crossings of all components, added up.

use crate::inference::posterior::Posterior;
use crate::math::{GAUSS_HERMITE_5, WeightedSamples, normal_cdf};
use crate::prior::{FleetPrior, WAIT_QUANTILES};
use crate::settings::Settings;
use crate::statement::types::Crossing;
use crate::wear::Component;
use crate::wear::bank::WearLaw;

pub(crate) struct RulDistribution {
    hours: WeightedSamples,
    horizon_hours: f64,
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
        let spread_m2 = posterior.level_m2 + offset_m2 + prior.bias_sd_m.powi(2);
        let mut crossings = Vec::with_capacity(GAUSS_HERMITE_5.len() * posterior.components.len());
        for component in posterior.significant_components() {
            let left_m = settings.limit_m - component.level_m;
            let sd_m = (spread_m2 + prior.wear_noise_m * left_m.max(0.0)).sqrt();
            let height_now = component.law.value(component.age_now);
            for (z, share) in GAUSS_HERMITE_5 {
                let (left_m, weight) = (left_m + z * sd_m, component.weight * share);
                if left_m <= 0.0 {
                    crossings.push((0.0, weight));
                } else if component.onset_pending {
                    let wear = component.ln_life.exp() * left_m / prior.span_m;
                    let waits = prior.onset_wait_quantiles();
                    crossings.extend(
                        waits.map(|wait| ((wait + wear) * hours_per_usage, weight / waits.len() as f64)),
                    );
                } else if component.law == WearLaw::None {
                    crossings.push((f64::INFINITY, weight));
                } else {
                    let at = component.law.inverse(height_now + left_m / component.amplitude_m);
                    crossings.push(((at - component.age_now).max(0.0) * hours_per_usage, weight));
                }
            }
        }
        let (horizon_hours, width) = (settings.horizon_hours, prior.interval_width);
        Self { hours: WeightedSamples::new(crossings.into_iter()), horizon_hours, width }
    }

    /// Its 5 %, 50 % and 95 % quantiles, the interval widened on the logarithm of the time; none beyond the horizon.
    ///
    /// A limit that is likely reached already, or likely beyond the horizon, has no width to be corrected.
    pub(crate) fn crossing(&self) -> Crossing {
        let within =
            |hours: f64| Some(if hours > 1.0 { hours } else { 0.0 }).filter(|h| *h < self.horizon_hours);
        let [early, middle, late] = [0.05, 0.5, 0.95].map(|share| within(self.hours.quantile(share)));
        let widened = |bound: f64, middle: f64| within(middle * (bound.max(1.0) / middle).powf(self.width));
        let (p05_hours, p95_hours) = match middle.filter(|hours| *hours > 0.0) {
            Some(middle) => {
                (early.and_then(|early| widened(early, middle)), late.and_then(|late| widened(late, middle)))
            }
            None => (early, late),
        };
        debug_assert!(
            // A quantile beyond the horizon is larger than all others.
            [p05_hours, middle, p95_hours].map(|hours| hours.unwrap_or(f64::INFINITY)).is_sorted(),
            "quantiles of the hours left decrease: {p05_hours:?} {middle:?} {p95_hours:?}"
        );
        Crossing { p05_hours, p50_hours: middle, p95_hours }
    }
}

/// The gaps of all probable components after more usage, as measured with some variance.
pub(crate) struct GapsAhead {
    /// Mean and standard deviation, m, and weight.
    parts: Vec<(f64, f64, f64)>,
}

impl GapsAhead {
    pub(crate) fn after(fitted: &Posterior, usage: f64, variance_m2: f64, prior: &FleetPrior) -> Self {
        let mut parts = Vec::with_capacity(fitted.components.len());
        let mut add = |component: &Component, grown_m: f64, share: f64| {
            let sd_m = (fitted.level_m2 + variance_m2 + prior.wear_noise_m * grown_m).sqrt();
            parts.push((component.level_m + grown_m, sd_m, component.weight * share));
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
        Self { parts }
    }

    /// Their 5 %, 50 % and 95 % quantiles, m.
    pub(crate) fn quantiles(&self) -> [f64; 3] {
        let points = self.parts.iter().flat_map(|(mean_m, sd_m, weight)| {
            GAUSS_HERMITE_5.map(|(z, share)| (mean_m + z * sd_m, weight * share))
        });
        let points = WeightedSamples::new(points);
        [0.05, 0.5, 0.95].map(|share| points.quantile(share))
    }

    /// The share at or above a gap.
    pub(crate) fn share_from(&self, gap_m: f64) -> f64 {
        let (mut above, mut total) = (0.0, 0.0);
        for (mean_m, sd_m, weight) in &self.parts {
            above += weight * normal_cdf((mean_m - gap_m) / sd_m.max(f64::MIN_POSITIVE));
            total += weight;
        }
        above / total
    }
}
