//! Logs of a real machine: a robot whose play is near zero and whose channels are 3 ms apart.

use std::path::{Path, PathBuf};

use ingest::LogFiles;
use job::Config;
use job::estimate_plot_data::EstimatePlot;
use records::{Installations, PartNumber};

use crate::methods::{load_lines_m, spread_m};

/// The results of every method for a log; degrees unless the name has another unit, NaN where refused.
#[derive(Debug, Clone)]
pub struct RobotRow {
    /// Name of the log.
    pub log: String,
    /// Contact regression.
    pub gap_deg: f64,
    /// Its standard error.
    pub se_deg: f64,
    /// The paper's statistic.
    pub midrange_deg: f64,
    /// Load lines.
    pub lines_deg: f64,
    /// P99 − P1 of δX.
    pub spread_deg: f64,
    /// Skew of the screw channel, ms.
    pub skew_ms: f64,
    /// Refusal or flags.
    pub remarks: String,
}

/// Estimates the robot's axes with the configuration in the same folder.
///
/// # Errors
/// A configuration or a log that cannot be read, as text.
pub fn robot(folder: &Path) -> Result<Vec<RobotRow>, String> {
    let config = Config::read(&folder.join("pipeline.toml")).map_err(|all| join_diagnostics(&all))?;
    let mut rows = Vec::new();
    for axis in ["AX1", "AX2", "AX3"] {
        let log = folder.join(format!("KR300-{axis}_trajC.parquet"));
        rows.extend(estimate_log(&log, &config, &format!("KR300-{axis}"))?);
    }
    Ok(rows)
}

fn join_diagnostics(diagnostics: &[records::Diagnostic]) -> String {
    diagnostics.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
}

fn estimate_log(path: &PathBuf, config: &Config, part: &str) -> Result<Vec<RobotRow>, String> {
    let name = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    let number = PartNumber::new(part).map_err(|e| format!("{part}: {e}"))?;
    let none = Installations::default();
    let looks = job::estimate_plot_data::of_log(&LogFiles::one(path), &name, config, &none, Some(&number))
        .map_err(|diagnostic| diagnostic.to_string())?;
    Ok(looks.iter().map(|look| row(&name, look)).collect())
}

fn row(log: &str, look: &EstimatePlot) -> RobotRow {
    let e = &look.estimate;
    let radius_m = e.reference_radius_m.unwrap_or(f64::NAN);
    let degrees = |m: f64| (m / radius_m).to_degrees();
    let or_nan = |m: Option<f64>| m.map_or(f64::NAN, degrees);
    RobotRow {
        log: log.to_owned(),
        gap_deg: or_nan(e.gap_m),
        se_deg: or_nan(e.gap_se_m),
        midrange_deg: or_nan(e.gap_midrange_m.or(look.midrange.map(|gap| gap.gap_m))),
        lines_deg: degrees(load_lines_m(&look.dx_m, &look.load_n)),
        spread_deg: degrees(spread_m(&look.dx_m)),
        skew_ms: e.skew_s.map_or(f64::NAN, |s| s * 1e3),
        remarks: e
            .reason
            .iter()
            .chain(&e.flags)
            .cloned()
            .collect::<std::collections::BTreeSet<_>>()
            .into_iter()
            .collect::<Vec<_>>()
            .join(", "),
    }
}
