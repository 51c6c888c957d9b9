//! A part number's settings: whose stiffness, damping, mass, sensors and limits we use.

use estimator::noise::Noise;
use fleet::Complaint;
use ingest::Geometry;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How a part moves.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// A screw that pushes: metres, newtons, kilograms.
    #[default]
    Linear,
    /// A part that only turns: radians, newton metres, kg·m²; its gap is stated at `reference_radius_m`.
    Rotary,
}

/// `[part."EMA-27-1040"]`: what is known of a design.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PartSettings {
    /// `linear` (default) or `rotary`.
    pub kind: Kind,
    /// Linear: axial stiffness K, N/m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stiffness_n_per_m: Option<f64>,
    /// Linear: damping f, N·s/m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub damping_n_s_per_m: Option<f64>,
    /// Linear: mass of the screw, kg.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub screw_mass_kg: Option<f64>,
    /// Linear: travel for one turn of the motor, m; needed when a channel is an angle or a torque.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lead_m_per_rev: Option<f64>,
    /// Rotary: torsional stiffness, N·m/rad.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stiffness_nm_per_rad: Option<f64>,
    /// Rotary: damping, N·m·s/rad.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub damping_nm_s_per_rad: Option<f64>,
    /// Rotary: inertia of the driven side, kg·m².
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inertia_kg_m2: Option<f64>,
    /// Rotary: the radius at which the gap is stated, m: `gap_m` = radius × radians.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reference_radius_m: Option<f64>,
    /// Load between whose positive and negative value lost motion is stated, N.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reference_load_n: Option<f64>,
    /// What the sensors and the model do not know.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise: Option<NoiseSettings>,
    /// The gap that grounds: state `act`, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub limit_m: Option<f64>,
    /// The gap that is reported: state `watch`, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub watch_m: Option<f64>,
}

/// Which noise model fills `W_d` and `V_d`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum NoiseModel {
    /// From sensor facts and a bandwidth (the default).
    #[default]
    Sensors,
    /// `W_d` and `V_d` given per step, as the paper has them; right for one sample rate only.
    PerStep,
    /// Exact from continuous densities.
    Continuous,
}

/// `[part."…".noise]`: there are no default noise levels; whoever runs a fleet chooses them.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct NoiseSettings {
    /// `sensors` (default), `per_step` or `continuous`.
    pub model: NoiseModel,
    /// Noise of the screw position, rms, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub screw_rms_m: Option<f64>,
    /// Its smallest step, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub screw_resolution_m: Option<f64>,
    /// Noise of the motor position at the screw (angle × lead/2π), rms, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub motor_rms_m: Option<f64>,
    /// Its smallest step, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub motor_resolution_m: Option<f64>,
    /// Rms of the force the model does not know, mainly friction, N.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unknown_force_n: Option<f64>,
    /// Rotary: noise of the driven angle, rms, rad.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub screw_rms_rad: Option<f64>,
    /// Rotary: its smallest step, rad.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub screw_resolution_rad: Option<f64>,
    /// Rotary: noise of the motor angle brought to the driven side, rms, rad.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub motor_rms_rad: Option<f64>,
    /// Rotary: its smallest step, rad.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub motor_resolution_rad: Option<f64>,
    /// Rotary: rms of the torque the model does not know, N·m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unknown_torque_nm: Option<f64>,
    /// The bandwidth in which the backlash may move, Hz; 10–20 does well.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bandwidth_hz: Option<f64>,
    /// `per_step`: process noise covariance, states δX, δẊ, S, SI.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub w_d: Option<[[f64; 3]; 3]>,
    /// `per_step` and `continuous`: measurement noise variance, m².
    #[serde(skip_serializing_if = "Option::is_none")]
    pub v_d_m2: Option<f64>,
    /// `continuous`: density of the unknown force, N²·s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub force_psd_n2_s: Option<f64>,
    /// `continuous`: density of the backlash rate, m²/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub backlash_rate_psd_m2_per_s: Option<f64>,
}

/// A part, checked, at the screw axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// Stiffness, damping and mass at the screw axis.
    pub actuator: estimator::Actuator,
    /// What brings its angles to the screw axis.
    pub geometry: Geometry,
    /// Its noise.
    pub noise: Noise,
    /// Load between whose positive and negative value lost motion is stated, N.
    pub reference_load_n: Option<f64>,
    /// The gap that grounds, m.
    pub limit_m: Option<f64>,
    /// The gap that is reported, m.
    pub watch_m: Option<f64>,
}

/// A complaint about one key of a part.
pub(crate) type KeyComplaint = (&'static [&'static str], Complaint);
