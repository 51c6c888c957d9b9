//! Runs one part of an estimate once, over a synthetic flight of 250 Hz; `instructions` counts its instructions.
//!
//! `parts NAME SAMPLES`, with a name of [`PARTS`].

mod made_flight;

use std::hint::black_box;

use estimator::contact::{self, ContactWorkspace, PartPrior};
use estimator::{GainSchedule, Samples, gap, midrange};
use made_flight::{STEP_S, channels, filter};

/// Names of the parts; `nothing` only makes the flight.
const PARTS: [&str; 7] = ["nothing", "schedule", "filter", "statistic", "load", "published", "contact"];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let usage = || format!("parts NAME SAMPLES, with NAME one of {PARTS:?}");
    let mut args = std::env::args().skip(1);
    let (part, count) = args.next().zip(args.next()).ok_or_else(usage)?;
    let count: usize = count.parse()?;
    let [motor_m, dx_m, load_n] = channels(count);
    let whole = 0..count;
    let segments = std::slice::from_ref(&whole);
    let samples = Samples { step_s: STEP_S, motor_m: &motor_m, dx_m: &dx_m, load_n: &load_n, segments };
    let prior = PartPrior::of_stiffness(5e7);
    let filter = filter()?;
    match part.as_str() {
        "schedule" => drop(black_box(GainSchedule::new(&filter))),
        "filter" => drop(black_box(GainSchedule::new(&filter).track(&samples, &mut Vec::new())?)),
        "statistic" => drop(black_box(gap::mid_range(&dx_m)).is_ok()),
        "load" => drop(black_box(gap::load_band(&load_n, segments)).is_some()),
        "published" => {
            black_box(midrange::estimate_with(&samples, &GainSchedule::new(&filter), &mut Vec::new())?);
        }
        "contact" => drop(black_box(contact::estimate(&samples, &prior, &mut ContactWorkspace::default())?)),
        _ => {}
    }
    black_box((dx_m, motor_m, load_n));
    Ok(())
}
