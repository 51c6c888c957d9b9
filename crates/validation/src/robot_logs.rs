//! Logs of a real machine: a robot whose play is near zero and whose channels are 3 ms apart.

use std::collections::BTreeSet;
use std::path::Path;

use ingest::{ActuatorChannels, LogFiles};
use job::flight_log::read_as_part;
use job::{Config, Part, estimate};
use records::{Diagnostic, PartNumber};

use crate::methods::{load_lines_m, spread_m};

/// The cells of a log: its name; in degrees gap, standard error; skew, ms; in degrees the paper's statistic, load lines and
/// P99 − P1 of δX; refusal or flags. A dash where there is none.
pub(crate) type RobotRow = [String; 8];

/// Estimates the robot's axes with the configuration in the same folder.
pub(crate) fn robot(folder: &Path) -> Result<Vec<RobotRow>, String> {
    let texts = |all: Vec<Diagnostic>| all.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n");
    let config = Config::read_layers(&[folder.join("pipeline.toml")]).map_err(texts)?;
    let mut rows = Vec::new();
    for axis in ["KR300-AX1", "KR300-AX2", "KR300-AX3"] {
        let name = format!("{axis}_trajC");
        let number = PartNumber::new(axis).map_err(|e| format!("{axis}: {e}"))?;
        let log = folder.join(format!("{name}.parquet"));
        read_as_part(&LogFiles::one(&log), &name, &config, &number, |channels, part| {
            rows.push(row(&name, &channels, part, &config)?);
            Ok(())
        })
        .map_err(|diagnostic| diagnostic.to_string())?;
    }
    Ok(rows)
}

fn row(log: &str, channels: &ActuatorChannels, part: &Part, config: &Config) -> Result<RobotRow, Diagnostic> {
    let e = estimate::estimate(channels, part, &config.document.estimate)?;
    let (_, midrange) = estimate::filter_output(channels, part)?;
    let cell = |value: f64, digits: usize| {
        if value.is_nan() { "–".to_owned() } else { format!("{value:.digits$}") }
    };
    let radius_m = e.reference_radius_m.unwrap_or(f64::NAN);
    let degrees = |m: Option<f64>| cell((m.unwrap_or(f64::NAN) / radius_m).to_degrees(), 4);
    let remarks: BTreeSet<&str> = e.reason.iter().chain(&e.flags).map(String::as_str).collect();
    let remarks = remarks.into_iter().collect::<Vec<_>>().join(", ");
    Ok([
        log.to_owned(),
        degrees(e.gap_m),
        degrees(e.gap_se_m),
        cell(e.skew_s.map_or(f64::NAN, |s| s * 1e3), 2),
        degrees(e.gap_midrange_m.or(midrange.map(|gap| gap.gap_m))),
        degrees(Some(load_lines_m(&channels.dx_m, &channels.load_n))),
        degrees(Some(spread_m(&channels.dx_m))),
        if remarks.is_empty() { "–".to_owned() } else { remarks },
    ])
}
