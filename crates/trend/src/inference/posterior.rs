//! Posterior of every candidate of the bank, given a segment's bins: weights, amplitudes, levels.

use crate::data::bins::{self, Segment};
use crate::inference::level_filter::Regression;
use crate::inference::segment_fit::{SegmentFit, linear_growth};
use crate::math::ln_peak_density;
use crate::prior::FleetPrior;
use crate::wear::bank::{Candidate, WearLaw, candidates};
use crate::wear::{AgeAssumption, Component};

/// Bins of the first pass, which drops most curves.
const COARSE_BINS: usize = 12;

/// What a prior over lives and cells can add to a curve's bound.
const SLACK: f64 = 3.0;

/// Usual maximum distance of a curve's weight below its bound.
const USUAL: f64 = 20.0;

/// Standard deviations within which a life may lie.
const LIFE_REACH: f64 = 3.5;

/// Lives tried for each curve, and over how many standard deviations of its amplitude: enough to weigh a curve, and
/// enough to state quantiles.
const ROUGH: (usize, f64) = (3, 1.7);
const THOROUGH: (usize, f64) = (7, 3.5);

/// Log weight below the best at which a curve is dropped.
const DROP: f64 = 7.0;

/// A mixture over the bank.
#[derive(Debug, Clone)]
pub(crate) struct Posterior {
    pub(crate) components: Vec<Component>,
    /// Variance of the level, the same for every component.
    pub(crate) level_m2: f64,
    /// Variance of the growth since the segment began, the same for every component.
    pub(crate) growth_m2: f64,
    /// Log of the sum of the weights before they were normalised.
    pub(crate) log_evidence: f64,
}

impl Posterior {
    /// The components whose weight can move a quantile.
    pub(crate) fn significant_components(&self) -> impl Iterator<Item = &Component> {
        let negligible = self.negligible();
        self.components.iter().filter(move |n| n.weight > negligible)
    }

    /// Weight, a share of the largest, up to which a component cannot move a quantile.
    pub(crate) fn negligible(&self) -> f64 {
        2e-3 * self.components.iter().map(|n| n.weight).fold(0.0, f64::max)
    }
}

/// Fits the curves of the bank to a segment: all of them on a few bins, the likely ones on many.
///
/// The level walks by a variance proportional to the wear, so the first pass assumes wear along a
/// line and the second takes it from the first.
pub(crate) fn posterior(segment: &Segment<'_>, prior: &FleetPrior) -> Option<Posterior> {
    let span = segment.now - segment.begin;
    if segment.estimates.is_empty() || span <= 0.0 {
        return None;
    }
    let starts = segment.estimates.len().clamp(1, bins::BINS) / 2 + 1;
    let is_tried = |law| prior.includes_law(law);
    let mut bank = candidates(segment.known_age, span, starts, is_tried);
    let coarse = bins::bin(segment.estimates, COARSE_BINS);
    let grown_m = linear_growth(&coarse);
    let first = SegmentFit::new(segment, prior, coarse, |usage| grown_m * usage / span);
    if segment.estimates.len() <= COARSE_BINS {
        return finish(&first, components(&first, &bank, THOROUGH));
    }
    let mut believed = components(&first, &bank, ROUGH);
    normalise(&mut believed);
    if believed.is_empty() {
        return None;
    }
    // Components are in the order of the bank.
    let mut kept = believed.iter().peekable();
    bank.retain(|c| {
        std::iter::from_fn(|| kept.next_if(|n| (n.law, n.age_begin) == (c.law, c.age))).count() > 0
    });
    let likely = likeliest(believed);
    let fine = bins::bin(segment.estimates, bins::BINS);
    let second = SegmentFit::new(segment, prior, fine, |usage| mean_growth(&likely, usage));
    finish(&second, components(&second, &bank, THOROUGH))
}

/// The posterior; `None` if the gaps are so far from every curve that no likelihood is a number.
fn finish(fit: &SegmentFit<'_>, mut components: Vec<Component>) -> Option<Posterior> {
    let log_sum = normalise(&mut components);
    (!components.is_empty()).then(|| Posterior {
        components,
        level_m2: fit.level_m2(),
        growth_m2: fit.filter.end_m2 + fit.filter.start_m2,
        log_evidence: log_sum + fit.shared_log_likelihood(),
    })
}

/// The likeliest components, with weights that add up to one: enough for a mean.
fn likeliest(mut components: Vec<Component>) -> Vec<Component> {
    const FEW: usize = 10;
    if FEW < components.len() {
        components.select_nth_unstable_by(FEW, |a, b| b.weight.total_cmp(&a.weight));
        components.truncate(FEW);
    }
    let total: f64 = components.iter().map(|n| n.weight).sum();
    debug_assert!(total > 0.0 && total < 1.0 + 1e-9, "weights of components add up to {total}");
    for component in &mut components {
        component.weight /= total;
    }
    components
}

