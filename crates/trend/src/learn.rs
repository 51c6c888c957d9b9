//! A fleet teaches a prior: what its units follow, how long they live, by which laws (empirical Bayes).

use std::sync::Arc;

use crate::calibrate::Calibration;
use crate::curve::{FAMILIES, Law};
use crate::each::{Each, InTurn};
use crate::history::{self, History};
use crate::jump::installation_steps;
use crate::posterior::{Guess, Node, Posterior, Segment, posterior};
use crate::prior::{Axis, FleetPrior};
use crate::season::{Season, Swing, swing};
use crate::series::{Booked, Flight, Series};

/// Units looked at, at most: more teach nothing new and cost as much as their own statements.
const MOST_UNITS: usize = 150;

/// Units a prior of nothing is worth: few, so that thirty units outvote it.
const PSEUDO_UNITS: f64 = 15.0;

/// The same for the spread of lives, for a new unit's gap, and for changes of installation.
const PSEUDO_LIVES: f64 = 2.0;
const PSEUDO_CHANGES: f64 = 4.0;

/// Rounds of expectation and maximisation.
const ROUNDS: usize = 8;

/// Noises of wear tried beside the assumed one, as factors of it.
const LESS_WEAR_NOISE: f64 = 0.7;
const MORE_WEAR_NOISE: [f64; 2] = [1.5, 2.2];

impl FleetPrior {
    /// Learns how units wear from what was known of them on a day: which usage wear follows, the shares
    /// of the laws, the spread of lives, a new unit's gap, the season, and what an installation adds.
    ///
    /// The units should be of one design: a part number, or several that differ in life by a factor of
    /// two at most, which then share what they teach. Of a large fleet 150 units are looked at. The
    /// order of the units changes no bit, and nothing later than the day is looked at; a prior of an
    /// earlier day may stand in for a later one's.
    ///
    /// Wear follows `axis` where it is given and the fleet has counted it, else the likeliest one.
    pub fn learn<'a>(
        fleet: impl IntoIterator<Item = &'a Series>,
        as_of_us: i64,
        limit_m: f64,
        axis: Option<Axis>,
    ) -> Self {
        Self::learn_by(fleet, as_of_us, limit_m, axis, &InTurn)
    }

    /// As [`FleetPrior::learn`], with the work on each unit done by whoever has threads: the same bits.
    pub fn learn_by<'a>(
        fleet: impl IntoIterator<Item = &'a Series>,
        as_of_us: i64,
        limit_m: f64,
        axis: Option<Axis>,
        each: &impl Each,
    ) -> Self {
        let read = Read::of(fleet, as_of_us, limit_m, each);
        let assumed = assumed(&read, limit_m, each);
        let along = |axis| Lesson::along(&read, axis, &assumed, each);
        let lesson = axis.and_then(along).or_else(|| likeliest(Axis::ALL.into_iter().filter_map(along)));
        let Some(lesson) = lesson else { return Self::vague(limit_m) };
        lesson.with_likeliest_wear_noise(each).revised(each).calibrated(each)
    }

    /// The median life of units, from new to the act limit, flight hours, as their prior would have it at the
    /// first look: enough to tell designs apart, at a fifth of what [`FleetPrior::learn_by`] costs.
    pub fn glance_life_hours<'a>(
        fleet: impl IntoIterator<Item = &'a Series>,
        as_of_us: i64,
        limit_m: f64,
        each: &impl Each,
    ) -> f64 {
        let read = Read::of(fleet, as_of_us, limit_m, each);
        let assumed = assumed(&read, limit_m, each);
        let lesson = Lesson::along(&read, Axis::Hours, &assumed, each);
        lesson.map_or(assumed, |lesson| lesson.learned).median_life_hours()
    }
}

/// The units that are looked at, and what the flights of each show apart from wear, along hours.
struct Read<'a> {
    units: Vec<Known<'a>>,
    histories: Arc<[History]>,
}

