//! A mixture moved on by a few estimates that follow: each node's level by a Kalman step, its weight by
//! Bayes' theorem.
//!
//! A node is a curve with one amplitude. In addition the level follows a random walk and the season has an amplitude of
//! the unit's own, so its state is two numbers, and their gains are those of every node:
//!
//! ```text
//! e = y − (L + A (F(u) − F(u₀)) + s w)      s seasonal, w the season's wave then, P their covariance
//! S = P_LL + 2 w P_Ls + w² P_ss + R         R the bin's variance; P_LL has state since the bin before
//! (L, s) += (P_LL + w P_Ls, P_Ls + w P_ss) e/S,   ln weight −= e²/2S
//! ```

use crate::data::bins::Bin;
use crate::inference::posterior::{Component, Posterior};
use crate::prior::fleet_prior::FleetPrior;

/// Standard deviations by which a bin may differ from the forecast of the mixture.
const REACH: f64 = 4.0;

/// Reference point of a mixture: usage and installation of its last estimate.
#[derive(Debug, Clone, Copy)]
pub(crate) struct UpdateStart {
    pub(crate) usage: f64,
    pub(crate) installation: u32,
}

/// Moves a mixture from a place through some bins to a later usage; nothing where a bin lies so far off
/// that other curves than those of the mixture may explain it better.
pub(crate) fn update(
    mut fitted: Posterior,
    start: UpdateStart,
    bins: &[Bin],
    now: f64,
    prior: &FleetPrior,
) -> Option<Posterior> {
    let mut state = UpdateState::new(&fitted, start, prior);
    for bin in bins {
        state.predict(bin.usage, &mut fitted);
        state.update(bin, &mut fitted)?;
    }
    state.predict(now, &mut fitted);
    Some(state.finish(fitted, now))
}

/// How far a mixture has come.
struct UpdateState<'a> {
    prior: &'a FleetPrior,
    begin: f64,
    at: UpdateStart,
    /// Every node's height here.
    basis_values: Vec<f64>,
    /// What the mixture's mean has grown since the last bin, metres.
    grown_m: f64,
    /// What was added to each node's log weight.
    log_weights: Vec<f64>,
    /// Usage of the last bin.
    seen: f64,
    start_m2: f64,
}

impl<'a> UpdateState<'a> {
    fn new(fitted: &Posterior, at: UpdateStart, prior: &'a FleetPrior) -> Self {
        let basis_values: Vec<f64> = fitted.components.iter().map(|n| n.law.value(n.age_now)).collect();
        // The level walks from the last bin on, and has not done so yet.
        let grown_m = |(component, value): (&Component, &f64)| {
            component.weight
                * component.amplitude_m
                * (value - component.law.value(component.age_now - fitted.since))
        };
        Self {
            prior,
            begin: at.usage,
            at,
            grown_m: fitted.components.iter().zip(&basis_values).map(grown_m).sum(),
            basis_values,
            log_weights: vec![0.0; fitted.components.len()],
            seen: at.usage - fitted.since,
            start_m2: fitted.growth_m2 - still_m2(fitted),
        }
    }

    /// Lets every node wear up to a usage.
    fn predict(&mut self, usage: f64, fitted: &mut Posterior) {
        let used = usage - self.begin;
        for (component, value) in fitted.components.iter_mut().zip(&mut self.basis_values) {
            let later = component.law.value(component.age_now + used);
            let grown_m = component.amplitude_m * (later - *value);
            component.level_m += grown_m;
            self.grown_m += component.weight * grown_m;
            *value = later;
        }
        self.at.usage = usage;
    }

    /// Weighs every node by a bin.
    fn update(&mut self, bin: &Bin, fitted: &mut Posterior) -> Option<()> {
        let prior = self.prior;
        let moved = f64::from(u8::from(bin.installation != self.at.installation));
        fitted.level_m2 += prior.wear_noise_m * self.grown_m.max(0.0)
            + prior.drift_m2_per_hour * (self.at.usage - self.seen).max(0.0)
            + 2.0 * moved * prior.bias_sd_m.powi(2);
        (self.grown_m, self.seen, self.at.installation) = (0.0, self.at.usage, bin.installation);
        let wave = prior.season.wave(bin.departure_us);
        let level_m2 = fitted.level_m2 + wave * fitted.level_seasonal_m2;
        let seasonal_m2 = fitted.level_seasonal_m2 + wave * fitted.seasonal_m2;
        let variance_m2 = level_m2 + wave * seasonal_m2 + bin.variance_m2;
        let seen_m = bin.gap_m - prior.season.mean_m * wave;
        let off_m = |component: &Component| seen_m - component.level_m - component.seasonal_m * wave;
        let mean_m: f64 = fitted.components.iter().map(|n| n.weight * off_m(n)).sum();
        let spread_m2: f64 = fitted.components.iter().map(|n| n.weight * (off_m(n) - mean_m).powi(2)).sum();
        // Also false where one of them is not a number.
        let is_expected = mean_m * mean_m <= REACH * REACH * (variance_m2 + spread_m2);
        for (component, log_weight) in fitted.components.iter_mut().zip(&mut self.log_weights) {
            let off_m = off_m(component);
            component.level_m += level_m2 / variance_m2 * off_m;
            component.seasonal_m += seasonal_m2 / variance_m2 * off_m;
            *log_weight -= 0.5 * off_m * off_m / variance_m2;
        }
        fitted.level_m2 -= level_m2 * level_m2 / variance_m2;
        fitted.level_seasonal_m2 -= level_m2 * seasonal_m2 / variance_m2;
        fitted.seasonal_m2 -= seasonal_m2 * seasonal_m2 / variance_m2;
        is_expected.then_some(())
    }

