//! Flight profile: duration, sample rate, commands and loads.

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
    /// Length of the log, seconds, 5 to 20 000. Default 150.
    #[default(150.0)]
    pub duration_s: f64,
    /// Samples per second, 10 to 5000. Default 250.
    #[default(250.0)]
    pub sample_rate_hz: f64,
    /// The load that about one cruise sample in twenty exceeds, N. Default 8000.
    #[default(8000.0)]
    pub load_n: f64,
    /// Half the stroke: commands stay within ± this, metres. Default 0.03.
    #[default(0.03)]
    pub stroke_m: f64,
    /// Rms of the gust-like load over `load_n`. Default 0.3.
    #[default(0.3)]
    pub gust_share: f64,
    /// Corner of the gust's spectrum, which falls with the fourth power beyond, Hz. Default 0.8.
    #[default(0.8)]
    pub gust_hz: f64,
    /// Rms of the ever-present small trim motion over the stroke. Default 0.01.
    #[default(0.01)]
    pub trim_share: f64,
    /// Rms of the pilot's moves over the stroke. Default 0.12.
    #[default(0.12)]
    pub stick_share: f64,
    /// Load by which a full deflection reduces the load at full dynamic pressure, over `load_n`. Default 0.3.
    #[default(0.3)]
    pub hinge_share: f64,
    /// The load keeps one sign throughout: the gap cannot be seen. Default false.
    pub no_reversal: bool,
    /// Spectrum of the gusts; `gust_hz` is `V/2πL` in the turbulence forms. Default `low_pass`.
    pub gust_form: GustForm,
    /// Number of changes of the load's sign, at random times. Default none: the profile decides.
    pub reversals: Option<u32>,
    /// Vibration of the load, in shares of `load_n`; as strong on ground as in flight. Default silent.
    pub buffet: Vibration,
    /// Vibration of the motor on top of what its drive does, metres at the screw. Default silent.
    pub motor_vibration: Vibration,
    /// Share of the flight after the preflight checks with a constant command. Default 0.
    pub rest_share: f64,
    /// Mean length of a rest, seconds; rests last between half and one and a half times this. Default 10.
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
