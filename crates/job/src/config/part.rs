//! A part number's settings: whose stiffness, damping, mass, sensors and limits we use.

use estimator::SensorNoise;
use ingest::Geometry;
use ingest::mapping::Output;
use records::Diagnostic;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_with::skip_serializing_none;

use crate::config::layers::Faults;

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

/// What wear follows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum WearAxis {
    /// Hours flown.
    Hours,
    /// Flights.
    Flights,
    /// Load reversals of the actuator.
    Reversals,
}

/// Action for a unit whose gap is at or above its limit.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum AtLimit {
    /// Replacement (the default).
    #[default]
    Replace,
    /// An inspection, which decides.
    Inspect,
}

/// Which gap the limits of a part apply to.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LimitedGap {
    /// `gap_m`: the mean over the time of the flight (the default).
    #[default]
    Mean,
    /// `gap_largest_m` of flights whose gap varies along the stroke, and `gap_m` of the others.
    Largest,
}

/// `[part."EMA-27-1040"]`: parameters of a part number.
#[skip_serializing_none]
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PartSettings {
    /// Whether the values are placeholders, which a run refuses.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub placeholder: bool,
    /// Default `linear`.
    pub kind: Kind,
    /// Linear: axial stiffness K, N/m.
    pub stiffness_n_per_m: Option<f64>,
    /// Linear: damping f, N·s/m.
    pub damping_n_s_per_m: Option<f64>,
    /// Linear: mass of the screw, kg.
    pub screw_mass_kg: Option<f64>,
    /// Linear: travel for one turn of the motor, m; needed for an angle or a torque.
    pub lead_m_per_rev: Option<f64>,
    /// Rotary: torsional stiffness, N·m/rad.
    pub stiffness_nm_per_rad: Option<f64>,
    /// Rotary: damping, N·m·s/rad.
    pub damping_nm_s_per_rad: Option<f64>,
    /// Rotary: inertia of the driven side, kg·m².
    pub inertia_kg_m2: Option<f64>,
    /// Rotary: radius at which the gap is measured, m.
    pub reference_radius_m: Option<f64>,
    /// `moving` (default), or `locked` where the output is fixed and the screw position constant.
    #[serde(skip_serializing_if = "Output::is_moving")]
    pub output: Output,
    /// Load, positive and negative, at which lost motion is measured, N.
    pub reference_load_n: Option<f64>,
    /// Noise of the sensors and of the model.
    pub noise: Option<NoiseSettings>,
    /// Removal limit, m: state `act` at or above.
    pub limit_m: Option<f64>,
    /// Alert level, m: state `watch` at or above.
    pub watch_m: Option<f64>,
    /// Gap that limits, trend and forecast apply to: `mean` over the stroke (default), or the largest along it.
    pub limit_applies_to: Option<LimitedGap>,
    /// What wear follows. Default: that of `[trend]`.
    pub axis: Option<WearAxis>,
    /// Action in state `act`. Default `replace`.
    pub at_limit: Option<AtLimit>,
    /// Limits of its other followed quantities, where they differ from those of `[trend]`.
    pub quantity_limits: Option<QuantityLimits>,
}

/// `[trend.quantity_limits]`, and `[part."…".quantity_limits]` for one part: changes since a unit's first flights from
/// which a followed quantity has a state.
#[skip_serializing_none]
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct QuantityLimits {
    /// Stiffness, as a share of the unit's own. Default 0.05.
    pub stiffness_share: Option<f64>,
    /// Friction at the unit's usual load, as a share of its own. Default 0.1.
    pub friction_share: Option<f64>,
    /// Lost motion at the reference load, as a share of the unit's own. Default 0.25.
    pub lost_motion_share: Option<f64>,
    /// Delay between the positions, s. Default 0.0005.
    pub delay_s: Option<f64>,
    /// Load zero, as a share of the unit's usual 95 % load. Default 0.02.
    pub load_zero_share: Option<f64>,
    /// Delay of the load, s. Default 0.001.
    pub load_delay_s: Option<f64>,
    /// Mean NIS, as a share of the unit's own. Default 1.
    pub nis_share: Option<f64>,
}

