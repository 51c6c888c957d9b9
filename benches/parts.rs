//! One part of an estimate over a made flight of 250 Hz, once and on request: what `instructions` counts.
//!
//! `parts NAME SAMPLES`, with a name of [`PARTS`].

#![allow(clippy::print_stderr, reason = "a program for the prompt")]

use std::hint::black_box;
use std::process::ExitCode;

use estimator::SensorNoise;
use estimator::contact::{self, PartPrior};
use estimator::{
    ActuatorModel, Error, Filter, FilterWorkspace, GainSchedule, NoiseModel, Samples, gap, midrange,
};

const STEP_S: f64 = 0.004;
/// What can be asked for; `nothing` makes the flight and no more.
const PARTS: [&str; 7] = ["nothing", "schedule", "filter", "statistic", "load", "published", "contact"];

fn main() -> ExitCode {
    let mut args = std::env::args().skip(1);
    let (Some(part), Some(Ok(count))) = (args.next(), args.next().map(|n| n.parse())) else {
        eprintln!("parts NAME SAMPLES, with NAME one of {PARTS:?}");
        return ExitCode::from(2);
    };
    match run(&part, count) {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("{e}");
            ExitCode::FAILURE
        }
    }
}

fn filter() -> Result<Filter, Error> {
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

fn run(part: &str, count: usize) -> Result<(), Error> {
    let time_s = |k: usize| k as f64 * STEP_S;
    let load_n: Vec<f64> = (0..count).map(|k| 5e3 * time_s(k).sin()).collect();
    let motor_m: Vec<f64> = (0..count).map(|k| 0.02 * (0.7 * time_s(k)).sin()).collect();
    // Friction of 200 N against the motion, a stiffness of 5·10⁷ N/m and a gap of 100 µm.
    let force_n = |k: usize| load_n[k] - 200.0 * (0.7 * time_s(k)).cos().signum();
    let dx_m: Vec<f64> = (0..count).map(|k| force_n(k) / 5e7 + 50e-6 * force_n(k).signum()).collect();
    let whole = 0..count;
    let segments = std::slice::from_ref(&whole);
    let samples = Samples { step_s: STEP_S, motor_m: &motor_m, dx_m: &dx_m, load_n: &load_n, segments };
    let prior = PartPrior::of_stiffness(5e7);
    let filter = filter()?;
    match part {
        "schedule" => drop(black_box(GainSchedule::new(&filter))),
        "filter" => drop(black_box(filter.track(&samples, None)?)),
        "statistic" => drop(black_box(gap::mid_range(&dx_m)).is_ok()),
        "load" => drop(black_box(gap::load_band(&load_n, segments)).is_some()),
        "published" => {
            black_box(midrange::estimate_with(
                &samples,
                &GainSchedule::new(&filter),
                &mut FilterWorkspace::default(),
            )?);
        }
        "contact" => drop(black_box(contact::estimate(&samples, &prior)?)),
        _ => {}
    }
    black_box((dx_m, motor_m, load_n));
    Ok(())
}
