//! A mixture moved on by a few estimates that follow: each node's level by a Kalman step, its weight by
//! Bayes' theorem.
//!
//! A node is a curve with one amplitude. Beside it the level walks and the season swings by an amount of
//! the unit's own, so its state is two numbers, and their gains are those of every node:
//!
//! ```text
//! e = y − (L + A (F(u) − F(u₀)) + s w)      s swing, w the season's wave then, P their covariance
//! S = P_LL + 2 w P_Ls + w² P_ss + R         R the bin's variance; P_LL has walked since the bin before
//! (L, s) += (P_LL + w P_Ls, P_Ls + w P_ss) e/S,   ln weight −= e²/2S
//! ```

use crate::bins::Bin;
use crate::posterior::{Node, Posterior};
use crate::prior::FleetPrior;

/// Standard deviations by which a bin may miss what the mixture foretells of it.
const REACH: f64 = 4.0;

/// Where a mixture stands: the usage, and the installation of its last estimate.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Place {
    pub(crate) usage: f64,
    pub(crate) installation: u32,
}

/// Moves a mixture from a place through some bins to a later usage; nothing where a bin lies so far off
/// that other curves than those of the mixture may explain it better.
pub(crate) fn advance(
    mut judged: Posterior,
    place: Place,
    bins: &[Bin],
    now: f64,
    prior: &FleetPrior,
) -> Option<Posterior> {
    let mut walked = Walked::new(&judged, place, prior);
    for bin in bins {
        walked.to(bin.usage, &mut judged);
        walked.weigh(bin, &mut judged)?;
    }
    walked.to(now, &mut judged);
    Some(walked.done(judged, now))
}

/// How far a mixture has come.
struct Walked<'a> {
    prior: &'a FleetPrior,
    begin: f64,
    at: Place,
    /// Every node's height here.
    heights: Vec<f64>,
    /// What the mixture's mean has grown since the last bin, metres.
    grown_m: f64,
    /// What was added to each node's log weight.
    log_weights: Vec<f64>,
    /// Usage of the last bin.
    seen: f64,
    start_m2: f64,
}

impl<'a> Walked<'a> {
    fn new(judged: &Posterior, at: Place, prior: &'a FleetPrior) -> Self {
        let heights: Vec<f64> = judged.nodes.iter().map(|n| n.law.height(n.age_now)).collect();
        // The level walks from the last bin on, and has not done so yet.
        let grown_m = |(node, height): (&Node, &f64)| {
            node.weight * node.amplitude_m * (height - node.law.height(node.age_now - judged.since))
        };
        Self {
            prior,
            begin: at.usage,
            at,
            grown_m: judged.nodes.iter().zip(&heights).map(grown_m).sum(),
            heights,
            log_weights: vec![0.0; judged.nodes.len()],
            seen: at.usage - judged.since,
            start_m2: judged.growth_m2 - still_m2(judged),
        }
    }

    /// Lets every node wear up to a usage.
    fn to(&mut self, usage: f64, judged: &mut Posterior) {
        let used = usage - self.begin;
        for (node, height) in judged.nodes.iter_mut().zip(&mut self.heights) {
            let later = node.law.height(node.age_now + used);
            let grown_m = node.amplitude_m * (later - *height);
            node.level_m += grown_m;
            self.grown_m += node.weight * grown_m;
            *height = later;
        }
        self.at.usage = usage;
    }

    /// Weighs every node by a bin.
    fn weigh(&mut self, bin: &Bin, judged: &mut Posterior) -> Option<()> {
        let prior = self.prior;
        let moved = f64::from(u8::from(bin.installation != self.at.installation));
        judged.level_m2 += prior.wear_noise_m * self.grown_m.max(0.0)
            + prior.drift_m2_per_hour * (self.at.usage - self.seen).max(0.0)
            + 2.0 * moved * prior.bias_sd_m.powi(2);
        (self.grown_m, self.seen, self.at.installation) = (0.0, self.at.usage, bin.installation);
        let wave = prior.season.wave(bin.departure_us);
        let level_m2 = judged.level_m2 + wave * judged.level_swing_m2;
        let swing_m2 = judged.level_swing_m2 + wave * judged.swing_m2;
        let variance_m2 = level_m2 + wave * swing_m2 + bin.variance_m2;
        let seen_m = bin.gap_m - prior.season.mean_m * wave;
        let off_m = |node: &Node| seen_m - node.level_m - node.swing_m * wave;
        let mean_m: f64 = judged.nodes.iter().map(|n| n.weight * off_m(n)).sum();
        let spread_m2: f64 = judged.nodes.iter().map(|n| n.weight * (off_m(n) - mean_m).powi(2)).sum();
        // Also false where one of them is not a number.
        let is_expected = mean_m * mean_m <= REACH * REACH * (variance_m2 + spread_m2);
        for (node, log_weight) in judged.nodes.iter_mut().zip(&mut self.log_weights) {
            let off_m = off_m(node);
            node.level_m += level_m2 / variance_m2 * off_m;
            node.swing_m += swing_m2 / variance_m2 * off_m;
            *log_weight -= 0.5 * off_m * off_m / variance_m2;
        }
        judged.level_m2 -= level_m2 * level_m2 / variance_m2;
        judged.level_swing_m2 -= level_m2 * swing_m2 / variance_m2;
        judged.swing_m2 -= swing_m2 * swing_m2 / variance_m2;
        is_expected.then_some(())
    }

