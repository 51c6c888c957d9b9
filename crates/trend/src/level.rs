//! Where a unit stands now, by the mixture over its curves: gap, rate, growth, law.

use crate::calibrate::USUAL_WIDTH;
use crate::course::Course;
use crate::curve::Law;
use crate::normal;
use crate::posterior::{Node, Posterior};
use crate::prior::FleetPrior;
use crate::trend::{Level, Rate, WearLaw};

/// Growth that counts as visible, metres.
const VISIBLE_M: f64 = 2e-6;

/// Exponents up to this slow down, and from that speed up; so does a course, by its next tenth's rate over this.
const SLOWING: f64 = 0.9;
const SPEEDING: f64 = 1.2;

/// The mixture's mean and spread, the installation's bias and undone offsets included.
pub(crate) fn level(posterior: &Posterior, prior: &FleetPrior, offset_m2: f64) -> Level {
    let gap_m = posterior.nodes.iter().map(|n| n.weight * n.level_m).sum::<f64>();
    let between = posterior.nodes.iter().map(|n| n.weight * (n.level_m - gap_m).powi(2)).sum::<f64>();
    Level { gap_m, se_m: (between + posterior.level_m2 + offset_m2 + prior.bias_sd_m.powi(2)).sqrt() }
}

/// Quantiles of the curves' rates now, per flight hour, as much wider as the future is stated.
pub(crate) fn rate(posterior: &Posterior, hours_per_usage: f64) -> Rate {
    let of = |n: &Node| (n.amplitude_m * n.law.slope(n.age_now) / hours_per_usage, n.weight);
    let rates = Weighted::new(posterior.notable().map(of));
    let m_per_hour = rates.quantile(0.5);
    let at = |share: f64| m_per_hour + USUAL_WIDTH * (rates.quantile(share) - m_per_hour);
    Rate { p05_m_per_hour: at(0.05).max(0.0), m_per_hour, p95_m_per_hour: at(0.95) }
}

/// Probability of visible growth since the segment began.
pub(crate) fn growth_probability(posterior: &Posterior) -> f64 {
    let sd_m = posterior.growth_m2.sqrt();
    let grown_m = |n: &Node| n.level_m - n.new_m - n.amplitude_m * n.law.height(n.age_begin);
    let grown = |n: &Node| n.weight * normal::cdf((grown_m(n) - VISIBLE_M) / sd_m);
    probability(posterior.nodes.iter().map(grown).sum())
}

/// Weights come back from what is kept in single precision, so that together they may be a little more than one.
fn probability(sum: f64) -> f64 {
    sum.min(1.0)
}

/// When wear began, in usage since the segment's begin, and the share of the belief that is in an onset,
/// where that is most of it.
pub(crate) fn onset(posterior: &Posterior) -> Option<(f64, f64)> {
    let starts = posterior.nodes.iter().filter_map(|n| Some((onset_start(n)?, n.weight)));
    let starts = Weighted::new(starts);
    (starts.total > 0.5).then(|| (starts.quantile(0.5), probability(starts.total)))
}

/// When a node's wear began, in usage since the segment's begin, if it is an onset.
pub(crate) fn onset_start(node: &Node) -> Option<f64> {
    if let Law::Onset { start } = node.law { Some(start) } else { None }
}

/// The law most believed in, and how much.
pub(crate) fn law(posterior: &Posterior) -> Option<(WearLaw, f64)> {
    let mut shares: Vec<(WearLaw, f64)> = Vec::new();
    for node in &posterior.nodes {
        let law = name(node);
        match shares.iter_mut().find(|(known, _)| *known == law) {
            Some((_, share)) => *share += node.weight,
            None => shares.push((law, node.weight)),
        }
    }
    let likeliest = shares.into_iter().max_by(|a, b| a.1.total_cmp(&b.1));
    likeliest.map(|(law, share)| (law, probability(share)))
}

fn name(node: &Node) -> WearLaw {
    match node.law {
        Law::None => WearLaw::None,
        Law::Onset { .. } => WearLaw::Onset,
        Law::Exponential { .. } => WearLaw::Accelerating,
        Law::Settling { .. } => WearLaw::Slowing,
        law @ Law::Bend { .. } => {
            if law.slope(0.0) < law.slope(f64::MAX) {
                WearLaw::Accelerating
            } else {
                WearLaw::Slowing
            }
        }
        Law::Course { course, life } => match Course::new(course, life).quickening(node.age_now) {
            ratio if ratio < SLOWING => WearLaw::Slowing,
            ratio if ratio > SPEEDING => WearLaw::Accelerating,
            _ => WearLaw::Linear,
        },
        law @ Law::Power { .. } => match law.exponent() {
            Some(p) if p < SLOWING => WearLaw::Slowing,
            Some(p) if p > SPEEDING => WearLaw::Accelerating,
            _ => WearLaw::Linear,
        },
    }
}

/// Values with weights, in order.
pub(crate) struct Weighted {
    values: Vec<(f64, f64)>,
    total: f64,
}

impl Weighted {
    pub(crate) fn new(values: impl Iterator<Item = (f64, f64)>) -> Self {
        let mut values: Vec<(f64, f64)> = values.collect();
        values.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let total = values.iter().map(|v| v.1).sum();
        Self { values, total }
    }

    /// The first value at which this share of the weight is reached; zero of nothing.
    pub(crate) fn quantile(&self, share: f64) -> f64 {
        let mut sum = 0.0;
        let reached = self.values.iter().find(|(_, weight)| {
            sum += weight;
            sum >= share * self.total
        });
        reached.or(self.values.last()).map_or(0.0, |(value, _)| *value)
    }
}
