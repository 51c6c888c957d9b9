//! A fleet asked about its own past: how far forecasts have missed what was measured since.
//!
//! No unit needs to have failed for this. Each history is cut, judged as if the rest had not been flown,
//! and asked for the gap at its end. A miss is counted in the forecast's own widths, so what it teaches
//! holds for time as for growth: where the true law is none of the bank's, intervals widen to where the
//! fleet has really been, and lean to the side on which it surprised.

use crate::bins::{self, BINS};
use crate::crossing::{LONG_RULE, WAIT_RULE, waits};
use crate::each::Each;
use crate::level::Weighted;
use crate::posterior::{Node, Posterior, Segment, posterior};
use crate::prior::FleetPrior;

/// Shares of a history that are taken for all there is.
const CUTS: [f64; 3] = [0.3, 0.5, 0.7];

/// Estimates below which a history is not cut.
const FEWEST: usize = 60;

/// Forecast growth below which a cut teaches nothing about wear, metres.
const VISIBLE_M: f64 = 3e-6;

/// How much wider than the mixture has it the future is stated, at least.
///
/// The true law is seldom one of the bank's, so what the gaps say for one curve and against its neighbours
/// is worth less than the likelihood has it: plain 90 % intervals held 85 and 86 % on two simulated
/// fleets. Weights to a power below one would hold as well, but move the middle away from the truth.
pub(crate) const USUAL_WIDTH: f64 = 1.25;

/// Cuts that the usual miss is worth: enough that thirty units may outvote it.
const PSEUDO_CUTS: f64 = 20.0;

/// Where growth really came out, in widths of the forecast: 5 %, 50 % and 95 % of all cuts.
///
/// A width is from the median to the 95 % bound above it, and to the 5 % bound below.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Calibration {
    pub(crate) low: f64,
    pub(crate) middle: f64,
    pub(crate) high: f64,
}

impl Calibration {
    /// What is done to a forecast of which no past is known.
    pub(crate) const USUAL: Self = Self { low: -USUAL_WIDTH, middle: 0.0, high: USUAL_WIDTH };

    /// All that it is.
    pub(crate) fn numbers(&self) -> [f64; 3] {
        [self.low, self.middle, self.high]
    }

    /// Learns from every cut of some segments.
    pub(crate) fn learn(segments: &[Segment<'_>], prior: &FleetPrior, each: &impl Each) -> Self {
        let misses = each.each(segments, |segment| CUTS.map(|share| miss(segment, share, prior)));
        let misses = misses.into_iter().flatten().flatten().map(|miss| (miss, 1.0));
        let usual = LONG_QUANTILES.map(|z| (USUAL_WIDTH * z, PSEUDO_CUTS / LONG_QUANTILES.len() as f64));
        let misses = Weighted::new(misses.chain(usual));
        let [low, middle, high] = [0.05, 0.5, 0.95].map(|share| misses.quantile(share));
        Self { low: low.min(Self::USUAL.low), middle, high: high.max(Self::USUAL.high) }
    }
}

/// Quantiles at 2.5 %, 7.5 % … 97.5 % of a normal distribution whose 95 % bound is at one.
const LONG_QUANTILES: [f64; 20] = [
    -1.192, -0.875, -0.699, -0.568, -0.459, -0.363, -0.276, -0.194, -0.115, -0.038, 0.038, 0.115, 0.194,
    0.276, 0.363, 0.459, 0.568, 0.699, 0.875, 1.192,
];

/// How far the gap at a segment's end lies from what its first estimates foretold, in widths.
fn miss(segment: &Segment<'_>, share: f64, prior: &FleetPrior) -> Option<f64> {
    let count = segment.estimates.len();
    if count < FEWEST {
        return None;
    }
    let seen = &segment.estimates[..(share * count as f64) as usize];
    let now = seen.last()?.usage;
    let judged = posterior(&Segment { estimates: seen, now, ..*segment }, prior)?;
    let end = bins::bin(segment.estimates, BINS).pop()?;
    let moved = f64::from(u8::from(seen.last()?.installation != end.installation));
    let variance_m2 = end.variance_m2 + 2.0 * moved * prior.bias_sd_m.powi(2);
    let [low_m, middle_m, high_m] = foretold(&judged, end.usage - now, variance_m2, prior);
    let level_m: f64 = judged.nodes.iter().map(|n| n.weight * n.level_m).sum();
    let off_m = end.gap_m - middle_m;
    let width_m = if off_m > 0.0 { high_m - middle_m } else { middle_m - low_m };
    (middle_m - level_m > VISIBLE_M && width_m > 0.0).then(|| off_m / width_m)
}

/// 5 %, 50 % and 95 % bounds of the gap after more usage, as measured with some variance.
pub(crate) fn foretold(judged: &Posterior, usage: f64, variance_m2: f64, prior: &FleetPrior) -> [f64; 3] {
    let mut points = Vec::with_capacity(LONG_RULE.len() * judged.nodes.len() / 2);
    let mut add = |node: &Node, grown_m: f64, share: f64| {
        let sd_m = (judged.level_m2 + variance_m2 + prior.wear_noise_m * grown_m).sqrt();
        let point =
            |(z, weight): (f64, f64)| (node.level_m + grown_m + z * sd_m, node.weight * share * weight);
        points.extend(LONG_RULE.map(point));
    };
    for node in judged.notable() {
        if node.waits {
            let rate = prior.span_m / node.ln_life.exp();
            for wait in waits(prior) {
                add(node, rate * (usage - wait).max(0.0), 1.0 / WAIT_RULE as f64);
            }
        } else {
            let grown = node.law.height(node.age_now + usage) - node.law.height(node.age_now);
            add(node, node.amplitude_m * grown, 1.0);
        }
    }
    let points = Weighted::new(points.into_iter());
    [0.05, 0.5, 0.95].map(|share| points.quantile(share))
}
