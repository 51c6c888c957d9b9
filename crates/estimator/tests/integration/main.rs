//! Public API of `estimator`: reference vectors of independent libraries, flights of independent simulators,
//! and properties of a linear filter.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod contact;
mod flights;
mod parquet_fixture;
mod properties;
mod stream;
mod vectors;

use estimator::{NoiseModel, SensorNoise};

/// Noise of the sensors of a usual part.
fn sensor_noise(bandwidth_hz: f64) -> NoiseModel {
    NoiseModel::Sensors(SensorNoise {
        screw_rms_m: 3e-6,
        screw_resolution_m: 2.3e-6,
        motor_rms_m: 1e-6,
        motor_resolution_m: 3e-7,
        unknown_force_n: 200.0,
        bandwidth_hz,
    })
}
