//! Rate, growth and wear law of a unit, from the mixture over its curves.

use crate::inference::posterior::Posterior;
use crate::math::{WeightedSamples, normal_cdf};
use crate::statement::types::Rate;
use crate::wear::Component;
use crate::wear::bank::{WearClass, WearLaw};

/// Least visible growth, as a share of the limit.
const VISIBLE: f64 = 0.02;

/// Quantiles of the curves' present rates, per flight hour; the distances from the median are multiplied by `width`.
pub(crate) fn rate(posterior: &Posterior, hours_per_usage: f64, width: f64) -> Rate {
    let of = |n: &Component| (n.amplitude_m * n.law.derivative(n.age_now) / hours_per_usage, n.weight);
    let rates = WeightedSamples::new(posterior.significant_components().map(of));
    let m_per_hour = rates.quantile(0.5);
    let at = |share: f64| m_per_hour + width * (rates.quantile(share) - m_per_hour);
    Rate { p05_m_per_hour: at(0.05).max(0.0), m_per_hour, p95_m_per_hour: at(0.95) }
}

/// Probability of visible growth since the segment began.
pub(crate) fn growth_probability(posterior: &Posterior, limit_m: f64) -> f64 {
    let visible_m = VISIBLE * limit_m;
    let sd_m = posterior.growth_m2.sqrt();
    let grown_m = |n: &Component| n.level_m - n.new_m - n.amplitude_m * n.law.value(n.age_begin);
    let grown = |n: &Component| n.weight * normal_cdf((grown_m(n) - visible_m) / sd_m);
    // Rounded sums of weights may be a little more than one, here and below.
    posterior.components.iter().map(grown).sum::<f64>().min(1.0)
}

/// Usage since the begin of the segment at which wear began, and the probability of an onset; `None` if that is
/// at most one half.
pub(crate) fn onset(posterior: &Posterior) -> Option<(f64, f64)> {
    let start = |n: &Component| match n.law {
        WearLaw::Onset { start } => Some((start, n.weight)),
        _ => None,
    };
    let starts = WeightedSamples::new(posterior.components.iter().filter_map(start));
    (starts.total > 0.5).then(|| (starts.quantile(0.5), starts.total.min(1.0)))
}

/// Most probable class of wear laws, and its probability; for a wearing unit, without the class *none*.
pub(crate) fn law(posterior: &Posterior, is_wearing: bool) -> Option<(WearClass, f64)> {
    let mut shares: Vec<(WearClass, f64)> = Vec::new();
    for component in &posterior.components {
        let law = component.law.class(component.age_now);
        if is_wearing && law == WearClass::None {
            continue;
        }
        match shares.iter_mut().find(|(known, _)| *known == law) {
            Some((_, share)) => *share += component.weight,
            None => shares.push((law, component.weight)),
        }
    }
    let likeliest = shares.into_iter().max_by(|a, b| a.1.total_cmp(&b.1));
    likeliest.map(|(law, share)| (law, share.min(1.0)))
}