impl QuantityLimits {
    /// These limits, and others where a key is not given.
    #[must_use]
    pub fn or(self, other: Self) -> Self {
        Self {
            stiffness_share: self.stiffness_share.or(other.stiffness_share),
            friction_share: self.friction_share.or(other.friction_share),
            lost_motion_share: self.lost_motion_share.or(other.lost_motion_share),
            delay_s: self.delay_s.or(other.delay_s),
            load_zero_share: self.load_zero_share.or(other.load_zero_share),
            load_delay_s: self.load_delay_s.or(other.load_delay_s),
            nis_share: self.nis_share.or(other.nis_share),
        }
    }
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

/// `[part."…".noise]`: noise levels have no defaults; the operator of the fleet sets them.
#[skip_serializing_none]
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct NoiseSettings {
    /// Default `sensors`.
    pub model: NoiseModel,
    /// Noise of the screw position, rms, m.
    pub screw_rms_m: Option<f64>,
    /// Its smallest step, m.
    pub screw_resolution_m: Option<f64>,
    /// Noise of the motor position at the screw (angle × lead/2π), rms, m.
    pub motor_rms_m: Option<f64>,
    /// Its smallest step, m.
    pub motor_resolution_m: Option<f64>,
    /// Rms of the force outside the model, mainly friction, N.
    pub unknown_force_n: Option<f64>,
    /// Rotary: noise of the driven angle, rms, rad.
    pub screw_rms_rad: Option<f64>,
    /// Rotary: its smallest step, rad.
    pub screw_resolution_rad: Option<f64>,
    /// Rotary: noise of the motor angle brought to the driven side, rms, rad.
    pub motor_rms_rad: Option<f64>,
    /// Rotary: its smallest step, rad.
    pub motor_resolution_rad: Option<f64>,
    /// Rotary: rms of the torque outside the model, N·m.
    pub unknown_torque_nm: Option<f64>,
    /// Bandwidth of the backlash, Hz; 10 to 20 is suitable.
    pub bandwidth_hz: Option<f64>,
    /// `per_step`: process noise covariance, states δX, δẊ, S, SI.
    pub w_d: Option<[[f64; 3]; 3]>,
    /// `per_step` and `continuous`: measurement noise variance, m².
    pub v_d_m2: Option<f64>,
    /// `continuous`: density of the unknown force, N²·s.
    pub force_psd_n2_s: Option<f64>,
    /// `continuous`: density of the backlash rate, m²/s.
    pub backlash_rate_psd_m2_per_s: Option<f64>,
    /// Uncertainty of the initial relative position, rms, m; default: that of the measurement.
    pub initial_position_rms_m: Option<f64>,
    /// Uncertainty of the initial relative speed, rms, m/s; default 0.01.
    pub initial_speed_rms_m_per_s: Option<f64>,
    /// Uncertainty of the initial backlash, rms, m; default 0.001.
    pub initial_backlash_rms_m: Option<f64>,
}

/// A part, checked, at the screw axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// Stiffness, damping and mass at the screw axis.
    pub actuator: estimator::ActuatorModel,
    /// What brings its angles to the screw axis.
    pub geometry: Geometry,
    /// Its noise.
    pub noise: estimator::NoiseModel,
    /// Variances of the filter's initial state, P₀.
    pub initial: estimator::InitialVariances,
    /// The settings as configured. Users take from them what needs no conversion: output, reference load and limits.
    pub settings: PartSettings,
}

impl PartSettings {
    /// The settings that can move a gap: limits and the axis of wear move none.
    pub(crate) fn without_limits(&self) -> Self {
        Self {
            placeholder: false,
            limit_m: None,
            watch_m: None,
            limit_applies_to: None,
            axis: None,
            at_limit: None,
            quantity_limits: None,
            ..self.clone()
        }
    }

