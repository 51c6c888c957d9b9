//! What the contact regression takes and gives.

use super::codes::{QualityFlag, Rejection};
use super::friction::friction_model::Friction;

/// What is known of the part before its flight is seen.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct PartPrior {
    /// K of the part number, N/m; believed to 15 %.
    pub stiffness_n_per_m: f64,
    /// Load between whose positive and negative value lost motion is stated, N.
    pub reference_load_n: Option<f64>,
    /// Rms of the force the model does not know, mainly friction, N, where it is known: a load that does not rise
    /// above it presses on no flank for certain.
    pub unknown_force_n: Option<f64>,
    /// Travel of the screw in one turn of the motor, m, where errors of the positions may repeat with it.
    pub period_m: Option<f64>,
    /// Whether the output is locked, so that the screw's position is a constant and the load is the motor's.
    pub output_locked: bool,
}

impl PartPrior {
    /// A part of which only the stiffness is known, N/m.
    pub fn of_stiffness(stiffness_n_per_m: f64) -> Self {
        Self { stiffness_n_per_m, ..Self::default() }
    }
}

/// The gap at a place of the stroke.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GapAtPlace {
    /// Screw position, m.
    pub at_m: f64,
    /// Gap there, m: an average over an eighth of the stroke seen.
    pub gap_m: f64,
    /// Its standard error, m.
    pub gap_se_m: f64,
}

/// The gap by contact regression, and what was found on the way.
#[derive(Debug, Clone, PartialEq)]
pub struct ContactEstimate {
    /// ΔS, m; not clipped at zero.
    pub gap_m: f64,
    /// Its standard error, m.
    pub gap_se_m: f64,
    /// 5 % and 95 % bounds, m.
    pub gap_bounds_m: (f64, f64),
    /// K fitted in this flight, N/m: the secant over the loads of the flight.
    pub stiffness_n_per_m: f64,
    /// Its standard error, N/m.
    pub stiffness_se_n_per_m: f64,
    /// τ in `screw_logged(t) = X_screw(t − τ)`, s. Viscous friction F_v of the screw adds F_v/K.
    pub skew_s: f64,
    /// Its standard error, s.
    pub skew_se_s: f64,
    /// F₀: what the load cell reads under no load, N. A flight shows it where the screw crosses its gap; without a gap, or
    /// without light loads, its standard error is large.
    pub load_zero_n: f64,
    /// Its standard error, N.
    pub load_zero_se_n: f64,
    /// τ in `load_logged(t) = F(t − τ)`, s; of a first-order lag about its time constant.
    pub load_delay_s: f64,
    /// Its standard error, s.
    pub load_delay_se_s: f64,
    /// Friction of the screw in motion.
    pub friction: Friction,
    /// The standard errors of its two parts.
    pub friction_se: Friction,
    /// Standard error of the friction at the 95 % load, N.
    pub friction_p95_se_n: f64,
    /// The gap by place, from one end of the stroke seen to the other, where it varies along the stroke; empty where it
    /// does not.
    pub gap_profile: Vec<GapAtPlace>,
    /// Force with which both flanks of a preloaded nut press under no load, and its standard error, N.
    pub preload_n: Option<(f64, f64)>,
    /// Width of the loop of δX against the load at zero load and its standard error, m: gap and friction wind-up together,
    /// measured rather than extrapolated. On soft flanks the gap in it is narrower.
    pub loop_width_m: Option<(f64, f64)>,
    /// Relative travel between + and − the reference load and its standard error, m, from samples near it.
    pub lost_motion_m: Option<(f64, f64)>,
    /// Load magnitude that one sample in twenty exceeds, N.
    pub load_p95_n: f64,
    /// The published mid-range statistic of the same flight with stiffness, load zero, delays, drift and transducer
    /// error as found here, m: a check by another method.
    pub midrange_at_fit_m: Option<f64>,
    /// Quality flags: findings that do not prevent the estimate.
    pub flags: Vec<QualityFlag>,
}

/// The result of a flight: its gap, or why the flight does not allow an estimate.
pub type ContactOutcome = Result<Box<ContactEstimate>, Rejection>;

impl ContactEstimate {
    /// The largest gap along the stroke, where the gap varies.
    pub fn largest_gap(&self) -> Option<&GapAtPlace> {
        self.gap_profile.iter().max_by(|a, b| a.gap_m.total_cmp(&b.gap_m))
    }

    /// Friction at the 95 % load, N.
    pub fn friction_n(&self) -> f64 {
        self.friction.at_n(self.load_p95_n)
    }
}
