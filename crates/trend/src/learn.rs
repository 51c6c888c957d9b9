//! Learning of the fleet prior: usage axis, lives and shares of laws of the units (empirical Bayes).

use std::sync::Arc;

use crate::data::bins::Segment;
use crate::data::series::{Flight, Series, UnitData};
use crate::data::steps::installation_steps;
use crate::executor::Executor;
use crate::inference::posterior::{Posterior, posterior};
use crate::inference::season::{SeasonalFit, learn_season, seasonal_fit};
use crate::prior::{FLEET_WIDTH, FleetPrior, UsageAxis};
use crate::statement::history::History;
use crate::wear::AgeAssumption;
use crate::wear::bank::WearLaw;

/// Largest number of units used: more change the prior little and cost as much as their own assessments.
const MOST_UNITS: usize = 150;

/// Weight of the assumed shares of laws, in units: few, so that thirty units outvote it.
const PSEUDO_UNITS: f64 = 15.0;

/// The same for the spread of lives, for a new unit's gap, and for changes of installation.
const PSEUDO_LIVES: f64 = 2.0;
const PSEUDO_CHANGES: f64 = 4.0;

const ROUNDS: usize = 8;

/// Process noises tried, as factors of the assumed one.
const WEAR_NOISES: [f64; 4] = [1.0, 0.7, 1.5, 2.2];

impl FleetPrior {
    /// Learns the fleet prior from the data of units until a day: the usage axis, the shares
    /// of the laws, the spread of lives, a new unit's gap, the season, and the effect of an installation.
    ///
    /// Parametric empirical Bayes (Morris 1983, <https://doi.org/10.1080/01621459.1983.10477920>) by
    /// expectation–maximisation (Dempster, Laird and Rubin 1977). The limit is in metres, the day in microseconds since
    /// 1970 UTC.
    ///
    /// The units should be of one design: a part number, or several that differ in life by a factor of
    /// two at most, which then share a prior. Of a large fleet 150 units are used. The
    /// order of the units does not change the result, and nothing later than the day is used; a prior of an
    /// earlier day may replace a later one.
    ///
    /// Wear follows `axis` where it is given and the fleet has counted it, else the likeliest one. The executor does the
    /// work on each unit and changes no bit of the result.
    pub fn learn<'a>(
        fleet: impl IntoIterator<Item = &'a Series>,
        as_of_us: i64,
        limit_m: f64,
        axis: Option<UsageAxis>,
        executor: &impl Executor,
    ) -> Self {
        let histories = read_fleet(fleet, as_of_us, limit_m, executor);
        let assumed = assumed(&histories, limit_m, executor);
        let on_axis = |axis| AxisPrior::on_axis(&histories, axis, &assumed, executor);
        let axis_prior = axis
            .and_then(on_axis)
            .or_else(|| argmax_evidence(UsageAxis::ALL.into_iter().filter_map(on_axis)));
        let Some(axis_prior) = axis_prior else { return Self::uninformative(limit_m) };
        let learned = axis_prior.with_likeliest_wear_noise(executor).em_iterate(executor).learned;
        Self { interval_width: FLEET_WIDTH, ..learned }
    }

    /// The median life of units, from new to the act limit, flight hours, from their first-pass
    /// prior: enough to separate designs, at a fifth of the cost of [`FleetPrior::learn`].
    pub fn rough_median_life_hours<'a>(
        fleet: impl IntoIterator<Item = &'a Series>,
        as_of_us: i64,
        limit_m: f64,
        executor: &impl Executor,
    ) -> f64 {
        let histories = read_fleet(fleet, as_of_us, limit_m, executor);
        let assumed = assumed(&histories, limit_m, executor);
        let axis_prior = AxisPrior::on_axis(&histories, UsageAxis::Hours, &assumed, executor);
        axis_prior.map_or(assumed, |axis_prior| axis_prior.learned).median_life_hours()
    }
}

