//! What a segment's bins say about every curve of the bank: weights, amplitudes, levels.

use crate::bins;
use crate::clean::Estimate;
use crate::curve::{Bank, Curve, Law, power_of_ln_life};
use crate::filter::Regression;
use crate::look::{Look, straight_growth};
use crate::prior::FleetPrior;
use crate::regressions::regressions;

/// Bins of the first look, by which most curves are dropped.
const COARSE_BINS: usize = 12;

/// What a prior over lives and cells can add to a curve's bound.
const SLACK: f64 = 3.0;

/// By how much a curve's weight usually stays below its bound, at most.
const USUAL: f64 = 20.0;

/// Standard deviations within which a life may lie.
const LIFE_REACH: f64 = 3.5;

/// How many lives are tried for each curve, over how many standard deviations of its amplitude.
#[derive(Debug, Clone, Copy)]
struct Lives {
    count: usize,
    reach: f64,
    /// Log weight below the best at which a curve is dropped.
    drop: f64,
}

/// Enough to weigh a curve, and enough to state quantiles.
const ROUGH: Lives = Lives { count: 3, reach: 1.7, drop: 7.0 };
const THOROUGH: Lives = Lives { count: 7, reach: 3.5, drop: 7.0 };

/// A stretch of a unit's history without maintenance that resets it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Segment<'a> {
    pub(crate) estimates: &'a [Estimate],
    /// Usage at which it began and at which it is judged.
    pub(crate) begin: f64,
    pub(crate) now: f64,
    /// New or just reset when it began.
    pub(crate) fresh: bool,
    /// Age when it began, if the books know it.
    pub(crate) known_age: Option<f64>,
}

impl Segment<'_> {
    /// Whether the age at its begin needs no guessing.
    pub(crate) fn is_of_known_age(&self) -> bool {
        self.fresh || self.known_age.is_some()
    }
}

/// What had to be guessed of a unit's age at first sight, where the law makes a difference.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Guess {
    Unneeded,
    Fresh,
    Worn,
}

/// One law with one amplitude, and how much it is believed.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Node {
    pub(crate) law: Law,
    /// Usage at the segment's begin on the law's own clock, and at its end.
    pub(crate) age_begin: f64,
    pub(crate) age_now: f64,
    /// Metres per unit of height.
    pub(crate) amplitude_m: f64,
    pub(crate) ln_life: f64,
    /// The gap now, metres.
    pub(crate) level_m: f64,
    /// The gap of this unit when new, metres.
    pub(crate) new_m: f64,
    /// The unit's own swing beside the fleet's mean one, metres.
    pub(crate) swing_m: f64,
    /// What had to be guessed of its age at first sight.
    pub(crate) guess: Guess,
    /// Onset not seen yet: it comes after an exponential wait.
    pub(crate) waits: bool,
    /// Log weight, then (normalised) weight.
    pub(crate) weight: f64,
}

/// A mixture over the bank.
#[derive(Debug, Clone)]
pub(crate) struct Posterior {
    pub(crate) nodes: Vec<Node>,
    /// Usage since the bin whose level it is: wear has gone on, as the curves have it.
    pub(crate) since: f64,
    /// Variance of every node's level.
    pub(crate) level_m2: f64,
    /// Variance of every node's growth since the segment began.
    pub(crate) growth_m2: f64,
    /// Variance of every node's swing, and its covariance with the level.
    pub(crate) swing_m2: f64,
    pub(crate) level_swing_m2: f64,
    /// Log of the sum of the weights before they were normalised.
    pub(crate) log_evidence: f64,
}

impl Posterior {
    /// The nodes that can move a quantile.
    pub(crate) fn notable(&self) -> impl Iterator<Item = &Node> {
        let least = self.negligible();
        self.nodes.iter().filter(move |n| n.weight > least)
    }

    /// Without the nodes that can move none.
    pub(crate) fn pruned(mut self) -> Self {
        let least = self.negligible();
        self.nodes.retain(|n| n.weight > least);
        self
    }