    /// Brings the settings to the screw axis, and reports every key that is missing, out of place or cannot be.
    pub(crate) fn check(&self, faults: &mut Faults<'_>) -> Option<Part> {
        self.check_kind(faults);
        if let Some((watch, limit)) = self.watch_m.zip(self.limit_m).filter(|(watch, limit)| watch > limit) {
            let what = format!("`watch_m` {watch} is above `limit_m` {limit}");
            faults.wrong(&["watch_m"], "limit_order", what, "set `watch_m` below `limit_m`");
        }
        let noise = self.check_noise(faults);
        let (actuator, geometry) = self.actuator(faults)?;
        Some(Part {
            actuator,
            geometry,
            noise: noise?,
            initial: self.noise.as_ref().map(NoiseSettings::initial).unwrap_or_default(),
            settings: self.clone(),
        })
    }

    /// Stiffness, damping, mass or inertia, and lead or reference radius of a kind of part, each with its key.
    pub(crate) fn keys_of(&self, kind: Kind) -> [(&'static str, Option<f64>); 4] {
        [
            [
                ("stiffness_n_per_m", self.stiffness_n_per_m),
                ("stiffness_nm_per_rad", self.stiffness_nm_per_rad),
            ],
            [
                ("damping_n_s_per_m", self.damping_n_s_per_m),
                ("damping_nm_s_per_rad", self.damping_nm_s_per_rad),
            ],
            [("screw_mass_kg", self.screw_mass_kg), ("inertia_kg_m2", self.inertia_kg_m2)],
            [("lead_m_per_rev", self.lead_m_per_rev), ("reference_radius_m", self.reference_radius_m)],
        ]
        .map(|of_kinds| of_kinds[kind as usize])
    }

    /// A key of the other kind is a misunderstanding, not a spare.
    fn check_kind(&self, faults: &mut Faults<'_>) {
        let (other, kind) = match self.kind {
            Kind::Linear => (Kind::Rotary, "linear"),
            Kind::Rotary => (Kind::Linear, "rotary"),
        };
        for (key, _) in self.keys_of(other).into_iter().filter(|(_, value)| value.is_some()) {
            let what = format!("`{key}` is not a key of a {kind} part");
            let hint = "`kind` is \"linear\" (default) or \"rotary\"";
            faults.wrong(&[key], "key_of_other_kind", what, hint);
        }
    }

    fn actuator(&self, faults: &mut Faults<'_>) -> Option<(estimator::ActuatorModel, Geometry)> {
        let [stiffness, damping, mass, lead_or_radius] = self.keys_of(self.kind);
        let [k, f, m] = [stiffness, damping, mass].map(|(key, value)| required(faults, &[key], value));
        let (model, geometry) = match self.kind {
            Kind::Linear => (
                estimator::ActuatorModel::linear(k?, f?, m?),
                Geometry::Linear { lead_m_per_rev: lead_or_radius.1 },
            ),
            Kind::Rotary => {
                let reference_radius_m = required(faults, &[lead_or_radius.0], lead_or_radius.1)?;
                let model = estimator::ActuatorModel::rotary(k?, f?, m?, reference_radius_m);
                (model, Geometry::Rotary { reference_radius_m })
            }
        };
        let model = model.map_err(|e| faults.report(&[stiffness.0], Diagnostic::new("bad_parameter", e)));
        Some((model.ok()?, geometry))
    }

    fn check_noise(&self, faults: &mut Faults<'_>) -> Option<estimator::NoiseModel> {
        let Some(noise) = &self.noise else {
            let hint = "[part.\"…\".noise] needs screw_rms_m, motor_rms_m, unknown_force_n and bandwidth_hz; see \
                        docs/configuration.md";
            let what = "the part has no `noise`, and there are no default levels";
            faults.wrong(&[], "key_missing", what, hint);
            return None;
        };
        let mut level = |key, value| required(faults, &["noise", key], value);
        match noise.model {
            NoiseModel::Sensors => noise.sensors(self, faults).map(estimator::NoiseModel::Sensors),
            NoiseModel::PerStep => {
                let v_d_m2 = level("v_d_m2", noise.v_d_m2);
                let w_d = required(faults, &["noise", "w_d"], noise.w_d)?;
                Some(estimator::NoiseModel::PerStep {
                    w_d: nalgebra::Matrix3::from_fn(|i, j| w_d[i][j]),
                    v_d_m2: v_d_m2?,
                })
            }
            NoiseModel::Continuous => {
                let force = level("force_psd_n2_s", noise.force_psd_n2_s);
                let rate = level("backlash_rate_psd_m2_per_s", noise.backlash_rate_psd_m2_per_s);
                let v_d_m2 = level("v_d_m2", noise.v_d_m2);
                Some(estimator::NoiseModel::Continuous {
                    force_psd_n2_s: force?,
                    backlash_rate_psd_m2_per_s: rate?,
                    v_d_m2: v_d_m2?,
                })
            }
        }
    }
}

impl NoiseSettings {
    /// P₀: the estimator's own where a key is missing.
    fn initial(&self) -> estimator::InitialVariances {
        let default = estimator::InitialVariances::default();
        let variance = |rms: Option<f64>| rms.map(|rms| rms * rms);
        estimator::InitialVariances {
            position_m2: variance(self.initial_position_rms_m),
            speed_m2_per_s2: variance(self.initial_speed_rms_m_per_s).unwrap_or(default.speed_m2_per_s2),
            backlash_m2: variance(self.initial_backlash_rms_m).unwrap_or(default.backlash_m2),
        }
    }

