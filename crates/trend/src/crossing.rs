//! When the limit is met: every node's crossing, added up.

use crate::calibrate::Calibration;
use crate::curve::Law;
use crate::posterior::{Node, Posterior};
use crate::prior::FleetPrior;
use crate::settings::Settings;
use crate::trend::Crossing;

/// Three- and five-point Gauss–Hermite rules for a standard normal variable.
const SHORT_RULE: [(f64, f64); 3] =
    [(-1.732_050_807_568_877_2, 1.0 / 6.0), (0.0, 2.0 / 3.0), (1.732_050_807_568_877_2, 1.0 / 6.0)];
pub(crate) const LONG_RULE: [(f64, f64); 5] = [
    (-2.856_970_013_872_806, 0.011_257_411_327_720_69),
    (-1.355_626_179_974_266, 0.222_075_922_005_612_6),
    (0.0, 0.533_333_333_333_333_3),
    (1.355_626_179_974_266, 0.222_075_922_005_612_6),
    (2.856_970_013_872_806, 0.011_257_411_327_720_69),
];

/// Quantiles of an exponential wait, one for each tenth.
pub(crate) const WAIT_RULE: usize = 10;

/// Weight above which a node deserves the longer rule.
const NOTABLE: f64 = 0.02;

/// Cells of the distribution, even in ln hours from one hour to the horizon.
const CELLS: usize = 240;

/// Even quantiles of the wait for an onset, hours' worth of usage.
pub(crate) fn waits(prior: &FleetPrior) -> [f64; WAIT_RULE] {
    std::array::from_fn(|i| -(1.0 - (i as f64 + 0.5) / WAIT_RULE as f64).ln() / prior.onsets_per_hour)
}

/// The distribution of the hours left.
#[derive(Debug, Clone)]
pub(crate) struct Remaining {
    cells: Vec<f64>,
    over: f64,
    horizon_hours: f64,
    /// Cells for each ln hour.
    scale: f64,
    calibration: Calibration,
}

impl Remaining {
    /// Adds up the crossings of the act limit; usage turns to hours by `hours_per_usage`, and undone
    /// offsets leave `offset_m2` in the level.
    pub(crate) fn new(
        posterior: &Posterior,
        prior: &FleetPrior,
        settings: &Settings,
        hours_per_usage: f64,
        offset_m2: f64,
    ) -> Self {
        let Settings { limit_m, horizon_hours, .. } = *settings;
        let scale = CELLS as f64 / horizon_hours.ln();
        let calibration = prior.calibration;
        let mut remaining = Self { cells: vec![0.0; CELLS], over: 0.0, horizon_hours, scale, calibration };
        let spread_m2 = posterior.level_m2 + offset_m2 + prior.bias_sd_m.powi(2);
        let kept: f64 = posterior.notable().map(|n| n.weight).sum();
        for node in posterior.notable() {
            let node = &Node { weight: node.weight / kept, ..*node };
            remaining.add_node(node, prior, limit_m, spread_m2, hours_per_usage);
        }
        remaining
    }

    fn add_node(
        &mut self,
        node: &Node,
        prior: &FleetPrior,
        limit_m: f64,
        spread_m2: f64,
        hours_per_usage: f64,
    ) {
        let left_m = limit_m - node.level_m;
        let sd_m = (spread_m2 + prior.wear_noise_m * left_m.max(0.0)).sqrt();
        let rule: &[(f64, f64)] = if node.weight > NOTABLE { &LONG_RULE } else { &SHORT_RULE };
        let height_now = node.law.height(node.age_now);
        for &(z, share) in rule {
            let left_m = left_m + z * sd_m;
            let weight = node.weight * share;
            if left_m <= 0.0 {
                self.over += weight;
            } else if node.waits {
                let wear_hours = node.ln_life.exp() * left_m / prior.span_m;
                for wait_hours in waits(prior) {
                    self.add((wait_hours + wear_hours) * hours_per_usage, weight / WAIT_RULE as f64);
                }
            } else if node.law != Law::None {
                let height = height_now + left_m / node.amplitude_m;
                self.add((node.law.age_at(height) - node.age_now) * hours_per_usage, weight);
            }
        }
    }

    fn add(&mut self, hours: f64, weight: f64) {
        let place = hours.max(1.0).ln() * self.scale;
        if let Some(cell) = self.cells.get_mut(place as usize) {
            *cell += weight;
        }
    }

    /// Its 5 %, 50 % and 95 % quantiles, after what the fleet's past says of such forecasts.
    ///
    /// Growth above what was foretold is time below it: the widths on the logarithm of the time are
    /// those that growth was found to need. A limit that is likely over, or likely beyond the horizon,
    /// has no width to be corrected.
    pub(crate) fn crossing(&self) -> Crossing {
        let [p05_hours, p50_hours, p95_hours] = [0.05, 0.5, 0.95].map(|p| self.quantile(p));
        let (Some(early), Some(middle)) = (p05_hours, p50_hours.filter(|hours| *hours > 0.0)) else {
            return Crossing { p05_hours, p50_hours, p95_hours };
        };
        let late = p95_hours.unwrap_or(self.horizon_hours);
        let at = |width: f64| {
            let bound = if width > 0.0 { early } else { late };
            let hours = middle * (bound.max(1.0) / middle).powf(width.abs());
            (hours < self.horizon_hours).then_some(if hours > 1.0 { hours } else { 0.0 })
        };
        let Calibration { low, middle: shift, high } = self.calibration;
        Crossing { p05_hours: at(high), p50_hours: at(shift), p95_hours: p95_hours.and_then(|_| at(low)) }
    }

    /// The hours by which the limit is met with this probability; nothing when that is beyond the horizon.
    fn quantile(&self, probability: f64) -> Option<f64> {
        let mut sum = self.over;
        if sum >= probability {
            return Some(0.0);
        }
        for (i, cell) in self.cells.iter().enumerate() {
            if sum + cell >= probability {
                let place = i as f64 + (probability - sum) / cell;
                return Some((place / self.scale).exp());
            }
            sum += cell;
        }
        None
    }

    /// Probability that the limit is met within some hours.
    pub(crate) fn within(&self, hours: f64) -> f64 {
        let place = hours.max(1.0).ln() * self.scale;
        let whole = (place as usize).min(CELLS);
        let part = self.cells.get(whole).map_or(0.0, |cell| cell * (place - whole as f64));
        self.over + self.cells[..whole].iter().sum::<f64>() + part
    }
}