    /// The weight, a share of the largest, below which a node cannot move a quantile.
    fn negligible(&self) -> f64 {
        2e-3 * self.nodes.iter().map(|n| n.weight).fold(0.0, f64::max)
    }
}

/// Judges a segment by a prior: all curves on a few bins, the likely ones on many.
///
/// The level walks by a variance proportional to the wear, so the first look assumes wear along a
/// line and the second takes it from the first.
pub(crate) fn posterior(segment: &Segment<'_>, prior: &FleetPrior) -> Option<Posterior> {
    let span = segment.now - segment.begin;
    if segment.estimates.is_empty() || span <= 0.0 {
        return None;
    }
    let starts = segment.estimates.len().clamp(1, bins::BINS) / 2 + 1;
    let mut bank = Bank::new(segment.fresh, segment.known_age, span, starts, |law| prior.tries(law));
    let coarse = bins::bin(segment.estimates, COARSE_BINS);
    let grown_m = straight_growth(&coarse);
    let first = Look::new(segment, prior, coarse, |usage| grown_m * usage / span);
    if segment.estimates.len() <= COARSE_BINS {
        return Some(finish(&first, nodes(&first, &bank, THOROUGH)));
    }
    let mut believed = nodes(&first, &bank, ROUGH);
    normalise(&mut believed, ROUGH.drop);
    keep(&mut bank.curves, &believed);
    let likely = likeliest(&believed);
    let fine = bins::bin(segment.estimates, bins::BINS);
    let second = Look::new(segment, prior, fine, |usage| mean_growth(&likely, usage));
    let believed = nodes(&second, &bank, THOROUGH);
    Some(finish(&second, believed))
}

/// Leaves only the curves that are believed.
fn keep(curves: &mut Vec<Curve>, believed: &[(usize, Node)]) {
    let mut kept: Vec<usize> = believed.iter().map(|(index, _)| *index).collect();
    kept.dedup();
    *curves = kept.into_iter().map(|index| curves[index]).collect();
}

fn finish(look: &Look<'_>, mut believed: Vec<(usize, Node)>) -> Posterior {
    let log_sum = normalise(&mut believed, THOROUGH.drop);
    Posterior {
        nodes: believed.into_iter().map(|(_, node)| node).collect(),
        since: look.segment.now - look.bins.last().map_or(look.segment.begin, |bin| bin.usage),
        level_m2: look.level_m2(),
        growth_m2: look.filter.end_m2 + look.filter.start_m2,
        swing_m2: look.swing_m2,
        level_swing_m2: look.level_swing_m2(),
        log_evidence: log_sum + look.shared_log_likelihood(),
    }
}

/// The likeliest nodes, with weights that add up to one: enough for a mean.
fn likeliest(believed: &[(usize, Node)]) -> Vec<Node> {
    const FEW: usize = 10;
    let mut nodes: Vec<Node> = believed.iter().map(|(_, node)| *node).collect();
    if FEW < nodes.len() {
        nodes.select_nth_unstable_by(FEW, |a, b| b.weight.total_cmp(&a.weight));
        nodes.truncate(FEW);
    }
    let total: f64 = nodes.iter().map(|n| n.weight).sum();
    for node in &mut nodes {
        node.weight /= total;
    }
    nodes
}

/// Wear up to a usage since the segment's begin, of units new at the age of zero.
pub(crate) fn mean_growth(nodes: &[Node], usage: f64) -> f64 {
    nodes.iter().map(|n| n.weight * n.amplitude_m * n.law.height(n.age_begin + usage)).sum()
}

/// Turns log weights into weights that add up to one, drops what is not believed, and returns the log
/// of their sum.
fn normalise(believed: &mut Vec<(usize, Node)>, drop: f64) -> f64 {
    let best = believed.iter().map(|(_, n)| n.weight).fold(f64::NEG_INFINITY, f64::max);
    believed.retain(|(_, n)| n.weight > best - drop);
    let mut sum = 0.0;
    for (_, node) in believed.iter_mut() {
        node.weight = (node.weight - best).exp();
        sum += node.weight;
    }
    for (_, node) in believed.iter_mut() {
        node.weight /= sum;
    }
    best + sum.ln()
}

