//! The methods compared: contact regression, the paper's statistic and two baselines.

use estimator::{ActuatorModel, InitialVariances, NoiseModel, SensorNoise};
use ingest::Geometry;
use ingest::log::in_memory::ChannelArrays;
use job::Part;
use job::config::EstimateSettings;
use job::config::part::PartSettings;
use records::Position;
use simulator::Sensors;

use crate::scenarios::Class;

/// The results of every method for one flight, m; NaN where a method gave no number.
#[derive(Debug, Clone)]
pub(crate) struct MethodResults {
    pub(crate) index: u64,
    /// The true gap, extrapolated from the stiff part of the flanks.
    pub(crate) truth_m: f64,
    /// Contact regression with its 90 % bounds: gap, lower, upper.
    pub(crate) contact: Option<(f64, f64, f64)>,
    /// The reason of a refusal, or the flags of an estimate.
    pub(crate) codes: Vec<String>,
    pub(crate) by_method_m: [f64; METHODS.len()],
}

/// The methods compared, ours first.
pub(crate) const METHODS: [&str; 4] = ["contact regression", "paper (29–31)", "load lines", "P99 − P1 of δX"];

/// Travel of the screw in one turn of the motor, m.
const LEAD_M_PER_REV: f64 = 0.005;
/// The friction that a fleet expects, N.
const UNKNOWN_FORCE_N: f64 = 200.0;
/// Bandwidth of the backlash, Hz.
const BANDWIDTH_HZ: f64 = 10.0;

/// Flies a flight of a class and applies every method, as `freeplay estimate` would.
pub(crate) fn estimate_flight(class: &Class, index: u64) -> Result<MethodResults, String> {
    apply_methods(class, index).map_err(|error| format!("{} {index}: {error}", class.name))
}

fn apply_methods(class: &Class, index: u64) -> Result<MethodResults, Box<dyn std::error::Error>> {
    let case = class.case(index);
    let flight = case.fly()?;
    // The part as a fleet would configure it: the assumed stiffness and the true sensor noise.
    let part = Part {
        actuator: ActuatorModel::linear(case.assumed_stiffness_n_per_m(), 2000.0, 8.0)?,
        geometry: Geometry::Linear { lead_m_per_rev: Some(LEAD_M_PER_REV) },
        noise: expected_noise(&case.sensors),
        initial: InitialVariances::default(),
        settings: PartSettings::default(),
    };
    // The flight's channels as the estimator gets them from a log.
    let arrays = ChannelArrays {
        time_s: &flight.time_s,
        motor_m: &flight.motor_m,
        screw_m: &flight.screw_m,
        load_n: &flight.load_n,
    };
    let channels = arrays.to_channels(Position::new("actuator")?).map_err(|e| e.diagnostic().to_string())?;
    let found =
        job::estimate::estimate(&channels, &part, &EstimateSettings::default()).map_err(|e| e.to_string())?;
    let contact = match (found.gap_m, found.gap_p05_m, found.gap_p95_m) {
        (Some(gap_m), Some(low_m), Some(high_m)) => Some((gap_m, low_m, high_m)),
        _ => None,
    };
    let mut codes = found.flags;
    if contact.is_none() {
        codes = found.reason.into_iter().collect();
    }
    let by_method_m = [
        contact.map_or(f64::NAN, |(gap_m, ..)| gap_m),
        found.gap_midrange_m.unwrap_or(f64::NAN),
        load_lines_m(&channels.dx_m, &channels.load_n),
        spread_m(&channels.dx_m),
    ];
    Ok(MethodResults { index, truth_m: case.extrapolated_gap_m(&flight), contact, codes, by_method_m })
}

/// The noise as a fleet would configure it: that of the sensors, and friction that it expects.
pub(crate) fn expected_noise(sensors: &Sensors) -> NoiseModel {
    NoiseModel::Sensors(SensorNoise {
        screw_rms_m: sensors.screw.noise_rms,
        screw_resolution_m: sensors.screw.resolution,
        motor_rms_m: sensors.motor.noise_rms,
        motor_resolution_m: sensors.motor.resolution,
        unknown_force_n: UNKNOWN_FORCE_N,
        bandwidth_hz: BANDWIDTH_HZ,
    })
}

/// A baseline: δX on F by least squares on each side of the load, beyond a tenth of its greatest; the
/// difference of the intercepts.
pub(crate) fn load_lines_m(dx_m: &[f64], load_n: &[f64]) -> f64 {
    let least_n = 0.1 * load_n.iter().fold(0.0_f64, |most, f| most.max(f.abs()));
    let intercept_m = |side: f64| {
        let (mut n, mut sf, mut sy, mut sff, mut sfy) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for (y, f) in dx_m.iter().zip(load_n).filter(|(y, f)| y.is_finite() && **f * side > least_n) {
            (n, sf, sy, sff, sfy) = (n + 1.0, sf + f, sy + y, sff + f * f, sfy + f * y);
        }
        (sy * sff - sf * sfy) / (n * sff - sf * sf)
    };
    intercept_m(1.0) - intercept_m(-1.0)
}

/// A baseline: the 99 % quantile of δX less the 1 % quantile.
pub(crate) fn spread_m(dx_m: &[f64]) -> f64 {
    let mut sorted: Vec<f64> = dx_m.iter().copied().filter(|y| y.is_finite()).collect();
    if sorted.is_empty() {
        return f64::NAN;
    }
    sorted.sort_unstable_by(f64::total_cmp);
    sorted[(sorted.len() - 1) * 99 / 100] - sorted[(sorted.len() - 1) / 100]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn load_lines_read_the_gap_off_two_straight_flanks() {
        let load_n: Vec<f64> = (-50..=50).map(|k| 100.0 * f64::from(k)).collect();
        let dx_m: Vec<f64> = load_n.iter().map(|f| f / 5e7 + 40e-6 * f.signum()).collect();
        assert!((load_lines_m(&dx_m, &load_n) - 80e-6).abs() < 1e-12);
    }

    #[test]
    fn the_spread_passes_over_missing_samples() {
        let mut dx_m: Vec<f64> = (0..=100).map(f64::from).collect();
        dx_m.push(f64::NAN);
        assert!((spread_m(&dx_m) - 98.0).abs() < 1e-12 && spread_m(&[f64::NAN]).is_nan());
    }
}
