//! The coupling: two elastic flanks with a gap between them, as a potential and a mean force over a step.
//!
//! A flank pushes and never pulls. Its force is derived from a potential V(p) of the penetration p,
//! and a step of the integrator uses the *mean* force along the step, ΔV/Δδ (a discrete gradient,
//! Gonzalez 1996), so that elastic energy is exchanged exactly, whatever the step and wherever within
//! it the flank is met.
#![expect(missing_docs, reason = "docs/simulator.md explains each key")]

use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;

use crate::load::flight_commands::phase_factor;

/// Below this change of the penetration the divided difference of V loses digits, and the force at mid-step serves.
const NEAR_M: f64 = 1e-9;

/// How the force of a flank grows with its penetration p.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum ContactLaw {
    /// `F = K p`.
    #[default]
    Linear,
    /// Stiffness `share · K` while `p < depth_m`, K beyond: a flank bedding in at low load.
    Soft { share: f64, depth_m: f64 },
    /// `F = K ((1 − share) p + share · p^1.5 / √reference_m)`: point contacts among the linear ones.
    Hertz { share: f64, reference_m: f64 },
    /// Stiffness `K (1 − (1 − share) e^(−p/depth_m))`: a toe that stiffens exponentially.
    Toe { share: f64, depth_m: f64 },
}

impl ContactLaw {
    /// V(p) / K, m².
    fn potential_m2(&self, p: f64) -> f64 {
        match *self {
            Self::Linear => 0.5 * p * p,
            Self::Soft { share, depth_m } => {
                let soft = p.min(depth_m);
                0.5 * p * p - (1.0 - share) * (0.5 * soft * soft + depth_m * (p - soft))
            }
            Self::Hertz { share, reference_m } => {
                (1.0 - share) * 0.5 * p * p + share * 0.4 * p * p * (p / reference_m).sqrt()
            }
            Self::Toe { share, depth_m } => {
                0.5 * p * p - (1.0 - share) * depth_m * (p + depth_m * (-p / depth_m).exp_m1())
            }
        }
    }

    /// F(p) / K, m.
    fn force_m(&self, p: f64) -> f64 {
        match *self {
            Self::Linear => p,
            Self::Soft { share, depth_m } => p - (1.0 - share) * p.min(depth_m),
            Self::Hertz { share, reference_m } => p * (1.0 - share + share * (p / reference_m).sqrt()),
            Self::Toe { share, depth_m } => p + (1.0 - share) * depth_m * (-p / depth_m).exp_m1(),
        }
    }

    /// F′(p) / K.
    fn slope(&self, p: f64) -> f64 {
        match *self {
            Self::Soft { share, depth_m } if p < depth_m => share,
            Self::Linear | Self::Soft { .. } => 1.0,
            Self::Hertz { share, reference_m } => 1.0 - share + share * 1.5 * (p / reference_m).sqrt(),
            Self::Toe { share, depth_m } => 1.0 - (1.0 - share) * (-p / depth_m).exp(),
        }
    }

    /// The penetration p at which `F(p)/K` has a value, by bisection.
    fn penetration_m(&self, force_m: f64) -> f64 {
        let (mut low_m, mut high_m) = (0.0, force_m.max(1e-9));
        while self.force_m(high_m) < force_m {
            high_m *= 2.0;
        }
        for _ in 0..80 {
            let middle_m = 0.5 * (low_m + high_m);
            if self.force_m(middle_m) < force_m { low_m = middle_m } else { high_m = middle_m }
        }
        0.5 * (low_m + high_m)
    }
}

/// Loads at which a flank is sampled for its straight line.
const LINE_POINTS: usize = 200;

/// The coupling between motor and screw.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, SmartDefault)]
#[serde(deny_unknown_fields, default)]
pub struct Contact {
    #[default(5e7)]
    pub stiffness_n_per_m: f64,
    #[default(2000.0)]
    pub damping_n_s_per_m: f64,
    #[default(100e-6)]
    pub gap_m: f64,
    #[default(100e-6)]
    pub offset_m: f64,
    pub law: ContactLaw,
    pub lower_law: Option<ContactLaw>,
    #[default(1.0)]
    pub lower_stiffness_factor: f64,
    pub stiffness_drift: f64,
    pub gap_drift: f64,
    pub worn_m: f64,
    #[default([0.0, 5e-3])]
    pub worn_at_m: [f64; 2],
    #[default([1.0; 6])]
    pub stiffness_phase_factors: [f64; 6],
}