/// A curve's regression, the amplitude it fits best, and a bound on its log weight.
struct Candidate {
    index: usize,
    pass: Regression,
    best_m: f64,
    information: f64,
    bound: f64,
}

/// Every curve of the bank against the bins.
fn candidates(look: &Look<'_>, bank: &Bank) -> Vec<Candidate> {
    let passes = regressions(look, bank).into_iter().map(|pass| look.beside_season(pass));
    let curves = bank.curves.iter().enumerate();
    curves.zip(passes).map(|((index, curve), pass)| candidate(look, index, curve, pass)).collect()
}

/// The nodes, with log weights, of every curve that can matter.
fn nodes(look: &Look<'_>, bank: &Bank, tried: Lives) -> Vec<(usize, Node)> {
    let candidates = candidates(look, bank);
    let add = |candidate: &Candidate, least: f64, push: &mut dyn FnMut(Node)| {
        let curve = &bank.curves[candidate.index];
        if curve.law == Law::None {
            flat(look, push);
        } else {
            lives(look, curve, candidate, (tried, least), push);
        }
    };
    let mut nodes = Vec::with_capacity(1000);
    let Some(top) = candidates.iter().max_by(|a, b| a.bound.total_cmp(&b.bound)) else { return nodes };
    let mut best = f64::NEG_INFINITY;
    add(top, best, &mut |node| best = best.max(node.weight));
    // Where the prior forbids what fits best, its bound says nothing of the others.
    let floor = top.bound.min(best + USUAL) - tried.drop - SLACK;
    let flat = bank.curves.iter().position(|curve| curve.law == Law::None);
    for candidate in candidates.iter().filter(|c| c.bound > floor || Some(c.index) == flat) {
        add(candidate, best - tried.drop, &mut |node| {
            best = best.max(node.weight);
            if node.weight > best - tried.drop {
                nodes.push((candidate.index, node));
            }
        });
    }
    nodes
}

/// The amplitude that fits the gaps and a new unit's gap best, were amplitudes free.
fn candidate(look: &Look<'_>, index: usize, curve: &Curve, pass: Regression) -> Candidate {
    let spread = look.new_m2;
    let off_m = look.gaps.start - look.prior.new_m;
    let information = pass.sff + pass.start * pass.start / spread;
    let best_m = if curve.law == Law::None {
        0.0
    } else {
        ((pass.sfy + pass.start * off_m / spread) / information).max(0.0)
    };
    let log_likelihood = best_m * pass.sfy - 0.5 * best_m * best_m * pass.sff;
    let new_m2 = spread + (best_m * curve.smear).powi(2);
    let bound =
        log_likelihood - 0.5 * (off_m - best_m * pass.start).powi(2) / new_m2 + look.logs.share(curve.law);
    Candidate { index, pass, best_m, information, bound }
}

