//! A mixture over the bank made small: of many nodes some, in single precision.

use serde::{Deserialize, Serialize};

use crate::curve::Law;
use crate::posterior::{Guess, Node, Posterior};
use crate::prior::FleetPrior;

/// Nodes kept at most.
const MOST: usize = 96;

/// A node's law, its age in hours, and its numbers in metres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Point {
    pub(crate) law: Law,
    pub(crate) waits: bool,
    pub(crate) age_begin: f32,
    pub(crate) amplitude_m: f32,
    pub(crate) level_m: f32,
    pub(crate) new_m: f32,
    pub(crate) swing_m: f32,
    pub(crate) weight: f32,
}

/// What the nodes of a [`Posterior`] share, and those that stand for all.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Mixture {
    /// Judged without the fleet.
    pub(crate) is_alone: bool,
    /// Usage from the segment's begin to its end, and from its last bin.
    pub(crate) span: f64,
    pub(crate) since: f64,
    pub(crate) level_m2: f64,
    pub(crate) growth_m2: f64,
    pub(crate) swing_m2: f64,
    pub(crate) level_swing_m2: f64,
    pub(crate) points: Vec<Point>,
}

impl Mixture {
    /// Keeps what a posterior says at the end of its segment.
    pub(crate) fn of(posterior: &Posterior, span: f64, is_alone: bool) -> Self {
        let Posterior { since, level_m2, growth_m2, swing_m2, level_swing_m2, .. } = *posterior;
        let points = thinned(&posterior.nodes);
        Self { is_alone, span, since, level_m2, growth_m2, swing_m2, level_swing_m2, points }
    }

    /// The posterior that was kept; its evidence and its guesses, which only a fleet's lesson asks, are not.
    pub(crate) fn posterior(&self, prior: &FleetPrior) -> Posterior {
        let node = |point: &Point| {
            let age_begin = f64::from(point.age_begin);
            Node {
                law: point.law,
                age_begin,
                age_now: age_begin + self.span,
                amplitude_m: f64::from(point.amplitude_m),
                ln_life: prior.ln_life,
                level_m: f64::from(point.level_m),
                new_m: f64::from(point.new_m),
                swing_m: f64::from(point.swing_m),
                guess: Guess::Unneeded,
                waits: point.waits,
                weight: f64::from(point.weight),
            }
        };
        let Self { since, level_m2, growth_m2, swing_m2, level_swing_m2, .. } = *self;
        let nodes = self.points.iter().map(node).collect();
        Posterior { nodes, since, level_m2, growth_m2, swing_m2, level_swing_m2, log_evidence: 0.0 }
    }
}

/// As many nodes as are kept: the heavy ones as they are, and of the light ones, which lie in the order of
/// the bank, one at every share of their weight (Fearnhead and Clifford 2003, without its random numbers).
fn thinned(nodes: &[Node]) -> Vec<Point> {
    let share = light_share(nodes);
    let (mut passed, mut due) = (0.0, 0.5 * share);
    let mut points = Vec::with_capacity(nodes.len().min(MOST + 1));
    for node in nodes {
        if node.weight > share {
            points.push(point(node, node.weight));
            continue;
        }
        passed += node.weight;
        if passed > due {
            due += share;
            points.push(point(node, share));
        }
    }
    points
}

/// The weight that every light node is to have, below which a node is one; none where all may stay.
fn light_share(nodes: &[Node]) -> f64 {
    if nodes.len() <= MOST {
        return 0.0;
    }
    let mut weights: Vec<f64> = nodes.iter().map(|node| node.weight).collect();
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

fn point(node: &Node, weight: f64) -> Point {
    Point {
        law: node.law,
        waits: node.waits,
        age_begin: node.age_begin as f32,
        amplitude_m: node.amplitude_m as f32,
        level_m: node.level_m as f32,
        new_m: node.new_m as f32,
        swing_m: node.swing_m as f32,
        weight: weight as f32,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn nodes(weights: impl Iterator<Item = f64>) -> Vec<Node> {
        let node = |(k, weight): (usize, f64)| Node {
            law: Law::None,
            age_begin: 0.0,
            age_now: 1.0,
            amplitude_m: 0.0,
            ln_life: 0.0,
            level_m: k as f64,
            new_m: 0.0,
            swing_m: 0.0,
            guess: Guess::Unneeded,
            waits: false,
            weight,
        };
        weights.enumerate().map(node).collect()
    }

    /// A heavy node among a thousand light ones, of half the weight.
    #[test]
    fn heavy_nodes_stay_and_light_ones_are_thinned_evenly_without_loss_of_weight() {
        let weights = (0..1001).map(|k| if k == 400 { 0.5 } else { 0.0005 });
        let points = thinned(&nodes(weights));
        assert!(points.len().abs_diff(MOST) <= 1, "{}", points.len());
        let total: f64 = points.iter().map(|p| f64::from(p.weight)).sum();
        assert!((total - 1.0).abs() < 0.005, "{total}");
        let heavy = points.iter().find(|p| p.level_m as usize == 400).map(|p| p.weight);
        assert_eq!(heavy, Some(0.5));
        let steps: Vec<f32> = points.windows(2).map(|pair| pair[1].level_m - pair[0].level_m).collect();
        let farthest = (1000_f32 / (MOST - 1) as f32).ceil();
        assert!(steps.iter().all(|step| (1.0..=farthest).contains(step)), "{steps:?}");
        let mean: f64 = points.iter().map(|p| f64::from(p.weight * p.level_m)).sum();
        assert!((mean - (200.0 + 0.5 * 500.2)).abs() < 2.0, "{mean}");
    }

    #[test]
    fn few_nodes_are_kept_as_they_are() {
        let weights: Vec<f64> = (1..=MOST).map(|k| k as f64).collect();
        let kept: Vec<f64> =
            thinned(&nodes(weights.iter().copied())).iter().map(|p| f64::from(p.weight)).collect();
        assert_eq!(kept, weights);
    }
}
