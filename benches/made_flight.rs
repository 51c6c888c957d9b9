//! A made flight of 250 Hz, and the filter of its actuator.

use estimator::{ActuatorModel, Error, Filter, NoiseModel, SensorNoise};

pub const STEP_S: f64 = 0.004;

/// K = 5·10⁷ N/m, noise of usual sensors.
pub fn filter() -> Result<Filter, Error> {
    let noise = NoiseModel::Sensors(SensorNoise {
        screw_rms_m: 3e-6,
        screw_resolution_m: 2.3e-6,
        motor_rms_m: 1e-6,
        motor_resolution_m: 3e-7,
        unknown_force_n: 200.0,
        bandwidth_hz: 10.0,
    });
    Filter::new(&ActuatorModel::linear(5e7, 2000.0, 8.0)?, STEP_S, &noise)
}

/// X₁, δX and the load: a gap of 100 µm, and 200 N of friction against the motion.
pub fn channels(count: usize) -> [Vec<f64>; 3] {
    let time_s = |k: usize| k as f64 * STEP_S;
    let load_n: Vec<f64> = (0..count).map(|k| 5e3 * time_s(k).sin()).collect();
    let motor_m = (0..count).map(|k| 0.02 * (0.7 * time_s(k)).sin()).collect();
    let force_n = |k: usize| load_n[k] - 200.0 * (0.7 * time_s(k)).cos().signum();
    let dx_m = (0..count).map(|k| force_n(k) / 5e7 + 50e-6 * force_n(k).signum()).collect();
    [motor_m, dx_m, load_n]
}
