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
        Self {
            prior,
            begin: at.usage,
            at,
            heights: judged.nodes.iter().map(|n| n.law.height(n.age_now)).collect(),
            grown_m: 0.0,
            log_weights: vec![0.0; judged.nodes.len()],
            seen: at.usage,
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
        judged.growth_m2 = self.start_m2 + still_m2(&judged);
        judged
    }
}

/// Variance of the level, were the season known.
fn still_m2(judged: &Posterior) -> f64 {
    judged.level_m2 - judged.level_swing_m2 * judged.level_swing_m2 / judged.swing_m2
}