impl<'a> Read<'a> {
    fn of(
        fleet: impl IntoIterator<Item = &'a Series>,
        as_of_us: i64,
        limit_m: f64,
        each: &impl Each,
    ) -> Self {
        let vague = FleetPrior::vague(limit_m);
        let units = sample(fleet.into_iter().map(|series| Known::on(series, as_of_us)));
        // Not from the hours that a unit had when it came: of a few units whose wear began late, curves from
        // their first hour on teach a fleet that never wears.
        let read = |u: &Known<'_>| history::read(u.flights, u.book, None, &vague);
        let histories = each.each(&units, read).into();
        Self { units, histories }
    }

    /// What the flights show along the axis of a prior.
    fn along(&self, prior: &FleetPrior, each: &impl Each) -> Arc<[History]> {
        if prior.axis == Axis::Hours {
            return Arc::clone(&self.histories);
        }
        let both: Vec<(&Known<'_>, &History)> = self.units.iter().zip(&*self.histories).collect();
        each.each(&both, |(unit, history)| history.along(unit.flights, prior)).into()
    }
}

/// What is assumed of a fleet before its laws are asked: what an installation adds, and the season, which
/// are of the measurement whatever wear follows.
fn assumed(read: &Read<'_>, limit_m: f64, each: &impl Each) -> FleetPrior {
    let mut assumed = FleetPrior::vague(limit_m);
    assumed.bias_sd_m = bias(&read.histories, assumed.bias_sd_m);
    let of_segment = |s: &Segment<'_>| swing(s, &assumed, &posterior(s, &assumed)?);
    let swings = each.each(&segments(&read.histories), of_segment);
    let swings: Vec<Swing> = swings.into_iter().flatten().collect();
    assumed.season = Season::learn(&swings);
    assumed
}

/// The same along an axis, by the hours that its unit is worth.
fn along(read: &Read<'_>, axis: Axis, assumed: &FleetPrior) -> Option<FleetPrior> {
    let total = |of: &dyn Fn(&Flight) -> f64| -> f64 {
        read.units.iter().filter_map(|unit| unit.flights.last()).map(of).sum()
    };
    let hours_per_unit = total(&|f| f.hours) / total(&|f| axis.of(f));
    hours_per_unit.is_finite().then(|| FleetPrior { axis, hours_per_unit, ..assumed.clone() })
}

/// The lesson with the largest evidence, the first of equals.
fn likeliest(lessons: impl Iterator<Item = Lesson>) -> Option<Lesson> {
    lessons.reduce(|best, next| if next.evidence > best.evidence { next } else { best })
}

/// The last lesson of those that have ever more evidence, and more than something has.
fn rising(mut evidence: f64, lessons: impl Iterator<Item = Lesson>) -> Option<Lesson> {
    let rises = |lesson: &Lesson| std::mem::replace(&mut evidence, lesson.evidence) < lesson.evidence;
    lessons.take_while(rises).last()
}

/// What was known of a unit on a day.
#[derive(Clone, Copy)]
struct Known<'a> {
    flights: &'a [Flight],
    book: &'a [Booked],
}

impl<'a> Known<'a> {
    fn on(series: &'a Series, as_of_us: i64) -> Self {
        Self { flights: series.until(as_of_us), book: series.book_until(as_of_us) }
    }
}

/// Units with flights in an order of their own; of many, as many as are looked at, evenly.
fn sample<'a>(fleet: impl Iterator<Item = Known<'a>>) -> Vec<Known<'a>> {
    let mut fleet: Vec<Known<'_>> = fleet.filter(|unit| !unit.flights.is_empty()).collect();
    fleet.sort_by_cached_key(|unit| identity(unit.flights));
    let count = fleet.len().min(MOST_UNITS);
    (0..count).map(|i| fleet[i * fleet.len() / count]).collect()
}

/// What tells two units apart, whatever the order they came in.
fn identity(flights: &[Flight]) -> (i64, usize, [u64; 3]) {
    let last = &flights[flights.len() - 1];
    let gaps: f64 = flights.iter().filter_map(|f| f.gap).map(|g| g.gap_m).sum();
    (flights[0].departure_us, flights.len(), [last.hours, last.reversals, gaps].map(f64::to_bits))
}

