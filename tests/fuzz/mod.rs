//! Fuzz targets of configurations, of the tables of maintenance and estimates, and of the estimators.
//!
//! The targets of the Parquet reader, the clock, the store and the trend are with their crates.

use std::path::{Path, PathBuf};

use ingest::log::in_memory::ChannelArrays;
use job::Config;
use pipeline::fleet::bookkeeping::maintenance_log;
use pipeline::fleet::external_estimates;
use records::{PartNumber, Status, TailNumber};

use self::engine::{Input, Random, change_edits, edit_text, fuzz};
use crate::harness::top;

pub(crate) mod engine;

/// Bytes of one change to a channel.
const EDIT: usize = 13;

fn files(paths: &[&str]) -> Vec<Vec<u8>> {
    paths.iter().map(|path| std::fs::read(top().join(path)).unwrap()).collect()
}

/// The first word of an error, with the code of a diagnostic.
fn codes(errors: &[records::Diagnostic]) -> String {
    let mut codes: Vec<&str> = errors.iter().map(|error| error.code.as_str()).collect();
    codes.sort_unstable();
    codes.dedup();
    codes.join(" ")
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
    let others = corpus.clone();
    let folder = tempfile::tempdir().unwrap();
    let tail = TailNumber::new("N412FP").unwrap();
    let change = |random: &mut Random, input: &mut Input| edit_text(random, &mut input.bytes, &others);
    fuzz("configuration", corpus, 300, change, |bytes| {
        let text = String::from_utf8_lossy(bytes);
        match Config::parse(&text, Path::new("pipeline.toml"), folder.path()) {
            Ok(config) => {
                for part in config.parts.keys() {
                    config.mapping(&tail, Some(part));
                    config.digest(&tail, part);
                }
                format!("{} parts, {:?}", config.parts.len().min(3), config.document.layout)
            }
            Err(errors) => {
                assert!(!errors.is_empty());
                errors.iter().for_each(|error| drop(error.to_string()));
                codes(&errors)
            }
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
    let others = corpus.clone();
    let folder = tempfile::tempdir().unwrap();
    let file: PathBuf = folder.path().join("table.csv");
    let change = |random: &mut Random, input: &mut Input| edit_text(random, &mut input.bytes, &others);
    fuzz("maintenance and estimates", corpus, 500, change, |bytes| {
        std::fs::write(&file, bytes).unwrap();
        let words = |text: &str| text.chars().filter(|c| !c.is_ascii_digit()).take(60).collect::<String>();
        let error = |e: pipeline::Error| match e {
            pipeline::Error::Refused(found) => words(&found[0].message),
            other => words(&other.to_string()),
        };
        let read = [
            maintenance_log::read(&file).map(|_| "maintenance".to_owned()),
            external_estimates::read(&file).map(|_| "estimates".to_owned()),
            external_estimates::queries(&file).map(|found| format!("{} queries", found.len().min(3))),
        ];
        read.map(|read| read.unwrap_or_else(error)).join(" | ")
    });
}

/// Channels of an actuator with play that follows a sine, after the changes that the bytes describe.
fn channels(bytes: &[u8]) -> [Vec<f64>; 4] {
    const NUMBERS: [f64; 18] = [
        0.0,
        -0.0,
        f64::NAN,
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::MAX,
        f64::MIN,
        5e-324,
        1e300,
        1e-300,
        1e50,
        -1e50,
        1e9,
        1e-9,
        1.0,
        -1.0,
        1e-4,
        1e4,
    ];
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
        let value = if edit[4] < 160 {
            NUMBERS[usize::from(edit[4]) % NUMBERS.len()]
        } else {
            f64::from_le_bytes(edit[5..].try_into().unwrap())
        };
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

/// Inputs that had an error of NaN, and a search without an end.
const FOUND: [&[u8]; 2] = [
    &[
        237, 17, 148, 76, 16, 114, 250, 161, 190, 9, 177, 35, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 226, 105,
        196, 203, 213, 82, 216, 171, 0, 0, 0, 0, 0, 0, 0, 226, 105, 196, 203, 213, 229, 181, 16, 112, 53, 52,
        12, 112, 226, 105, 196, 203, 213, 82, 99, 123, 181, 28, 63, 190, 93, 196, 251, 229, 136, 135, 67,
        122, 82, 42, 152, 11, 143, 41, 72,
    ],
    &[
        185, 15, 85, 255, 255, 255, 255, 255, 255, 255, 255, 255, 127, 14, 153, 245, 12, 227, 140, 141, 63,
        158, 149, 178, 209, 155, 172, 138, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 153, 255, 1, 4, 167, 226, 232, 95,
        121, 165, 255, 15, 198, 142, 16,
    ],
];

#[test]
fn fuzz_estimators() {
    let text = std::fs::read_to_string(top().join("pipeline.toml")).unwrap();
    let config = Config::parse(&text, Path::new("pipeline.toml"), Path::new("")).unwrap();
    let part = PartNumber::new("EMA-27-1040").unwrap();
    let mut random = Random::new(5);
    let mut corpus = vec![vec![0], vec![255]];
    corpus.extend(
        (0..30).map(|edits| (0..=(edits % 6) * EDIT).map(|_| random.next() as u8).collect::<Vec<u8>>()),
    );
    corpus.extend(FOUND.map(<[u8]>::to_vec));
    let change = |random: &mut Random, input: &mut Input| change_edits(random, input, EDIT, 20);
    fuzz("estimator inputs", corpus, 150, change, |bytes| {
        let [time_s, motor_m, screw_m, load_n] = channels(bytes);
        let arrays = ChannelArrays { time_s: &time_s, motor_m: &motor_m, screw_m: &screw_m, load_n: &load_n };
        match pipeline::inspect::estimate::of_arrays(&arrays, &config, &part, "fuzz") {
            Ok(row) => {
                let found = row.estimate;
                if found.status == Status::Estimated {
                    assert!(found.gap_m.is_some_and(f64::is_finite), "gap {:?}", found.gap_m);
                    assert!(
                        found.gap_se_m.is_none_or(|se_m| se_m.is_finite() && se_m >= 0.0),
                        "{:?}",
                        found.gap_se_m
                    );
                    assert!(found.stiffness_n_per_m.is_none_or(|k| k > 0.0), "{:?}", found.stiffness_n_per_m);
                    let errors = [
                        found.stiffness_se_n_per_m,
                        found.skew_se_s,
                        found.load_delay_se_s,
                        found.load_zero_se_n,
                    ];
                    assert!(errors.into_iter().flatten().all(|se| se >= 0.0), "{errors:?}");
                }
                format!("{:?} {:?} {:?}", found.status, found.reason, found.flags)
            }
            Err(e) => e.code,
        }
    });
}