    /// The weights made to add up to one, an onset still to come having become less likely.
    fn finish(self, mut fitted: Posterior, now: f64) -> Posterior {
        let used = now - self.begin;
        let best = self.log_weights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        for (component, log_weight) in fitted.components.iter_mut().zip(&self.log_weights) {
            let waited = if component.onset_pending { self.prior.onsets_per_hour * used } else { 0.0 };
            component.weight *= (log_weight - best - waited).exp();
            component.age_now += used;
        }
        let total: f64 = fitted.components.iter().map(|n| n.weight).sum();
        fitted.components.iter_mut().for_each(|n| n.weight /= total);
        fitted.since = now - self.seen;
        fitted.growth_m2 = self.start_m2 + still_m2(&fitted);
        fitted
    }
}

/// Variance of the level, were the season known.
fn still_m2(fitted: &Posterior) -> f64 {
    fitted.level_m2 - fitted.level_seasonal_m2 * fitted.level_seasonal_m2 / fitted.seasonal_m2
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inference::posterior::AgeAssumption;
    use crate::wear::bank::WearLaw;

    const HERE: UpdateStart = UpdateStart { usage: 100.0, installation: 0 };

    /// Two nodes that do not wear, at 20 and 22 µm, one as likely as the other, known to 1 µm.
    fn fitted() -> Posterior {
        let component = |level_m: f64| Component {
            law: WearLaw::None,
            age_begin: 0.0,
            age_now: 100.0,
            amplitude_m: 0.0,
            ln_life: 8.0,
            level_m,
            new_m: 20e-6,
            seasonal_m: 0.0,
            age_assumption: AgeAssumption::NotNeeded,
            onset_pending: false,
            weight: 0.5,
        };
        Posterior {
            components: vec![component(20e-6), component(22e-6)],
            since: 0.0,
            level_m2: 1e-12,
            growth_m2: 1.5e-12,
            seasonal_m2: 1e-30,
            level_seasonal_m2: 0.0,
            log_evidence: 0.0,
        }
    }

    fn bin(gap_m: f64, installation: u32) -> Bin {
        Bin { usage: 110.0, departure_us: 0.0, installation, gap_m, variance_m2: 3e-12 }
    }

    fn prior() -> FleetPrior {
        FleetPrior { drift_m2_per_hour: 0.0, ..FleetPrior::uninformative(1e-4) }
    }

    /// Variances of 1 and 3 µm²: a gain of ¼ and ¾ µm² left; misses of 2 and 0 µm at a variance of 4 µm²
    /// weigh as e^−½ to 1. By hand.
    #[test]
    fn a_bin_moves_levels_by_its_share_of_the_variance_and_weights_by_bayes() {
        let moved = update(fitted(), HERE, &[bin(22e-6, 0)], 120.0, &prior()).unwrap();
        let close = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-9;
        assert!(close(moved.components[0].level_m, 20.5e-6) && close(moved.components[1].level_m, 22e-6));
        let odds = (-0.5_f64).exp();
        assert!(close(moved.components[0].weight, odds / (1.0 + odds)), "{}", moved.components[0].weight);
        assert!(close(moved.level_m2, 0.75e-12) && close(moved.growth_m2, 1.25e-12), "{moved:?}");
        assert!(close(moved.components[0].age_now, 120.0));
    }

    /// A new installation adds its bias and leaves the old one's behind: 2 × (1.5 µm)² more, so ¹¹⁄₁₇.
    #[test]
    fn a_new_installation_lets_the_level_move_further() {
        let moved = update(fitted(), HERE, &[bin(22e-6, 1)], 120.0, &prior()).unwrap();
        assert!((moved.components[0].level_m - (20e-6 + 2e-6 * 11.0 / 17.0)).abs() < 1e-15, "{moved:?}");
    }

    #[test]
    fn a_bin_far_off_is_not_explained() {
        assert!(update(fitted(), HERE, &[bin(31e-6, 0)], 120.0, &prior()).is_none());
        assert!(update(fitted(), HERE, &[bin(f64::NAN, 0)], 120.0, &prior()).is_none());
    }

    /// In 20 h of an onset every 2,000 h.
    #[test]
    fn an_onset_that_does_not_come_is_less_awaited() {
        let mut fitted = fitted();
        fitted.components[1].onset_pending = true;
        let moved = update(fitted, HERE, &[], 120.0, &prior()).unwrap();
        let odds = moved.components[1].weight / moved.components[0].weight;
        assert!((odds - (-0.01_f64).exp()).abs() < 1e-12, "{odds}");
    }
}