/// What the flights of the units used show until a day, along hours.
fn read_fleet<'a>(
    fleet: impl IntoIterator<Item = &'a Series>,
    as_of_us: i64,
    limit_m: f64,
    executor: &impl Executor,
) -> Arc<[History<'a>]> {
    let uninformative = FleetPrior::uninformative(limit_m);
    let units = sample(fleet.into_iter().map(|series| series.until(as_of_us)));
    // The unit hours at the first flight are not used: with a few units whose wear began late, curves from their first
    // hour on would give a fleet prior without wear.
    executor.map(&units, |unit| History::read(*unit, None, &uninformative)).into()
}

/// Assumptions before the shares of the laws are learned: the effect of an installation, and the season, which
/// are of the measurement whatever wear follows.
fn assumed(histories: &[History<'_>], limit_m: f64, executor: &impl Executor) -> FleetPrior {
    let mut assumed = FleetPrior::uninformative(limit_m);
    assumed.bias_sd_m = bias(histories, assumed.bias_sd_m, limit_m);
    let of_segment = |s: &Segment<'_>| seasonal_fit(s, &assumed, &posterior(s, &assumed)?);
    let seasonal_fits = executor.map(&segments(histories), of_segment);
    let seasonal_fits: Vec<SeasonalFit> = seasonal_fits.into_iter().flatten().collect();
    assumed.season = learn_season(&seasonal_fits, limit_m);
    assumed
}

/// The axis prior with the largest evidence, the first of equals.
fn argmax_evidence<'a>(priors: impl Iterator<Item = AxisPrior<'a>>) -> Option<AxisPrior<'a>> {
    priors.reduce(|best, next| if next.evidence > best.evidence { next } else { best })
}

/// Units in an order that does not depend on the input; of a large fleet an even sample.
fn sample<'a>(fleet: impl Iterator<Item = UnitData<'a>>) -> Vec<UnitData<'a>> {
    let mut fleet: Vec<UnitData<'_>> = fleet.filter(|unit| !unit.flights.is_empty()).collect();
    fleet.sort_by_cached_key(|unit| identity(unit.flights));
    let count = fleet.len().min(MOST_UNITS);
    (0..count).map(|i| fleet[i * fleet.len() / count]).collect()
}

/// Key that identifies a unit independently of the input order.
fn identity(flights: &[Flight]) -> (i64, usize, [u64; 3]) {
    let last = &flights[flights.len() - 1];
    let gaps: f64 = flights.iter().filter_map(|f| f.gap).map(|g| g.gap_m).sum();
    (flights[0].departure_us, flights.len(), [last.hours, last.reversals, gaps].map(f64::to_bits))
}

#[derive(Clone)]
struct AxisPrior<'a> {
    histories: Arc<[History<'a>]>,
    /// Before learning, and after.
    assumed: FleetPrior,
    learned: FleetPrior,
    /// Log evidence of the fleet under what was learned.
    evidence: f64,
}

impl<'a> AxisPrior<'a> {
    /// `None` for an axis without usage.
    fn on_axis(
        histories: &Arc<[History<'a>]>,
        axis: UsageAxis,
        assumed: &FleetPrior,
        executor: &impl Executor,
    ) -> Option<Self> {
        let total = |of: &dyn Fn(&Flight) -> f64| -> f64 {
            histories.iter().filter_map(|history| history.data.flights.last()).map(of).sum()
        };
        let hours_per_unit = total(&|f| f.hours) / total(&|f| axis.of(f));
        if !hours_per_unit.is_finite() {
            return None;
        }
        let assumed = FleetPrior { axis, hours_per_unit, ..assumed.clone() };
        let histories = match axis {
            // They are read along hours.
            UsageAxis::Hours => Arc::clone(histories),
            _ => executor.map(histories, |history| history.clone().on_axis(&assumed)).into(),
        };
        Some(
            Self { histories, learned: assumed.clone(), assumed, evidence: f64::NEG_INFINITY }
                .em_iterate(executor),
        )
    }

    /// The same with the noise of wear that has most evidence.
    fn with_likeliest_wear_noise(&self, executor: &impl Executor) -> Self {
        let of = |factor: f64| {
            let mut axis_prior = self.clone();
            axis_prior.assumed.wear_noise_m *= factor;
            axis_prior.learned.wear_noise_m *= factor;
            axis_prior.em_iterate(executor)
        };
        argmax_evidence(WEAR_NOISES.into_iter().map(of)).unwrap_or_else(|| self.clone())
    }

    /// Assesses every segment with the current prior and learns it again, by expectation–maximisation.
    ///
    /// Within an iteration the weights of the laws and lives move; a better known gap of a new unit
    /// takes effect in the next one.
    fn em_iterate(self, executor: &impl Executor) -> Self {
        let fitted = |segment: &Segment<'_>| {
            let mut fitted = posterior(segment, &self.learned)?;
            let negligible = fitted.negligible();
            fitted.components.retain(|component| component.weight > negligible);
            Some(fitted)
        };
        let units: Vec<Posterior> =
            executor.map(&segments(&self.histories), fitted).into_iter().flatten().collect();
        let round = |current: FleetPrior, _| step(&self.assumed, &self.learned, &current, &units);
        let learned = (0..ROUNDS).fold(self.learned.clone(), round);
        let change = |unit: &Posterior| weights(unit, &self.learned, &learned).iter().sum::<f64>().ln();
        let evidence = units.iter().map(|unit| unit.log_evidence + change(unit)).sum();
        Self { learned, evidence, ..self }
    }
}

