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
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;

use crate::methods::{load_lines_m, spread_m};

/// The results of every method for one log, degrees.
#[derive(Debug, Clone, Copy)]
pub struct GearBenchLog {
    /// Play of this phase as its authors measured it, over three places of the output.
    pub authors_deg: f64,
    /// Contact regression over the ramps to 4 N·m, and over all, those to 40 N·m included; NaN where it refuses.
    pub contact_deg: [f64; 2],
    /// Loop width at zero load, over the same; NaN where there is none.
    pub loop_deg: [f64; 2],
    /// The paper's statistic over the ramps to 4 N·m, and over all, those to 40 N·m included.
    pub midrange_deg: [f64; 2],
    /// Load lines, over the same.
    pub lines_deg: [f64; 2],
    /// P99 − P1 of δX, over the same.
    pub spread_deg: [f64; 2],
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
///
/// # Errors
/// A file that cannot be read or lacks a column, as text.
pub fn gear_bench_logs(folder: &Path) -> Result<Vec<GearBenchLog>, String> {
    let manifest = folder.join("manifest.csv");
    let text = std::fs::read_to_string(&manifest).map_err(|e| format!("{}: {e}", manifest.display()))?;
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
    let column = |name: &str| {
        header.iter().position(|h| *h == name).ok_or_else(|| format!("manifest.csv has no column `{name}`"))
    };
    let (file, play) = (column("file")?, column("authors_phase_play_deg")?);
    let listed = lines.map(|line| {
        let cell =
            |k: usize| line.split(',').nth(k).ok_or_else(|| format!("manifest.csv: short line {line}"));
        // Some phases have no published play.
        if cell(play)?.is_empty() {
            return Ok(None);
        }
        let play_deg = cell(play)?.parse().map_err(|e| format!("manifest.csv: {line}: {e}"))?;
        gear(folder, cell(file)?, play_deg).map(Some)
    });
    listed.filter_map(Result::transpose).collect()
}

fn gear(folder: &Path, file: &str, authors_deg: f64) -> Result<GearBenchLog, String> {
    let columns = columns(&folder.join(file)).map_err(|e| format!("{file}: {e}"))?;
    let of = |name: &str| columns.get(name).ok_or_else(|| format!("{file}: no column `{name}`"));
    let (time_s, motor_deg, torque_nm, ramp) =
        (of("time_s")?, of("x_motor_deg")?, of("torque_motor_nm")?, of("test_nr")?);
    let small = ramp.iter().take_while(|n| **n <= LAST_SMALL_RAMP).count();
    let step_s = (time_s[time_s.len() - 1] - time_s[0]) / (time_s.len() - 1) as f64;
    // Radians and newton metres stand for metres and newtons: the filter asks only that they fit each other.
    let motor_rad: Vec<f64> = motor_deg.iter().map(|x| x.to_radians()).collect();
    let dx_rad: Vec<f64> = motor_rad.iter().map(|x| -x).collect();
    let load_nm: Vec<f64> = torque_nm.iter().map(|t| -t).collect();
    let parts = [small, dx_rad.len()];
    let published = |end: usize| {
        let segment = 0..end;
        let samples = samples(step_s, [&motor_rad, &dx_rad, &load_nm], &segment);
        let filter = filter(step_s).map_err(|e| format!("{file}: {e}"))?;
        Ok::<f64, String>(
            midrange::estimate(&samples, &filter).map_or(f64::NAN, |m| m.gap.gap_m.to_degrees()),
        )
    };
    let motor_m: Vec<f64> = motor_rad.iter().map(|x| x * RADIUS_M).collect();
    let dx_m: Vec<f64> = dx_rad.iter().map(|x| x * RADIUS_M).collect();
    let load_n: Vec<f64> = load_nm.iter().map(|t| t / RADIUS_M).collect();
    let prior = PartPrior {
        reference_load_n: Some(REFERENCE_LOAD_N),
        output_locked: true,
        ..PartPrior::of_stiffness(STIFFNESS_NM_PER_RAD / (RADIUS_M * RADIUS_M))
    };
    let regression = |end: usize| {
        let segment = 0..end;
        let samples = samples(step_s, [&motor_m, &dx_m, &load_n], &segment);
        let outcome = contact::estimate(&samples, &prior, &mut ContactWorkspace::default())
            .map_err(|e| format!("{file}: {e}"))?;
        let degrees = |length_m: Option<f64>| length_m.map_or(f64::NAN, |m| (m / RADIUS_M).to_degrees());
        let found = outcome.ok();
        let lengths_m = [
            found.as_ref().map(|found| found.gap_m),
            found.and_then(|found| found.loop_width_m).map(|width| width.0),
        ];
        Ok::<[f64; 2], String>(lengths_m.map(degrees))
    };
    let [[small_gap, small_loop], [whole_gap, whole_loop]] = [regression(parts[0])?, regression(parts[1])?];
    Ok(GearBenchLog {
        authors_deg,
        contact_deg: [small_gap, whole_gap],
        loop_deg: [small_loop, whole_loop],
        midrange_deg: [published(parts[0])?, published(parts[1])?],
        lines_deg: parts.map(|end| load_lines_m(&dx_rad[..end], &load_nm[..end]).to_degrees()),
        spread_deg: parts.map(|end| spread_m(&dx_rad[..end]).to_degrees()),
    })
}

/// The beginning of a log as the estimators take it: motor, relative position and load.
fn samples<'a>(
    step_s: f64,
    [motor, dx, load]: [&'a [f64]; 3],
    segment: &'a std::ops::Range<usize>,
) -> Samples<'a> {
    let end = segment.end;
    Samples {
        step_s,
        motor_m: &motor[..end],
        dx_m: &dx[..end],
        load_n: &load[..end],
        segments: std::slice::from_ref(segment),
    }
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

/// Every column of a file as numbers.
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
