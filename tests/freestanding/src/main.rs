//! The filter and the gap statistic over a reference vector, on bare Linux x86-64: the exit code is 0 when
//! they agree with it, 1 when they do not, 2 when an estimate could not be made.
//!
//! Asked with any argument, one position is read 1 nm wrong, and the exit code must be 1.

#![no_std]
#![no_main]

mod bare;
mod panics;
mod vector;

use estimator::{ActuatorModel, Error, Filter, NoiseModel, Stream, gap};
use nalgebra::Matrix3;
use vector::{GAP_M, SAMPLES};

/// Largest difference of S, as a share of its peak, and of the gap.
const TOLERANCE: f64 = 1e-12;
/// The row that is read wrong, and by how much, m.
const WRONG: (usize, f64) = (150, 1e-9);

/// Where the process starts, with the number of its words: the program's name, and any argument.
extern "C" fn run(words: usize) -> ! {
    bare::exit(match agrees(words > 1) {
        Ok(true) => 0,
        Ok(false) => 1,
        Err(_) => 2,
    })
}

fn agrees(wrong: bool) -> Result<bool, Error> {
    let filter = filter()?;
    let even = follows(Stream::constant_time(&filter), wrong)?;
    let as_batch = follows(Stream::steady_state(&filter), wrong)?;
    Ok(even && as_batch)
}

fn filter() -> Result<Filter, Error> {
    let [stiffness_n_per_m, damping_n_s_per_m, screw_mass_kg] = vector::ACTUATOR;
    let actuator = ActuatorModel::linear(stiffness_n_per_m, damping_n_s_per_m, screw_mass_kg)?;
    let w_d = Matrix3::from(vector::W_D);
    Filter::new(&actuator, vector::STEP_S, &NoiseModel::PerStep { w_d, v_d_m2: vector::V_D_M2 })
}

/// Whether S, sample by sample, and ΔS at the end are the reference's.
fn follows(mut stream: Stream, wrong: bool) -> Result<bool, Error> {
    let (mut peak_m, mut worst_m, mut found_m) = (0.0_f64, 0.0_f64, [0.0; SAMPLES.len()]);
    for (k, &[y_m, load_n, wanted_m]) in SAMPLES.iter().enumerate() {
        let error_m = if wrong && k == WRONG.0 { WRONG.1 } else { 0.0 };
        let s_m = stream.push(y_m + error_m, load_n)?.s_m();
        found_m[k] = s_m;
        (peak_m, worst_m) = (peak_m.max(wanted_m.abs()), worst_m.max((s_m - wanted_m).abs()));
    }
    let error = gap::mid_range(&found_m)?.gap_m / GAP_M - 1.0;
    Ok(worst_m <= TOLERANCE * peak_m && error.abs() <= TOLERANCE)
}