fn segments<'a>(histories: &'a [History<'_>]) -> Vec<Segment<'a>> {
    histories.iter().flat_map(History::segments).collect()
}

/// Spread of what an installation adds: half the mean square of the steps between installations.
fn bias(histories: &[History<'_>], assumed_m: f64, limit_m: f64) -> f64 {
    let assumed = (PSEUDO_CHANGES * 2.0 * assumed_m * assumed_m, PSEUDO_CHANGES);
    let (squares, count) = histories
        .iter()
        .map(|history| installation_steps(&history.estimates, limit_m))
        .fold(assumed, |sum, found| (sum.0 + found.0, sum.1 + found.1));
    (0.5 * squares / count).max(0.0).sqrt()
}

/// One round: weights by `current` for units assessed with `base`, moments by weights, and `assumed` as the
/// pseudo-units that keep a small fleet sane.
fn step(assumed: &FleetPrior, base: &FleetPrior, current: &FleetPrior, units: &[Posterior]) -> FleetPrior {
    let mut shares = assumed.shares.map(|share| share * PSEUDO_UNITS);
    let mut life = WeightedMoments::assumed(assumed.ln_life, assumed.ln_life_sd);
    let mut new = WeightedMoments::assumed(assumed.new_m, assumed.new_sd_m);
    let (mut fresh, mut worn) =
        (PSEUDO_LIVES * assumed.fresh_share, PSEUDO_LIVES * (1.0 - assumed.fresh_share));
    let (mut onsets, mut waited_hours) = (1.0, assumed.onsets_per_hour.recip());
    for unit in units {
        let weights = weights(unit, base, current);
        let total: f64 = weights.iter().sum();
        for (component, weight) in unit.components.iter().zip(weights.into_iter().map(|w| w / total)) {
            shares[component.family()] += weight;
            if component.law != WearLaw::None {
                life.add(component.ln_life, weight);
            }
            if component.age_begin == 0.0 {
                new.add(component.new_m, weight);
            }
            match component.age_assumption {
                AgeAssumption::Fresh => fresh += weight,
                AgeAssumption::Worn => worn += weight,
                AgeAssumption::NotNeeded => {}
            }
            if let WearLaw::Onset { start } = component.law {
                onsets += weight;
                waited_hours += weight * start;
            } else if component.onset_pending {
                waited_hours += weight * component.age_now;
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

/// Weights under the current prior of components weighted under the base; they need not add up to one.
fn weights(unit: &Posterior, base: &FleetPrior, current: &FleetPrior) -> Vec<f64> {
    let (before, now) = (base.logs(), current.logs());
    unit.components.iter().map(|n| n.weight * (now.of(n) - before.of(n)).exp()).collect()
}

struct WeightedMoments {
    count: f64,
    mean: f64,
    squares: f64,
}

impl WeightedMoments {
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