    /// Noise levels of the sensors of a kind of part, each with its key; a step that is not given is zero.
    pub(crate) fn levels(&self, kind: Kind) -> [(&'static str, Option<f64>); 5] {
        let none = Some(0.0);
        [
            [("screw_rms_m", self.screw_rms_m), ("screw_rms_rad", self.screw_rms_rad)],
            [
                ("screw_resolution_m", self.screw_resolution_m.or(none)),
                ("screw_resolution_rad", self.screw_resolution_rad.or(none)),
            ],
            [("motor_rms_m", self.motor_rms_m), ("motor_rms_rad", self.motor_rms_rad)],
            [
                ("motor_resolution_m", self.motor_resolution_m.or(none)),
                ("motor_resolution_rad", self.motor_resolution_rad.or(none)),
            ],
            [("unknown_force_n", self.unknown_force_n), ("unknown_torque_nm", self.unknown_torque_nm)],
        ]
        .map(|of_kinds| of_kinds[kind as usize])
    }

    /// Sensor facts at the screw axis; a rotary part's are in radians and newton metres.
    fn sensors(&self, part: &PartSettings, faults: &mut Faults<'_>) -> Option<SensorNoise> {
        let bandwidth_hz = required(faults, &["noise", "bandwidth_hz"], self.bandwidth_hz);
        let radius = if part.kind == Kind::Linear { 1.0 } else { part.reference_radius_m.unwrap_or(1.0) };
        let levels = self.levels(part.kind).map(|(key, level)| required(faults, &["noise", key], level));
        for level in levels.into_iter().flatten().filter(|level| !(level.is_finite() && *level >= 0.0)) {
            let what = format!("a noise level is {level}, which must be a number of at least zero");
            faults.report(&["noise"], Diagnostic::new("bad_parameter", what));
        }
        let [screw_rms, screw_resolution, motor_rms, motor_resolution, force] = levels;
        Some(SensorNoise {
            screw_rms_m: screw_rms? * radius,
            screw_resolution_m: screw_resolution? * radius,
            motor_rms_m: motor_rms? * radius,
            motor_resolution_m: motor_resolution? * radius,
            unknown_force_n: force? / radius,
            bandwidth_hz: bandwidth_hz?,
        })
    }
}

/// The value of a key that a part must have; a missing one is reported.
fn required<T>(faults: &mut Faults<'_>, key: &[&str], value: Option<T>) -> Option<T> {
    if value.is_none() {
        let name = key.join(".");
        let hint = format!("add a line `{name} = …`, in the unit of the key's name (docs/keys.md)");
        faults.wrong(key, "key_missing", format!("the part has no `{name}`"), hint);
    }
    value
}