/// Nodes of one curve over the lives its amplitude may have, of more than the least log weight.
fn lives(
    look: &Look<'_>,
    curve: &Curve,
    candidate: &Candidate,
    (tried, least): (Lives, f64),
    push: &mut dyn FnMut(Node),
) {
    let Candidate { pass, best_m, information, .. } = candidate;
    let prior = look.prior;
    let reach_m = tried.reach / information.sqrt();
    let Some((low, high)) = life_range(prior, curve.law, best_m - reach_m, best_m + reach_m) else { return };
    let step = (high - low) / (tried.count - 1) as f64;
    let spread = look.new_m2;
    let age_now = curve.age + look.segment.now - look.segment.begin;
    let mut height_now = None;
    let shared = step.ln() + look.logs.share(curve.law) + look.logs.cell(curve, look.segment);
    let own = look.logs.own_time(curve);
    let guess = match curve.law {
        _ if look.segment.is_of_known_age() => Guess::Unneeded,
        Law::Onset { .. } => Guess::Unneeded,
        _ if curve.age > 0.0 => Guess::Worn,
        _ => Guess::Fresh,
    };
    let ln_age = (curve.age > 0.0 && !look.segment.is_of_known_age()).then_some(curve.ln_age);
    let mut amplitudes = Amplitudes::new(curve.law, prior.span_m, low, step);
    for i in 0..tried.count {
        let (ln_life, amplitude_m) = (low + step * i as f64, amplitudes.next());
        let new_m = look.gaps.start - amplitude_m * pass.start;
        let smeared = (amplitude_m * curve.smear).powi(2) / spread;
        let log_likelihood = amplitude_m * pass.sfy
            - 0.5 * amplitude_m * amplitude_m * pass.sff
            - 0.5 * ((new_m - prior.new_m).powi(2) / (spread * (1.0 + smeared)) + look.ln_new_m2);
        let bound = log_likelihood + shared + look.logs.life(ln_life, ln_age, own);
        // A logarithm costs more than all the rest, and most nodes do not need it.
        let weight = if smeared > 0.0 && bound > least { bound - 0.5 * (1.0 + smeared).ln() } else { bound };
        if weight <= least {
            continue;
        }
        let height_now = *height_now.get_or_insert_with(|| curve.law.height(age_now));
        push(Node {
            law: curve.law,
            age_begin: curve.age,
            age_now,
            amplitude_m,
            ln_life,
            level_m: look.gaps.end + amplitude_m * (height_now - pass.end),
            new_m,
            swing_m: look.swing_m(amplitude_m * pass.sfs),
            guess,
            waits: false,
            weight,
        });
    }
}

/// A law's amplitudes at lives that grow by one factor.
enum Amplitudes {
    /// They fall by one factor, too.
    Falling { next_m: f64, factor: f64 },
    /// The law is asked for its growth in the next life, hours, which is so much longer than the one before.
    Asked { law: Law, span_m: f64, life: f64, longer: f64 },
}

impl Amplitudes {
    fn new(law: Law, span_m: f64, ln_life: f64, step: f64) -> Self {
        match law.exponent() {
            Some(p) => {
                Self::Falling { next_m: span_m / power_of_ln_life(p, ln_life), factor: (-p * step).exp() }
            }
            None => Self::Asked { law, span_m, life: ln_life.exp(), longer: step.exp() },
        }
    }

    fn next(&mut self) -> f64 {
        match self {
            Self::Falling { next_m, factor } => {
                let falls_m = *next_m * *factor;
                std::mem::replace(next_m, falls_m)
            }
            Self::Asked { law, span_m, life, longer } => {
                let amplitude_m = *span_m / law.height(*life);
                *life *= *longer;
                amplitude_m
            }
        }
    }
}

/// The unit that does not wear, and the one whose onset is yet to come.
fn flat(look: &Look<'_>, push: &mut dyn FnMut(Node)) {
    let Look { prior, logs, segment, gaps, .. } = look;
    let spread = look.new_m2;
    let log_likelihood = -0.5 * ((gaps.start - prior.new_m).powi(2) / spread + look.ln_new_m2);
    let usage = segment.now - segment.begin;
    let node = Node {
        law: Law::None,
        age_begin: 0.0,
        age_now: usage,
        amplitude_m: 0.0,
        ln_life: prior.ln_life,
        level_m: gaps.end,
        new_m: gaps.start,
        swing_m: look.swing_m(0.0),
        guess: Guess::Unneeded,
        waits: false,
        weight: log_likelihood + logs.share(Law::None),
    };
    push(node);
    push(Node { waits: true, weight: log_likelihood + logs.waiting(usage), ..node });
}

/// Range of ln life worth trying: where the amplitude may be, within what a life may be.
fn life_range(prior: &FleetPrior, law: Law, low_m: f64, high_m: f64) -> Option<(f64, f64)> {
    let reach = LIFE_REACH * prior.ln_life_sd;
    let (shortest, longest) = (prior.ln_life - reach, prior.ln_life + reach);
    let ln_life = |amplitude_m: f64| law.ln_life(prior.span_m / amplitude_m);
    let low = ln_life(high_m).max(shortest);
    let high = if low_m > 0.0 { ln_life(low_m).min(longest) } else { longest };
    (low < high).then_some((low, high))
}
