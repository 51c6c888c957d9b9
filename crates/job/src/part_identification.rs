//! Part parameters identified from logs: stiffness, sensor noise, friction. Compare them with the data sheet; they
//! also replace a guess of the noise levels.

use estimator::contact::ContactEstimate;
use ingest::channel::noise_floor::{WhiteNoise, white_noise};
use ingest::{ActuatorChannels, Geometry};

use crate::config::part::{NoiseModel, Part};

/// Friction below this share of the load is not distinguishable from none.
const MIN_FRICTION_SHARE: f64 = 0.01;

#[derive(Debug, Clone, Copy, PartialEq)]
struct Identified {
    value: f64,
    uncertainty: Option<f64>,
}

/// Parameters identified from one actuator in one flight, or the medians of many; SI at the screw axis: stiffness by the
/// contact regression; white noise and smallest step of the screw and of the motor position; and the unknown force, which
/// is the friction of the screw at the rms load.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct IdentifiedParams([Option<Identified>; 6]);

/// A key of `[part."…"]`, its identified value, and its configured value.
#[derive(Debug, Clone, PartialEq)]
pub struct ParamComparison {
    /// The key, below the part.
    pub key: String,
    /// From the logs, in the key's unit.
    pub identified: f64,
    /// Standard uncertainty of `identified`, where it is known.
    pub uncertainty: Option<f64>,
    /// The configured value; `None` if the noise model has no such level.
    pub configured: Option<f64>,
}

impl IdentifiedParams {
    /// Parameters of one actuator; `None` for those that the flight does not identify.
    pub fn of(channels: &ActuatorChannels, found: Option<&ContactEstimate>) -> Self {
        let [motor, screw, _] = &channels.quality;
        let noise = |noise: WhiteNoise| Identified { value: noise.rms, uncertainty: Some(noise.uncertainty) };
        let exact = |value: f64| Identified { value, uncertainty: None };
        let friction_n = found.and_then(|found| {
            let present = || channels.load_n.iter().filter(|load_n| !load_n.is_nan());
            let mean_square_n2 =
                present().map(|load_n| load_n * load_n).sum::<f64>() / present().count().max(1) as f64;
            let load_n = mean_square_n2.sqrt();
            Some(found.friction.at_n(load_n)).filter(|friction_n| *friction_n > MIN_FRICTION_SHARE * load_n)
        });
        // The channel that was recorded, the screw's own position or the relative one, carries the noise of one sensor,
        // the other that of both.
        let screw_m: Vec<f64> =
            channels.dx_m.iter().zip(&channels.motor_m).map(|(dx, motor)| dx + motor).collect();
        let [own, relative] = [&screw_m, &channels.dx_m].map(|values| white_noise(values, screw.resolution));
        let screw_noise = own.into_iter().chain(relative).min_by(|a, b| a.rms.total_cmp(&b.rms));
        Self([
            found.map(|found| exact(found.stiffness_n_per_m)),
            screw_noise.map(noise),
            screw.resolution.map(exact),
            white_noise(&channels.motor_m, motor.resolution).map(noise),
            motor.resolution.map(exact),
            friction_n.map(exact),
        ])
    }

    /// The median of each parameter, over those that identify it.
    pub fn medians(all: &[Self]) -> Self {
        let median = |values: &mut dyn Iterator<Item = f64>| {
            let mut values: Vec<f64> = values.collect();
            let middle = values.len() / 2;
            (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
        };
        Self(std::array::from_fn(|at| {
            let found = || all.iter().filter_map(|params| params.0[at]);
            let uncertainty = median(&mut found().filter_map(|param| param.uncertainty));
            Some(Identified { value: median(&mut found().map(|param| param.value))?, uncertainty })
        }))
    }

    /// The parameters under the keys and in the units in which a part of this kind is configured.
    pub fn comparisons(&self, part: &Part) -> Vec<ParamComparison> {
        let settings = &part.settings;
        let [(stiffness, configured), ..] = settings.keys_of(settings.kind);
        let noise = settings.noise.clone().unwrap_or_default();
        let is_of_sensors = noise.model == NoiseModel::Sensors;
        let levels = noise.levels(settings.kind);
        let levels = levels.map(|(key, level)| (format!("noise.{key}"), level.filter(|_| is_of_sensors)));
        // Factors from SI at the screw axis to the units of the keys.
        let scales = match part.geometry {
            Geometry::Linear { .. } => [1.0; 6],
            Geometry::Rotary { reference_radius_m: r } => [r * r, 1.0 / r, 1.0 / r, 1.0 / r, 1.0 / r, r],
        };
        let keys = std::iter::once((stiffness.to_owned(), configured)).chain(levels);
        let all = keys.zip(scales).zip(self.0);
        all.filter_map(|(((key, configured), scale), identified)| {
            let Identified { value, uncertainty } = identified?;
            let uncertainty = uncertainty.map(|v| v * scale);
            Some(ParamComparison { key, identified: value * scale, uncertainty, configured })
        })
        .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_pass_over_what_a_flight_did_not_show() {
        let params = |value: Option<f64>| {
            let stiffness = value.map(|value| Identified { value, uncertainty: None });
            IdentifiedParams([stiffness, None, None, None, None, None])
        };
        let all = [params(Some(3.0)), params(None), params(Some(1.0)), params(Some(2.0))];
        assert_eq!(IdentifiedParams::medians(&all), params(Some(2.0)));
    }
}
