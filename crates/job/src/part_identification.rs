//! Part parameters identified from logs: stiffness, sensor noise, friction. Compare them with the data sheet; they
//! also replace a guess of the noise levels.

use estimator::contact::ContactEstimate;
use estimator::{NoiseModel, SensorNoise};
use ingest::channel::noise_floor::{WhiteNoise, white_noise};
use ingest::{ActuatorChannels, Geometry};

use crate::config::part::Part;

/// Friction below this share of the load is not distinguishable from none.
const MIN_FRICTION_SHARE: f64 = 0.01;

/// Parameters identified from one actuator in one flight, or the medians of many; SI at the screw axis.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct IdentifiedParams {
    /// K that the contact regression fitted, N/m.
    pub stiffness_n_per_m: Option<f64>,
    /// White noise of the screw position, rms, m.
    pub screw_rms_m: Option<f64>,
    /// Its standard uncertainty, m.
    pub screw_uncertainty_m: Option<f64>,
    /// Its smallest step, m.
    pub screw_resolution_m: Option<f64>,
    /// White noise of the motor position, rms, m.
    pub motor_rms_m: Option<f64>,
    /// Its standard uncertainty, m.
    pub motor_uncertainty_m: Option<f64>,
    /// Its smallest step, m.
    pub motor_resolution_m: Option<f64>,
    /// Friction of the screw at the rms load, N: the force the model does not know.
    pub unknown_force_n: Option<f64>,
}

/// The keys of a linear and of a rotary part, below the part.
const KEYS: [[&str; 2]; 6] = [
    ["stiffness_n_per_m", "stiffness_nm_per_rad"],
    ["noise.screw_rms_m", "noise.screw_rms_rad"],
    ["noise.screw_resolution_m", "noise.screw_resolution_rad"],
    ["noise.motor_rms_m", "noise.motor_rms_rad"],
    ["noise.motor_resolution_m", "noise.motor_resolution_rad"],
    ["noise.unknown_force_n", "noise.unknown_torque_nm"],
];

/// A key of `[part."…"]`, its identified value, and its configured value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ParamComparison {
    /// The key, below the part.
    pub key: &'static str,
    /// From the logs, in the key's unit.
    pub identified: f64,
    /// Standard uncertainty of `identified`, where it is known.
    pub uncertainty: Option<f64>,
    /// As configured; none where the noise model asks for no such level.
    pub configured: Option<f64>,
}

impl IdentifiedParams {
    /// Parameters of one actuator; `None` for those that the flight does not identify.
    pub fn of(channels: &ActuatorChannels, found: Option<&ContactEstimate>) -> Self {
        let [motor, screw, _] = &channels.quality;
        let motor_noise = white_noise(&channels.motor_m, motor.resolution);
        let screw_noise = screw_noise(channels, screw.resolution);
        let mut params = Self {
            motor_rms_m: motor_noise.map(|noise| noise.rms),
            motor_uncertainty_m: motor_noise.map(|noise| noise.uncertainty),
            screw_rms_m: screw_noise.map(|noise| noise.rms),
            screw_uncertainty_m: screw_noise.map(|noise| noise.uncertainty),
            motor_resolution_m: motor.resolution,
            screw_resolution_m: screw.resolution,
            ..Self::default()
        };
        if let Some(found) = found {
            params.stiffness_n_per_m = Some(found.stiffness_n_per_m);
            let load_n = rms_n(&channels.load_n);
            let friction_n = found.friction.at_n(load_n);
            params.unknown_force_n = (friction_n > MIN_FRICTION_SHARE * load_n).then_some(friction_n);
        }
        params
    }

    /// The median of each fact, over those that show it.
    pub fn medians(all: &[Self]) -> Self {
        let median = |of: fn(&Self) -> Option<f64>| {
            let mut values: Vec<f64> = all.iter().filter_map(of).collect();
            let middle = values.len() / 2;
            (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
        };
        Self {
            stiffness_n_per_m: median(|f| f.stiffness_n_per_m),
            screw_rms_m: median(|f| f.screw_rms_m),
            screw_uncertainty_m: median(|f| f.screw_uncertainty_m),
            screw_resolution_m: median(|f| f.screw_resolution_m),
            motor_rms_m: median(|f| f.motor_rms_m),
            motor_uncertainty_m: median(|f| f.motor_uncertainty_m),
            motor_resolution_m: median(|f| f.motor_resolution_m),
            unknown_force_n: median(|f| f.unknown_force_n),
        }
    }

    /// The facts under the keys and in the units in which a part of this kind is configured.
    pub fn comparisons(&self, part: &Part) -> Vec<ParamComparison> {
        let sensors = match part.noise {
            NoiseModel::Sensors(sensors) => Some(sensors),
            _ => None,
        };
        let stiffness = part.actuator.stiffness_n_per_m();
        // The column of the keys, and what a radius makes of their units.
        let (column, length, force, rate) = match part.geometry {
            Geometry::Linear { .. } => (0, 1.0, 1.0, 1.0),
            Geometry::Rotary { reference_radius_m: r } => (1, r.recip(), r, r * r),
        };
        let level = |of: fn(&SensorNoise) -> f64| sensors.as_ref().map(of);
        let values = [
            (rate, self.stiffness_n_per_m, None, Some(stiffness)),
            (length, self.screw_rms_m, self.screw_uncertainty_m, level(|s| s.screw_rms_m)),
            (length, self.screw_resolution_m, None, level(|s| s.screw_resolution_m)),
            (length, self.motor_rms_m, self.motor_uncertainty_m, level(|s| s.motor_rms_m)),
            (length, self.motor_resolution_m, None, level(|s| s.motor_resolution_m)),
            (force, self.unknown_force_n, None, level(|s| s.unknown_force_n)),
        ];
        let comparisons =
            KEYS.iter().zip(values).map(|(keys, (scale, identified, uncertainty, configured))| {
                Some(ParamComparison {
                    key: keys[column],
                    identified: identified? * scale,
                    uncertainty: uncertainty.map(|v: f64| v * scale),
                    configured: configured.map(|v| v * scale),
                })
            });
        comparisons.flatten().collect()
    }
}

/// White noise of the screw channel as it was recorded: the screw's own position, or the relative one.
fn screw_noise(channels: &ActuatorChannels, resolution: Option<f64>) -> Option<WhiteNoise> {
    let screw_m: Vec<f64> =
        channels.dx_m.iter().zip(&channels.motor_m).map(|(dx, motor)| dx + motor).collect();
    // The channel that was recorded carries the noise of one sensor, the other that of both.
    let [own, relative] = [&screw_m, &channels.dx_m].map(|values| white_noise(values, resolution));
    own.into_iter().chain(relative).min_by(|a, b| a.rms.total_cmp(&b.rms))
}

fn rms_n(load_n: &[f64]) -> f64 {
    let present = || load_n.iter().filter(|f| !f.is_nan());
    (present().map(|f| f * f).sum::<f64>() / present().count().max(1) as f64).sqrt()
}
