//! Public API of `estimator`: reference vectors of independent libraries, flights of independent simulators,
//! and properties of a linear filter.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod contact;
mod flights;
mod parquet_fixture;
mod properties;
mod stream;
mod vectors;

use std::ops::Range;

use estimator::{ActuatorModel, Filter, GainSchedule, NoiseModel, Samples, SensorNoise};

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

/// The filter of a usual part.
fn filter(rate_hz: f64, bandwidth_hz: f64) -> Filter {
    let actuator = ActuatorModel::linear(5e7, 2000.0, 8.0).unwrap();
    Filter::new(&actuator, rate_hz.recip(), &sensor_noise(bandwidth_hz)).unwrap()
}

fn samples_of<'a>(dx_m: &'a [f64], load_n: &'a [f64], segments: &'a [Range<usize>]) -> Samples<'a> {
    Samples { step_s: 0.004, motor_m: dx_m, dx_m, load_n, segments }
}

/// S by the batch, m.
fn track(filter: &Filter, dx_m: &[f64], load_n: &[f64], segments: &[Range<usize>]) -> Vec<f64> {
    let mut s_m = Vec::new();
    GainSchedule::new(filter).track(&samples_of(dx_m, load_n, segments), &mut s_m).unwrap();
    s_m
}

/// As [`track`], of one segment.
fn batch(filter: &Filter, dx_m: &[f64], load_n: &[f64]) -> Vec<f64> {
    let whole = 0..dx_m.len();
    track(filter, dx_m, load_n, std::slice::from_ref(&whole))
}