/// Wear up to a usage since the segment's begin, of units new at the age of zero.
pub(crate) fn mean_growth(components: &[Component], usage: f64) -> f64 {
    components.iter().map(|n| n.weight * n.amplitude_m * n.law.value(n.age_begin + usage)).sum()
}

/// Turns log weights into weights that add up to one, drops negligible ones, and returns the log
/// of their sum.
fn normalise(components: &mut Vec<Component>) -> f64 {
    let best = components.iter().map(|n| n.weight).fold(f64::NEG_INFINITY, f64::max);
    if !best.is_finite() {
        components.clear();
        return f64::NEG_INFINITY;
    }
    components.retain(|n| n.weight > best - DROP);
    components.iter_mut().for_each(|n| n.weight = (n.weight - best).exp());
    let sum: f64 = components.iter().map(|n| n.weight).sum();
    components.iter_mut().for_each(|n| n.weight /= sum);
    best + sum.ln()
}

/// A curve's regression, the amplitude it fits best, and a bound on its log weight.
struct ScoredCandidate<'a> {
    candidate: &'a Candidate,
    pass: Regression,
    best_m: f64,
    information: f64,
    bound: f64,
}

/// Curves that go through the filter together: each step of a curve waits for the one before it, and other curves fill
/// the time.
const LANES: usize = 4;

/// Every curve of the bank against the bins.
fn scored_candidates<'a>(fit: &SegmentFit<'_>, bank: &'a [Candidate]) -> Vec<ScoredCandidate<'a>> {
    let usages: Vec<f64> = fit.bins.iter().map(|bin| bin.usage - fit.segment.begin).collect();
    let mut scored = Vec::with_capacity(bank.len());
    for of_lanes in bank.chunks(LANES) {
        let height = |usage: &f64| {
            let of = |lane| of_lanes.get(lane).map_or(0.0, |c: &Candidate| c.law.value(c.age + usage));
            std::array::from_fn::<f64, LANES, _>(of)
        };
        let heights: Vec<[f64; LANES]> = usages.iter().map(height).collect();
        let passes = fit.filter.regress_lanes(&fit.gaps, &fit.wave, &heights);
        let of = |(candidate, pass)| scored_candidate(fit, candidate, fit.with_season(pass));
        scored.extend(of_lanes.iter().zip(passes).map(of));
    }
    scored
}

/// Components, with log weights, of every curve that can matter.
fn components(fit: &SegmentFit<'_>, bank: &[Candidate], tried: (usize, f64)) -> Vec<Component> {
    let scored_candidates = scored_candidates(fit, bank);
    let of = |scored: &ScoredCandidate<'_>| match scored.candidate.law {
        WearLaw::None => flat(fit).to_vec(),
        _ => try_lives(fit, scored, tried),
    };
    let Some(top) = scored_candidates.iter().max_by(|a, b| a.bound.total_cmp(&b.bound)) else {
        return Vec::new();
    };
    let best = of(top).iter().map(|component| component.weight).fold(f64::NEG_INFINITY, f64::max);
    // Where the prior excludes the best fit, its bound does not bound the others.
    let floor = top.bound.min(best + USUAL) - DROP - SLACK;
    let matters = |c: &&ScoredCandidate<'_>| c.bound > floor || c.candidate.law == WearLaw::None;
    scored_candidates.iter().filter(matters).flat_map(of).collect()
}

/// The amplitude that fits the gaps and a new unit's gap best, were amplitudes free.
fn scored_candidate<'a>(
    fit: &SegmentFit<'_>,
    candidate: &'a Candidate,
    pass: Regression,
) -> ScoredCandidate<'a> {
    let spread = fit.new_m2;
    let off_m = fit.gaps.start - fit.prior.new_m;
    let information = pass.sff + pass.start * pass.start / spread;
    let best_m = if candidate.law == WearLaw::None {
        0.0
    } else {
        ((pass.sfy + pass.start * off_m / spread) / information).max(0.0)
    };
    let log_likelihood = best_m * pass.sfy - 0.5 * best_m * best_m * pass.sff;
    let new_m2 = spread + (best_m * candidate.age_spread).powi(2);
    let bound = log_likelihood - 0.5 * (off_m - best_m * pass.start).powi(2) / new_m2
        + fit.logs.shares[candidate.law.family()];
    ScoredCandidate { candidate, pass, best_m, information, bound }
}