/// What a fleet teaches along one axis.
#[derive(Clone)]
struct Lesson {
    histories: Arc<[History]>,
    /// Before the fleet was asked, and after.
    assumed: FleetPrior,
    learned: FleetPrior,
    /// Log evidence of the fleet under what was learned.
    evidence: f64,
}

impl Lesson {
    /// Nothing along an axis on which nobody moved.
    fn along(read: &Read<'_>, axis: Axis, assumed: &FleetPrior, each: &impl Each) -> Option<Self> {
        let assumed = along(read, axis, assumed)?;
        let histories = read.along(&assumed, each);
        let learned = assumed.clone();
        Some(Self { histories, assumed, learned, evidence: f64::NEG_INFINITY }.revised(each))
    }

    /// The same with another noise of wear.
    fn with_wear_noise(&self, factor: f64) -> Self {
        let mut lesson = self.clone();
        lesson.assumed.wear_noise_m *= factor;
        lesson.learned.wear_noise_m *= factor;
        lesson
    }

    /// The same with the noise of wear that has most evidence, which first rises with it and then falls.
    fn with_likeliest_wear_noise(&self, each: &impl Each) -> Self {
        let of = |factor: &f64| self.with_wear_noise(*factor).revised(each);
        let assumed = of(&1.0);
        let up = MORE_WEAR_NOISE.iter().map(of);
        let less = || Some(of(&LESS_WEAR_NOISE)).filter(|less| less.evidence > assumed.evidence);
        match rising(assumed.evidence, up) {
            Some(more) => more,
            None => less().unwrap_or(assumed),
        }
    }

    /// What was learned, with what its own forecasts of the fleet's past were worth.
    fn calibrated(self, each: &impl Each) -> FleetPrior {
        let calibration = Calibration::learn(&segments(&self.histories), &self.learned, each);
        FleetPrior { calibration, ..self.learned }
    }

    /// Judges every segment by what was learned and learns again, by expectation–maximisation.
    ///
    /// Within a revision the weights of the laws and lives move; that a new unit's gap is known better
    /// than was assumed only tells in the next.
    fn revised(self, each: &impl Each) -> Self {
        let judged = |segment: &Segment<'_>| Some(posterior(segment, &self.learned)?.pruned());
        let units: Vec<Posterior> =
            each.each(&segments(&self.histories), judged).into_iter().flatten().collect();
        let round = |current: FleetPrior, _| step(&self.assumed, &self.learned, &current, &units);
        let learned = (0..ROUNDS).fold(self.learned.clone(), round);
        let ratio = Ratio::new(&self.learned, &learned);
        let change = |unit: &Posterior| ratio.weights(&unit.nodes).iter().sum::<f64>().ln();
        let evidence = units.iter().map(|unit| unit.log_evidence + change(unit)).sum();
        Self { learned, evidence, ..self }
    }
}

/// The segments of all units.
fn segments(histories: &[History]) -> Vec<Segment<'_>> {
    histories.iter().flat_map(History::segments).collect()
}

/// Spread of what an installation adds: half the mean square of the steps between installations.
fn bias(histories: &[History], assumed_m: f64) -> f64 {
    let assumed = (PSEUDO_CHANGES * 2.0 * assumed_m * assumed_m, PSEUDO_CHANGES);
    let (squares, count) = histories
        .iter()
        .map(|history| installation_steps(&history.estimates))
        .fold(assumed, |sum, found| (sum.0 + found.0, sum.1 + found.1));
    (0.5 * squares / count).max(0.0).sqrt()
}

