//! The coupling: two elastic flanks with a gap between them, as a potential and a mean force over a step.
//!
//! A flank pushes and never pulls. Its force is derived from a potential V(p) of the penetration p,
//! and a step of the integrator uses the *mean* force along the step, ΔV/Δδ (a discrete gradient,
//! Gonzalez 1996), so that elastic energy is exchanged exactly, whatever the step and wherever within
//! it the flank is met.

use serde::{Deserialize, Serialize};

use crate::error::{Error, not_negative, positive, within};

/// Below this change of the penetration the divided difference of V loses digits, and the force at mid-step serves.
const NEAR_M: f64 = 1e-9;

/// How the force of a flank grows with its penetration p.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Law {
    /// `F = K p`.
    #[default]
    Linear,
    /// Stiffness `share · K` while `p < depth_m`, K beyond: a flank bedding in at low load.
    Soft {
        /// The stiffness at low load, as a share of K, 0 to 1.
        share: f64,
        /// The penetration up to which it is soft, metres.
        depth_m: f64,
    },
    /// `F = K ((1 − share) p + share · p^1.5 / √reference_m)`: point contacts among the linear ones.
    Hertz {
        /// The share of the force that follows Hertz, 0 to 1.
        share: f64,
        /// The penetration at which both parts are equally stiff in the secant, metres.
        reference_m: f64,
    },
}

impl Law {
    pub(crate) fn check(&self, key: &str) -> Result<(), Error> {
        let (share, length_m) = match *self {
            Self::Linear => return Ok(()),
            Self::Soft { share, depth_m } => (share, depth_m),
            Self::Hertz { share, reference_m } => (share, reference_m),
        };
        within(&format!("{key}.share"), share, 0.0, 1.0, "between 0 and 1")?;
        positive(&format!("{key} length"), length_m)
    }

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
        }
    }

    /// F(p) / K, m.
    fn force_m(&self, p: f64) -> f64 {
        match *self {
            Self::Linear => p,
            Self::Soft { share, depth_m } => p - (1.0 - share) * p.min(depth_m),
            Self::Hertz { share, reference_m } => p * (1.0 - share + share * (p / reference_m).sqrt()),
        }
    }

    /// F′(p) / K.
    fn slope(&self, p: f64) -> f64 {
        match *self {
            Self::Linear => 1.0,
            Self::Soft { share, depth_m } => {
                if p < depth_m {
                    share
                } else {
                    1.0
                }
            }
            Self::Hertz { share, reference_m } => 1.0 - share + share * 1.5 * (p / reference_m).sqrt(),
        }
    }
}

/// The coupling between motor and screw.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Contact {
    /// K, N/m: of one flank, beyond whatever softness `law` adds.
    pub stiffness_n_per_m: f64,
    /// f, N·s/m: acts while a flank is touched, and never makes it pull.
    pub damping_n_s_per_m: f64,
    /// Total free travel, metres.
    pub gap_m: f64,
    /// δX₀: the relative position X₂ − X₁ in the middle of the gap, metres.
    pub offset_m: f64,
    /// How the force grows with the penetration.
    pub law: Law,
}

impl Default for Contact {
    fn default() -> Self {
        Self {
            stiffness_n_per_m: 5e7,
            damping_n_s_per_m: 2000.0,
            gap_m: 100e-6,
            offset_m: 100e-6,
            law: Law::Linear,
        }
    }
}

/// A force over a step, and how it answers to the relative speed of that step.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Mean {
    /// N; positive when the screw is ahead of the motor and pushed back.
    pub(crate) force_n: f64,
    /// ∂force/∂speed, N·s/m.
    pub(crate) slope_n_s_per_m: f64,
}

impl Contact {
    pub(crate) fn check(&self) -> Result<(), Error> {
        positive("contact.stiffness_n_per_m", self.stiffness_n_per_m)?;
        not_negative("contact.damping_n_s_per_m", self.damping_n_s_per_m)?;
        not_negative("contact.gap_m", self.gap_m)?;
        crate::error::finite("contact.offset_m", self.offset_m)?;
        self.law.check("contact.law")
    }

    /// Elastic energy at a relative position δX, J.
    pub fn energy_j(&self, delta_m: f64) -> f64 {
        let beyond_m = ((delta_m - self.offset_m).abs() - 0.5 * self.gap_m).max(0.0);
        self.stiffness_n_per_m * self.law.potential_m2(beyond_m)
    }

    /// The mean force of a step that starts at δX and moves at the mean relative speed given.
    pub(crate) fn mean(&self, delta_m: f64, speed_m_per_s: f64, step_s: f64) -> Mean {
        let from_m = delta_m - self.offset_m;
        let to_m = from_m + step_s * speed_m_per_s;
        let half_m = 0.5 * self.gap_m;
        if from_m.max(to_m) <= half_m && from_m.min(to_m) >= -half_m {
            return Mean::default();
        }
        let upper = self.flank(from_m - half_m, to_m - half_m, step_s);
        let lower = self.flank(-from_m - half_m, -to_m - half_m, step_s);
        Mean {
            force_n: upper.force_n - lower.force_n,
            slope_n_s_per_m: upper.slope_n_s_per_m + lower.slope_n_s_per_m,
        }
    }

    /// One flank, from one signed depth to another; zero depth is the touch.
    fn flank(&self, from_m: f64, to_m: f64, step_s: f64) -> Mean {
        let (p, q) = (from_m.max(0.0), to_m.max(0.0));
        let travel_m = to_m - from_m;
        let (mean_m, slope) = if travel_m.abs() < NEAR_M {
            (self.law.force_m(0.5 * (p + q)), 0.5 * self.law.slope(0.5 * (p + q)))
        } else {
            let mean_m = (self.law.potential_m2(q) - self.law.potential_m2(p)) / travel_m;
            (mean_m, (self.law.force_m(q) - mean_m) / travel_m)
        };
        let force_n = self.stiffness_n_per_m * mean_m + self.damping_n_s_per_m * (q - p) / step_s;
        if force_n <= 0.0 {
            return Mean::default();
        }
        let damping = if q > 0.0 { self.damping_n_s_per_m } else { 0.0 };
        Mean { force_n, slope_n_s_per_m: self.stiffness_n_per_m * slope * step_s + damping }
    }
}