/// A force over a step, and how it answers to the relative speed of that step.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct MeanForce {
    /// N; positive when the screw is ahead of the motor and pushed back.
    pub(crate) force_n: f64,
    /// ∂force/∂speed, N·s/m.
    pub(crate) slope_n_s_per_m: f64,
}

impl Contact {
    /// The coupling at a share of the log, with the stiffness and the gap it has by then.
    pub(crate) fn at(&self, progress: f64) -> Self {
        let progress = progress.clamp(0.0, 1.0);
        let factor = phase_factor(progress, &self.stiffness_phase_factors);
        let drift = 1.0 + self.stiffness_drift * progress;
        let gap_m = self.gap_m * (1.0 + self.gap_drift * progress);
        Self { stiffness_n_per_m: self.stiffness_n_per_m * factor * drift, gap_m, ..*self }
    }

    /// The gap with the screw at a place of its stroke, metres.
    #[must_use]
    pub fn gap_at_m(&self, screw_m: f64) -> f64 {
        if self.worn_m == 0.0 {
            return self.gap_m;
        }
        let off = (screw_m - self.worn_at_m[0]) / self.worn_at_m[1];
        self.gap_m + self.worn_m * (-0.5 * off * off).exp()
    }

    /// Whether stiffness or gap change during a log.
    pub(crate) fn is_varying(&self) -> bool {
        let is_one = |factor: &f64| (factor - 1.0).abs() < f64::EPSILON;
        self.stiffness_drift.abs() > 0.0
            || self.gap_drift.abs() > 0.0
            || !self.stiffness_phase_factors.iter().all(is_one)
    }

    /// Law and stiffness of the flank that pushes the screw up.
    fn lower(&self) -> (ContactLaw, f64) {
        (self.lower_law.unwrap_or(self.law), self.stiffness_n_per_m * self.lower_stiffness_factor)
    }

    /// The distance of both flanks when each is extrapolated to zero load from a band of loads.
    ///
    /// A straight line is fitted by least squares to δX against F on each flank, over evenly spaced
    /// loads of the band; the result is the difference of the intercepts. For linear flanks it is the
    /// gap; a soft toe of less force than the band adds to it.
    pub fn extrapolated_gap_m(&self, from_n: f64, to_n: f64) -> f64 {
        let flanks = [(self.law, self.stiffness_n_per_m), self.lower()];
        let intercept_m = |(law, stiffness_n_per_m): (ContactLaw, f64)| {
            let points: [(f64, f64); LINE_POINTS] = std::array::from_fn(|k| {
                let load_n = from_n + (to_n - from_n) * k as f64 / (LINE_POINTS - 1) as f64;
                (load_n, law.penetration_m(load_n / stiffness_n_per_m))
            });
            let mean =
                |of: &dyn Fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / LINE_POINTS as f64;
            let (x, y) = (mean(&|p| p.0), mean(&|p| p.1));
            y - mean(&|p| (p.0 - x) * (p.1 - y)) / mean(&|p| (p.0 - x).powi(2)) * x
        };
        self.gap_m + flanks.map(intercept_m).iter().sum::<f64>()
    }

    /// Elastic energy at a relative position δX, J.
    #[cfg(test)]
    pub(crate) fn energy_j(&self, delta_m: f64) -> f64 {
        let from_m = delta_m - self.offset_m;
        let energy_j = |(law, stiffness_n_per_m): (ContactLaw, f64), depth_m: f64| {
            stiffness_n_per_m * law.potential_m2(depth_m.max(0.0))
        };
        let half_m = 0.5 * self.gap_m;
        energy_j((self.law, self.stiffness_n_per_m), from_m - half_m)
            + energy_j(self.lower(), -from_m - half_m)
    }

    /// The mean force of a step that starts at δX and moves at the mean relative speed given.
    pub(crate) fn mean_force(&self, delta_m: f64, speed_m_per_s: f64, step_s: f64) -> MeanForce {
        let from_m = delta_m - self.offset_m;
        let to_m = from_m + step_s * speed_m_per_s;
        let half_m = 0.5 * self.gap_m;
        if from_m.max(to_m) <= half_m && from_m.min(to_m) >= -half_m {
            return MeanForce::default();
        }
        let upper = (self.law, self.stiffness_n_per_m);
        let upper = self.flank(upper, from_m - half_m, to_m - half_m, step_s);
        let lower = self.flank(self.lower(), -from_m - half_m, -to_m - half_m, step_s);
        MeanForce {
            force_n: upper.force_n - lower.force_n,
            slope_n_s_per_m: upper.slope_n_s_per_m + lower.slope_n_s_per_m,
        }
    }

