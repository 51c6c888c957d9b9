//! Fuzz targets of configurations, of the tables of maintenance and estimates, and of the estimators.
//!
//! The targets of the Parquet reader, the clock, the store and the trend are with their crates.

use std::path::{Path, PathBuf};

use ingest::log::in_memory::ChannelArrays;
use ingest::tables::TableBatch;
use job::Config;
use pipeline::fleet::bookkeeping::maintenance_log;
use pipeline::fleet::external_estimates;
use records::{Installations, PartNumber, Status, TailNumber};

use self::edits::{Choices, edit_text, number};
use crate::harness::top;

mod edits;

const EDIT: usize = 13;

fn files(paths: &[&str]) -> Vec<Vec<u8>> {
    paths.iter().map(|path| std::fs::read(top().join(path)).unwrap()).collect()
}

#[test]
fn fuzz_configuration() {
    let mut corpus =
        files(&["pipeline.toml", "tests/data/kr300/pipeline.toml", "tests/data/flights/pipeline.toml"]);
    for page in ["docs/configuration.md", "docs/map-my-logs.md"] {
        let text = std::fs::read_to_string(top().join(page)).unwrap();
        let blocks = text.split("```toml\n").skip(1).filter_map(|block| block.split("```").next());
        // An example of single tables is put before a whole configuration.
        corpus.extend(blocks.map(|block| [block.as_bytes(), b"\n", &corpus[0]].concat()).collect::<Vec<_>>());
    }
    let folder = tempfile::tempdir().unwrap();
    let tail = TailNumber::new("N412FP").unwrap();
    bolero::check!().with_iterations(100).with_max_len(64).for_each(|input| {
        let choices = &mut Choices(input);
        let mut bytes = choices.pick(&corpus).clone();
        edit_text(choices, &mut bytes, &corpus);
        match Config::parse(&String::from_utf8_lossy(&bytes), Path::new("pipeline.toml"), folder.path()) {
            Ok(config) => {
                for part in config.parts.keys() {
                    config.mapping(&tail, Some(part));
                    config.digest(&tail, part);
                }
            }
            Err(errors) => assert!(errors.iter().map(ToString::to_string).count() > 0),
        }
    });
}

#[test]
fn fuzz_maintenance_and_estimates() {
    let maintenance = "serial_number,part_number,date_utc,kind,play_m,force_n,instrument,note\n\
                       1040-0005,EMA-27-1040,2026-09-07,replaced,1e-4,100,dial,x\n,,,,,,,\n";
    let estimates = "tail_number,position,part_number,serial_number,flight_id,departure_utc,gap_m,gap_se_m,status,flight_hours,tail_hours_end,load_reversals\n\
                     N1,aileron,EMA,1,F1,2026-01-01T06:00:00Z,1e-5,1e-6,estimated,1.5,100,20\n\
                     N1,aileron,EMA,1,F2,2026-01-02T06:00:00Z,,,refused,1.5,101.5,20\n";
    let queries = "serial_number,as_of_utc\n1,2026-01-01\n";
    let corpus = [maintenance, estimates, queries].map(|text| text.as_bytes().to_vec()).to_vec();
    let folder = tempfile::tempdir().unwrap();
    let file: PathBuf = folder.path().join("table.csv");
    let mut config = Config::default();
    config.document.logs.maintenance = Some(file.display().to_string());
    bolero::check!().with_iterations(300).with_max_len(64).for_each(|input| {
        let choices = &mut Choices(input);
        let mut bytes = choices.pick(&corpus).clone();
        edit_text(choices, &mut bytes, &corpus);
        std::fs::write(&file, bytes).unwrap();
        let _ = maintenance_log::read(&config, &Installations::default()).map_err(|e| e.to_string());
        let _ =
            external_estimates::read(&file, &std::collections::BTreeSet::new()).map_err(|e| e.to_string());
        let _ = TableBatch::read(&file)
            .map(|table| external_estimates::queries(&table).map_err(|e| e.to_string()));
    });
}

/// Channels of an actuator with play that follows a sine, after the changes that the bytes describe.
fn channels(bytes: &[u8]) -> [Vec<f64>; 4] {
    let rows = 500 + 20 * usize::from(bytes.first().copied().unwrap_or_default());
    let time: Vec<f64> = (0..rows).map(|row| row as f64 * 0.004).collect();
    let motor: Vec<f64> = time.iter().map(|t| 0.02 * (3.0 * t).sin()).collect();
    let load: Vec<f64> = time.iter().map(|t| 6e3 * (2.0 * t).cos()).collect();
    let screw: Vec<f64> = motor
        .iter()
        .zip(&load)
        .map(|(x, f)| x + 4e-5 * f.signum() + f / 5e7 + 1e-6 * (1e4 * f).sin())
        .collect();
    let mut all = [time, motor, screw, load];
    for edit in bytes.get(1..).unwrap_or_default().chunks_exact(EDIT) {
        let value = number(edit[4], edit[5..].try_into().unwrap());
        let channel = &mut all[usize::from(edit[0]) % 4];
        let first = rows * usize::from(edit[2]) / 256;
        // A range, one sample, or samples at a regular distance.
        let step = if edit[1] >= 128 { 1 + usize::from(edit[3]) % 37 } else { 1 };
        let last = if edit[1] % 8 == 0 { first + 1 } else { first + rows * (1 + usize::from(edit[3])) / 256 };
        for sample in channel[first..last.min(rows)].iter_mut().step_by(step) {
            match edit[1] % 5 {
                0 | 1 => *sample = value,
                2 => *sample += value,
                3 => *sample *= value,
                _ => *sample = f64::NAN,
            }
        }
    }
    all
}

#[test]
fn fuzz_estimators() {
    let text = std::fs::read_to_string(top().join("pipeline.toml")).unwrap();
    let config = Config::parse(&text, Path::new("pipeline.toml"), Path::new("")).unwrap();
    let part = PartNumber::new("EMA-27-1040").unwrap();
    bolero::check!().with_iterations(40).with_max_len(1 + 20 * EDIT).for_each(|bytes| {
        let [time_s, motor_m, screw_m, load_n] = channels(bytes);
        let arrays = ChannelArrays { time_s: &time_s, motor_m: &motor_m, screw_m: &screw_m, load_n: &load_n };
        let Ok(row) = pipeline::inspect::estimate::of_arrays(&arrays, &config, &part, "fuzz") else { return };
        let found = row.estimate;
        if found.status == Status::Estimated {
            assert!(found.gap_m.is_some_and(f64::is_finite), "gap {:?}", found.gap_m);
            assert!(found.stiffness_n_per_m.is_none_or(|k| k > 0.0), "{:?}", found.stiffness_n_per_m);
            let errors = [
                found.gap_se_m,
                found.stiffness_se_n_per_m,
                found.skew_se_s,
                found.load_delay_se_s,
                found.load_zero_se_n,
            ];
            assert!(errors.into_iter().flatten().all(|se| se >= 0.0), "{errors:?}");
            assert!(found.gap_se_m.is_none_or(f64::is_finite), "{errors:?}");
        }
    });
}