    /// The weights made to add up to one, an onset still to come having become less likely.
    fn done(self, mut judged: Posterior, now: f64) -> Posterior {
        let used = now - self.begin;
        let best = self.log_weights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        for (node, log_weight) in judged.nodes.iter_mut().zip(&self.log_weights) {
            let waited = if node.waits { self.prior.onsets_per_hour * used } else { 0.0 };
            node.weight *= (log_weight - best - waited).exp();
            node.age_now += used;
        }
        let total: f64 = judged.nodes.iter().map(|n| n.weight).sum();
        judged.nodes.iter_mut().for_each(|n| n.weight /= total);
        judged.since = now - self.seen;
        judged.growth_m2 = self.start_m2 + still_m2(&judged);
        judged
    }
}

/// Variance of the level, were the season known.
fn still_m2(judged: &Posterior) -> f64 {
    judged.level_m2 - judged.level_swing_m2 * judged.level_swing_m2 / judged.swing_m2
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::curve::Law;
    use crate::posterior::Guess;

    const HERE: Place = Place { usage: 100.0, installation: 0 };

    /// Two nodes that do not wear, at 20 and 22 µm, one as likely as the other, known to 1 µm.
    fn judged() -> Posterior {
        let node = |level_m: f64| Node {
            law: Law::None,
            age_begin: 0.0,
            age_now: 100.0,
            amplitude_m: 0.0,
            ln_life: 8.0,
            level_m,
            new_m: 20e-6,
            swing_m: 0.0,
            guess: Guess::Unneeded,
            waits: false,
            weight: 0.5,
        };
        Posterior {
            nodes: vec![node(20e-6), node(22e-6)],
            since: 0.0,
            level_m2: 1e-12,
            growth_m2: 1.5e-12,
            swing_m2: 1e-30,
            level_swing_m2: 0.0,
            log_evidence: 0.0,
        }
    }

    fn bin(gap_m: f64, installation: u32) -> Bin {
        Bin { usage: 110.0, departure_us: 0.0, installation, gap_m, variance_m2: 3e-12 }
    }

    fn prior() -> FleetPrior {
        FleetPrior { drift_m2_per_hour: 0.0, ..FleetPrior::vague(1e-4) }
    }

    /// Variances of 1 and 3 µm²: a gain of ¼ and ¾ µm² left; misses of 2 and 0 µm at a variance of 4 µm²
    /// weigh as e^−½ to 1. By hand.
    #[test]
    fn a_bin_moves_levels_by_its_share_of_the_variance_and_weights_by_bayes() {
        let moved = advance(judged(), HERE, &[bin(22e-6, 0)], 120.0, &prior()).unwrap();
        let close = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-9;
        assert!(close(moved.nodes[0].level_m, 20.5e-6) && close(moved.nodes[1].level_m, 22e-6));
        let odds = (-0.5_f64).exp();
        assert!(close(moved.nodes[0].weight, odds / (1.0 + odds)), "{}", moved.nodes[0].weight);
        assert!(close(moved.level_m2, 0.75e-12) && close(moved.growth_m2, 1.25e-12), "{moved:?}");
        assert!(close(moved.nodes[0].age_now, 120.0));
    }

    /// A new installation adds its bias and leaves the old one's behind: 2 × (1.5 µm)² more, so ¹¹⁄₁₇.
    #[test]
    fn a_new_installation_lets_the_level_move_further() {
        let moved = advance(judged(), HERE, &[bin(22e-6, 1)], 120.0, &prior()).unwrap();
        assert!((moved.nodes[0].level_m - (20e-6 + 2e-6 * 11.0 / 17.0)).abs() < 1e-15, "{moved:?}");
    }

    #[test]
    fn a_bin_far_off_is_not_explained() {
        assert!(advance(judged(), HERE, &[bin(31e-6, 0)], 120.0, &prior()).is_none());
        assert!(advance(judged(), HERE, &[bin(f64::NAN, 0)], 120.0, &prior()).is_none());
    }

    /// In 20 h of an onset every 2,000 h.
    #[test]
    fn an_onset_that_does_not_come_is_less_awaited() {
        let mut judged = judged();
        judged.nodes[1].waits = true;
        let moved = advance(judged, HERE, &[], 120.0, &prior()).unwrap();
        let odds = moved.nodes[1].weight / moved.nodes[0].weight;
        assert!((odds - (-0.01_f64).exp()).abs() < 1e-12, "{odds}");
    }
}