/// Components of one curve over the lives its amplitude may have, with log weights.
fn try_lives(
    fit: &SegmentFit<'_>,
    scored_candidate: &ScoredCandidate<'_>,
    (count, reach): (usize, f64),
) -> Vec<Component> {
    let ScoredCandidate { candidate, pass, best_m, information, .. } = scored_candidate;
    let (prior, spread) = (fit.prior, fit.new_m2);
    let reach_m = reach / information.sqrt();
    let Some((low, high)) = life_range(prior, candidate.law, best_m - reach_m, best_m + reach_m) else {
        return Vec::new();
    };
    let step = (high - low) / (count - 1) as f64;
    let age_now = candidate.age + fit.segment.now - fit.segment.begin;
    let (height_now, ln_age) = (candidate.law.value(age_now), candidate.age.ln());
    let age_assumption = match candidate.law {
        _ if fit.segment.known_age.is_some() => AgeAssumption::NotNeeded,
        WearLaw::Onset { .. } => AgeAssumption::NotNeeded,
        _ if candidate.age > 0.0 => AgeAssumption::Worn,
        _ => AgeAssumption::Fresh,
    };
    let component = |i: usize| {
        let ln_life = low + step * i as f64;
        let amplitude_m = prior.span_m / candidate.law.growth_in(ln_life.exp());
        let new_m = fit.gaps.start - amplitude_m * pass.start;
        let smeared = (amplitude_m * candidate.age_spread).powi(2) / spread;
        let log_likelihood = amplitude_m * pass.sfy
            - 0.5 * amplitude_m * amplitude_m * pass.sff
            - 0.5
                * ((new_m - prior.new_m).powi(2) / (spread * (1.0 + smeared))
                    + fit.ln_new_m2
                    + smeared.ln_1p());
        let component = Component {
            law: candidate.law,
            age_begin: candidate.age,
            age_now,
            amplitude_m,
            ln_life,
            level_m: fit.gaps.end + amplitude_m * (height_now - pass.end),
            new_m,
            age_assumption,
            onset_pending: false,
            weight: 0.0,
        };
        let grid = step.ln() + candidate.ln_cell + ln_density_in_grid(candidate, ln_age, &component);
        Component { weight: log_likelihood + grid + fit.logs.of(&component), ..component }
    };
    (0..count).map(component).collect()
}

/// A unit first seen in service has seldom used more than this share of its life: an age beyond it is
/// less likely by this power of how far. Forbidden outright, an overdue unit would have no curve at all.
const WORN_SHARE: f64 = 0.9;
const OVERDUE: f64 = 20.0;

/// Log density of a candidate's time constant and of its age at first sight, given its life: the same for every fleet.
fn ln_density_in_grid(candidate: &Candidate, ln_age: f64, component: &Component) -> f64 {
    let life = candidate.ln_life.map_or(0.0, |(ln_life, sd)| {
        let z = (component.ln_life - ln_life) / sd;
        ln_peak_density(sd) - 0.5 * z * z
    });
    if component.age_assumption == AgeAssumption::Worn {
        let used = ln_age - WORN_SHARE.ln() - component.ln_life;
        return life - WORN_SHARE.ln() - component.ln_life - OVERDUE * used.max(0.0);
    }
    life
}

/// The unit that does not wear, and the one whose onset is yet to come.
fn flat(fit: &SegmentFit<'_>) -> [Component; 2] {
    let SegmentFit { prior, logs, segment, gaps, .. } = fit;
    let log_likelihood = -0.5 * ((gaps.start - prior.new_m).powi(2) / fit.new_m2 + fit.ln_new_m2);
    let component = Component {
        law: WearLaw::None,
        age_begin: 0.0,
        age_now: segment.now - segment.begin,
        amplitude_m: 0.0,
        ln_life: prior.ln_life,
        level_m: gaps.end,
        new_m: gaps.start,
        age_assumption: AgeAssumption::NotNeeded,
        onset_pending: false,
        weight: 0.0,
    };
    [component, Component { onset_pending: true, ..component }]
        .map(|component| Component { weight: log_likelihood + logs.of(&component), ..component })
}

/// Range of ln life worth trying: where the amplitude may be, within what a life may be.
fn life_range(prior: &FleetPrior, law: WearLaw, low_m: f64, high_m: f64) -> Option<(f64, f64)> {
    let reach = LIFE_REACH * prior.ln_life_sd;
    let (shortest, longest) = (prior.ln_life - reach, prior.ln_life + reach);
    let ln_life = |amplitude_m: f64| law.life_of(prior.span_m / amplitude_m).ln();
    let low = ln_life(high_m).max(shortest);
    let high = if low_m > 0.0 { ln_life(low_m).min(longest) } else { longest };
    (low < high).then_some((low, high))
}