    /// One flank, from one signed depth to another; zero depth is the touch.
    fn flank(
        &self,
        (law, stiffness_n_per_m): (ContactLaw, f64),
        from_m: f64,
        to_m: f64,
        step_s: f64,
    ) -> MeanForce {
        let (p, q) = (from_m.max(0.0), to_m.max(0.0));
        let travel_m = to_m - from_m;
        let (mean_m, slope) = if travel_m.abs() < NEAR_M {
            (law.force_m(0.5 * (p + q)), 0.5 * law.slope(0.5 * (p + q)))
        } else {
            let mean_m = (law.potential_m2(q) - law.potential_m2(p)) / travel_m;
            (mean_m, (law.force_m(q) - mean_m) / travel_m)
        };
        let force_n = stiffness_n_per_m * mean_m + self.damping_n_s_per_m * (q - p) / step_s;
        if force_n <= 0.0 {
            return MeanForce::default();
        }
        let damping = if q > 0.0 { self.damping_n_s_per_m } else { 0.0 };
        MeanForce { force_n, slope_n_s_per_m: stiffness_n_per_m * slope * step_s + damping }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn contact(law: ContactLaw) -> Contact {
        Contact { law, ..Contact::default() }
    }

    /// Straight flanks add nothing to a gap of 100 µm, even when they differ. Beyond the toe, soft and exponential flanks are
    /// `p = F/K + (1 − share) depth`. Pure Hertz, `p = (F/K)^(2/3) ref^(1/3)`: the tangent at a load meets zero load at a third
    /// of the penetration, and the intercept of a line is near that.
    #[test]
    fn flanks_extrapolate_to_the_gap_and_the_asymptote_of_their_law() {
        let unequal = Contact { lower_stiffness_factor: 0.6, ..contact(ContactLaw::Linear) };
        let soft = contact(ContactLaw::Soft { share: 0.4, depth_m: 20e-6 });
        let toe = Contact { lower_law: Some(ContactLaw::Toe { share: 0.5, depth_m: 5e-6 }), ..soft };
        let hertz = contact(ContactLaw::Hertz { share: 1.0, reference_m: 100e-6 });
        let penetration_m = (5200.0_f64 / 5e7).powf(2.0 / 3.0) * 100e-6_f64.powf(1.0 / 3.0);
        for (contact, added_m, tolerance_m) in [
            (unequal, 0.0, 1e-15),
            (soft, 24e-6, 1e-12),
            (toe, 14.5e-6, 1e-9),
            (hertz, penetration_m / 1.5, 0.1 * penetration_m / 1.5),
        ] {
            let found_m = contact.extrapolated_gap_m(2400.0, 8000.0) - 100e-6;
            assert!((found_m - added_m).abs() < tolerance_m, "{found_m:e} of {contact:?}");
        }
    }

    #[test]
    fn every_law_has_the_force_and_slope_of_its_potential() {
        let laws = [
            ContactLaw::Linear,
            ContactLaw::Soft { share: 0.3, depth_m: 30e-6 },
            ContactLaw::Hertz { share: 0.7, reference_m: 80e-6 },
            ContactLaw::Toe { share: 0.2, depth_m: 25e-6 },
        ];
        for law in laws {
            for p in [1e-6, 20e-6, 70e-6] {
                let h = 1e-9;
                let force_m = (law.potential_m2(p + h) - law.potential_m2(p - h)) / (2.0 * h);
                let slope = (law.force_m(p + h) - law.force_m(p - h)) / (2.0 * h);
                assert!((force_m / law.force_m(p) - 1.0).abs() < 1e-4, "{law:?} at {p:e}");
                assert!((slope / law.slope(p) - 1.0).abs() < 1e-4, "{law:?} at {p:e}");
                assert!((law.penetration_m(law.force_m(p)) / p - 1.0).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn stiffness_drifts_and_follows_the_phases() {
        let factors = [1.0, 1.0, 1.0, 0.9, 1.0, 1.0];
        let varying =
            Contact { stiffness_drift: 0.2, stiffness_phase_factors: factors, ..Contact::default() };
        assert!(varying.is_varying() && !Contact::default().is_varying());
        assert!((varying.at(1.0).stiffness_n_per_m / 6e7 - 1.0).abs() < 1e-12);
        assert!((varying.at(0.49).stiffness_n_per_m / (5e7 * 0.9 * 1.098) - 1.0).abs() < 1e-12);
    }
}
