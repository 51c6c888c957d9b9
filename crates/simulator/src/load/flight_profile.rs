//! Flight profile: duration, sample rate, commands and loads.
#![expect(missing_docs, reason = "docs/simulator.md explains each key")]

use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;

use crate::load::turbulence::GustForm;
use crate::load::vibration::Vibration;

/// An operational flight in six phases: preflight checks, take-off, climb, cruise, approach, landing.
///
/// The phases stretch with the duration. The load is dynamic pressure × (manoeuvre + gust −
/// stiffness × deflection), so it reverses many times unless `no_reversal` or `reversals` limits that.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, SmartDefault)]
#[serde(deny_unknown_fields, default)]
pub struct Profile {
    #[default(150.0)]
    pub duration_s: f64,
    #[default(250.0)]
    pub sample_rate_hz: f64,
    #[default(8000.0)]
    pub load_n: f64,
    #[default(0.03)]
    pub stroke_m: f64,
    #[default(0.3)]
    pub gust_share: f64,
    #[default(0.8)]
    pub gust_hz: f64,
    #[default(0.01)]
    pub trim_share: f64,
    #[default(0.12)]
    pub stick_share: f64,
    #[default(0.3)]
    pub hinge_share: f64,
    pub no_reversal: bool,
    pub gust_form: GustForm,
    pub reversals: Option<u32>,
    pub buffet: Vibration,
    pub motor_vibration: Vibration,
    pub rest_share: f64,
    #[default(10.0)]
    pub rest_s: f64,
}

impl Profile {
    pub(crate) fn samples(&self) -> usize {
        (self.duration_s * self.sample_rate_hz).round() as usize
    }

    /// Whether the load touches one flank only, so that the gap cannot be seen.
    pub fn is_one_sided(&self) -> bool {
        self.no_reversal || self.reversals == Some(0)
    }
}
