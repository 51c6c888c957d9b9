//! Gear actuators with their output locked to the bench, whose play their authors measured: real play, real
//! friction, hardening flanks. The logs are licensed CC BY-SA and are no part of the project; the
//! study uses them when `--gears` names their folder.
//!
//! The output has no sensor: it is declared as locked, as `output = "locked"` does for a part.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::Path;

use arrow::array::{AsArray, RecordBatch};
use arrow::compute::cast;
use arrow::datatypes::{DataType, Float64Type};
use estimator::contact::{self, ContactWorkspace, PartPrior};
use estimator::{ActuatorModel, Filter, NoiseModel, Samples, SensorNoise, midrange};
use ingest::tables::{TableBatch, number};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;

use crate::methods::{METHODS, load_lines_m, spread_m};

/// The methods whose results are compared.
pub(crate) const GEAR_METHODS: [&str; 5] = [METHODS[0], "its loop width", METHODS[1], METHODS[2], METHODS[3]];

/// The results of every method for one log, degrees.
#[derive(Debug, Clone, Copy)]
pub(crate) struct GearBenchLog {
    /// Play of this phase as its authors measured it, over three places of the output.
    pub(crate) authors_deg: f64,
    /// Over the ramps to 4 N·m, and over all, those to 40 N·m included: by method of [`GEAR_METHODS`]; NaN where it gives
    /// no number.
    pub(crate) found_deg: [[f64; GEAR_METHODS.len()]; 2],
}

/// Stiffness as its authors give it, 0.084 °/(N·m), N·m/rad.
const STIFFNESS_NM_PER_RAD: f64 = 680.0;
/// Radius at which angles are stated as lengths and torques as forces, m: about that of the pins.
const RADIUS_M: f64 = 0.05;
/// Load between whose positive and negative value lost motion is stated, N.
const REFERENCE_LOAD_N: f64 = 20.0;
/// Ramps up to this number go to 4 N·m.
const LAST_SMALL_RAMP: f64 = 4.0;

/// Reads every log of a folder that its `manifest.csv` lists with a published play.
pub(crate) fn gear_bench_logs(folder: &Path) -> Result<Vec<GearBenchLog>, String> {
    let text = |error: ingest::Error| error.diagnostic().to_string();
    let manifest = TableBatch::read(&folder.join("manifest.csv")).map_err(text)?;
    let column = |name: &str| manifest.column(&[name]).map_err(text);
    let (file, play) = (column("file")?, column("authors_phase_play_deg")?);
    let log = |row: usize| {
        // Some phases have no published play.
        let Some(play_deg) = manifest.optional(row, Some(play), number).map_err(text)? else {
            return Ok(None);
        };
        let file = manifest.required(row, file, |name| Ok(name.to_owned())).map_err(text)?;
        gear(folder, &file, play_deg).map(Some)
    };
    manifest.rows().filter_map(|row| log(row).transpose()).collect()
}

fn gear(folder: &Path, file: &str, authors_deg: f64) -> Result<GearBenchLog, String> {
    let columns = columns(&folder.join(file)).map_err(|e| format!("{file}: {e}"))?;
    let of = |name: &str| columns.get(name).ok_or_else(|| format!("{file}: no column `{name}`"));
    let (time_s, motor_deg, torque_nm, ramp) =
        (of("time_s")?, of("x_motor_deg")?, of("torque_motor_nm")?, of("test_nr")?);
    let step_s = (time_s[time_s.len() - 1] - time_s[0]) / (time_s.len() - 1) as f64;
    // Motor, relative position and load at a radius. At 1 m, radians and newton metres stand for metres and newtons: the
    // filter asks only that they fit each other.
    let at = |radius_m: f64| {
        let motor_m: Vec<f64> = motor_deg.iter().map(|x| x.to_radians() * radius_m).collect();
        let dx_m: Vec<f64> = motor_m.iter().map(|x| -x).collect();
        let load_n: Vec<f64> = torque_nm.iter().map(|t| -t / radius_m).collect();
        [motor_m, dx_m, load_n]
    };
    let (angles, lengths) = (at(1.0), at(RADIUS_M));
    let small = ramp.iter().take_while(|n| **n <= LAST_SMALL_RAMP).count();
    let found = |end: usize| methods(step_s, end, &angles, &lengths).map_err(|e| format!("{file}: {e}"));
    Ok(GearBenchLog { authors_deg, found_deg: [found(small)?, found(time_s.len())?] })
}

/// Every method of [`GEAR_METHODS`] over the beginning of a log, degrees: motor, relative position and load at 1 m, and at
/// [`RADIUS_M`].
fn methods(
    step_s: f64,
    end: usize,
    angles: &[Vec<f64>; 3],
    lengths: &[Vec<f64>; 3],
) -> Result<[f64; GEAR_METHODS.len()], estimator::Error> {
    let whole = 0..end;
    let segments = std::slice::from_ref(&whole);
    let prior = PartPrior {
        reference_load_n: Some(REFERENCE_LOAD_N),
        output_locked: true,
        ..PartPrior::of_stiffness(STIFFNESS_NM_PER_RAD / (RADIUS_M * RADIUS_M))
    };
    let [motor_m, dx_m, load_n] = lengths.each_ref().map(|values| &values[..end]);
    let samples = Samples { step_s, motor_m, dx_m, load_n, segments };
    let found = contact::estimate(&samples, &prior, &mut ContactWorkspace::default())?.ok();
    let gap_m = found.as_ref().map(|found| found.gap_m);
    let loop_m = found.and_then(|found| found.loop_width_m).map(|width| width.0);
    let [gap, loop_width] =
        [gap_m, loop_m].map(|length_m| length_m.map_or(f64::NAN, |m| (m / RADIUS_M).to_degrees()));
    let [motor_m, dx_m, load_n] = angles.each_ref().map(|values| &values[..end]);
    let samples = Samples { step_s, motor_m, dx_m, load_n, segments };
    let midrange = midrange::estimate(&samples, &filter(step_s)?).map_or(f64::NAN, |m| m.gap.gap_m);
    let of_angles = [midrange, load_lines_m(dx_m, load_n), spread_m(dx_m)].map(f64::to_degrees);
    Ok([gap, loop_width, of_angles[0], of_angles[1], of_angles[2]])
}

fn filter(step_s: f64) -> Result<Filter, estimator::Error> {
    let noise = SensorNoise {
        screw_rms_m: 1e-4,
        motor_rms_m: 1e-4,
        unknown_force_n: 2.0,
        bandwidth_hz: 10.0,
        ..SensorNoise::default()
    };
    Filter::new(&ActuatorModel::linear(STIFFNESS_NM_PER_RAD, 5.0, 0.01)?, step_s, &NoiseModel::Sensors(noise))
}

fn columns(path: &Path) -> Result<BTreeMap<String, Vec<f64>>, Box<dyn std::error::Error>> {
    let batches = ParquetRecordBatchReaderBuilder::try_new(File::open(path)?)?
        .build()?
        .collect::<Result<Vec<RecordBatch>, _>>()?;
    let mut columns = BTreeMap::<String, Vec<f64>>::new();
    for batch in &batches {
        for (field, values) in batch.schema().fields().iter().zip(batch.columns()) {
            let numbers = cast(values, &DataType::Float64)?;
            columns
                .entry(field.name().clone())
                .or_default()
                .extend(numbers.as_primitive::<Float64Type>().iter().map(|v| v.unwrap_or(f64::NAN)));
        }
    }
    Ok(columns)
}