/// One round: weights by `current` for units judged by `judge`, moments by weights, and `assumed` as the
/// pseudo-units that keep a small fleet sane.
fn step(assumed: &FleetPrior, judge: &FleetPrior, current: &FleetPrior, units: &[Posterior]) -> FleetPrior {
    let ratio = Ratio::new(judge, current);
    let mut shares = assumed.shares.map(|share| share * PSEUDO_UNITS);
    let mut life = Moments::assumed(assumed.ln_life, assumed.ln_life_sd);
    let mut new = Moments::assumed(assumed.new_m, assumed.new_sd_m);
    let (mut fresh, mut worn) =
        (PSEUDO_LIVES * assumed.fresh_share, PSEUDO_LIVES * (1.0 - assumed.fresh_share));
    let (mut onsets, mut waited_hours) = (1.0, assumed.onsets_per_hour.recip());
    for unit in units {
        let weights = ratio.weights(&unit.nodes);
        let total: f64 = weights.iter().sum();
        for (node, weight) in unit.nodes.iter().zip(weights.into_iter().map(|w| w / total)) {
            shares[family(node)] += weight;
            if node.law != Law::None {
                life.add(node.ln_life, weight);
            }
            if node.age_begin == 0.0 {
                new.add(node.new_m, weight);
            }
            match node.guess {
                Guess::Fresh => fresh += weight,
                Guess::Worn => worn += weight,
                Guess::Unneeded => {}
            }
            if let Law::Onset { start } = node.law {
                onsets += weight;
                waited_hours += weight * start;
            } else if node.waits {
                waited_hours += weight * node.age_now;
            }
        }
    }
    let total: f64 = shares.iter().sum();
    FleetPrior {
        shares: shares.map(|share| share / total),
        ln_life: life.mean,
        ln_life_sd: life.spread(),
        new_m: new.mean,
        new_sd_m: new.spread(),
        onsets_per_hour: onsets / waited_hours,
        fresh_share: fresh / (fresh + worn),
        ..assumed.clone()
    }
}

/// The family whose share a node counts for: one that waits will have an onset.
fn family(node: &Node) -> usize {
    if node.waits { Law::Onset { start: node.age_now }.family() } else { node.law.family() }
}

/// How one prior's weights follow from another's.
struct Ratio<'a> {
    base: &'a FleetPrior,
    current: &'a FleetPrior,
    shares: [f64; FAMILIES],
    life: f64,
    onset: f64,
}

impl<'a> Ratio<'a> {
    fn new(base: &'a FleetPrior, current: &'a FleetPrior) -> Self {
        let mut shares = current.shares;
        for (share, base) in shares.iter_mut().zip(&base.shares) {
            *share = (*share / base).ln();
        }
        let life = (base.ln_life_sd / current.ln_life_sd).ln();
        let onset = (current.onsets_per_hour / base.onsets_per_hour).ln();
        Self { base, current, shares, life, onset }
    }

    /// Weights under the current prior of nodes weighted under the base; they need not add up to one.
    fn weights(&self, nodes: &[Node]) -> Vec<f64> {
        nodes.iter().map(|node| node.weight * self.log(node).exp()).collect()
    }

    fn log(&self, node: &Node) -> f64 {
        let mut log = self.shares[family(node)];
        if node.law != Law::None {
            let square = |p: &FleetPrior| ((node.ln_life - p.ln_life) / p.ln_life_sd).powi(2);
            log += self.life - 0.5 * (square(self.current) - square(self.base));
        }
        log += match node.guess {
            Guess::Fresh => (self.current.fresh_share / self.base.fresh_share).ln(),
            Guess::Worn => ((1.0 - self.current.fresh_share) / (1.0 - self.base.fresh_share)).ln(),
            Guess::Unneeded => 0.0,
        };
        let sooner = self.current.onsets_per_hour - self.base.onsets_per_hour;
        match node.law {
            Law::Onset { start } => log + self.onset - sooner * start,
            _ if node.waits => log - sooner * node.age_now,
            _ => log,
        }
    }
}

/// Weighted mean and spread.
struct Moments {
    count: f64,
    mean: f64,
    squares: f64,
}

impl Moments {
    fn assumed(mean: f64, sd: f64) -> Self {
        Self { count: PSEUDO_LIVES, mean, squares: PSEUDO_LIVES * sd * sd }
    }

    fn add(&mut self, value: f64, weight: f64) {
        self.count += weight;
        let off = value - self.mean;
        self.mean += off * weight / self.count;
        self.squares += weight * off * (value - self.mean);
    }

    fn spread(&self) -> f64 {
        (self.squares / self.count).sqrt()
    }
}
