//! `estimate`: estimates the given logs without storing the results.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use ingest::LogFiles;
use job::Config;
use job::flight_log::part_of;
use job::trace::{self, Trace};
use pipeline::inspect::estimate::{self, EstimateRow};
use pipeline::inspect::estimate_plots;
use pipeline::logs::discover;
use pipeline::run::time_limit::within_time_limit;
use records::{Diagnostic, Installations, PartNumber};

use crate::args::{EstimateArgs, Global};
use crate::exit::{Code, Failure};
use crate::output::Output;
use crate::row_output;
use crate::table::{self, count, number, or_dash, text, unit_name};

use super::estimate_plot::write_plots;
use crate::commands::context::{VERSION, display_path, load_config, load_with_installations};
use crate::commands::results::query::{flags_text, load};

/// Estimates the given logs.
///
/// # Errors
/// If configuration or tables are wrong. Failed logs make the exit code 1.
pub(crate) fn estimate(args: &EstimateArgs, global: &Global, output: &Output) -> Result<Code, Failure> {
    [&args.trace, &args.plot]
        .into_iter()
        .flatten()
        .try_for_each(|file| row_output::check_file(file, output))?;
    let (config, installations) = match &args.part {
        Some(_) => (load_config(global)?, Installations::default()),
        None => load_with_installations(global)?,
    };
    let part = args.part.as_ref().map(|number| configured(&config, number)).transpose()?;
    let (config, installations) = (Arc::new(config), Arc::new(installations));
    let (mut found, mut diagnostics, mut finished) = (Vec::new(), Vec::new(), Vec::new());
    for path in &discover::flight_paths(&config, &args.logs) {
        match estimate_log(path, &config, &installations, part.as_ref()) {
            Ok(estimated) => {
                let (rows, of_log) = estimated?;
                found.extend(rows);
                diagnostics.extend(of_log);
                finished.push(path.clone());
            }
            // A log that was given up gets no trace and no plot: each would take as long again.
            Err(diagnostic) => diagnostics.push(diagnostic),
        }
    }
    let part = part.as_ref();
    let logs = || -> Result<Vec<(LogFiles, String)>, Failure> {
        let log = |path: &PathBuf| Ok((discover::log_containing(&config, path)?, display_path(path)));
        finished.iter().map(log).collect()
    };
    // The errors of a log were reported by its estimate: without a trace or a plot, it is skipped.
    if let Some(file) = &args.trace {
        let logs = logs()?;
        let trace =
            |(files, log): &(_, String)| trace::of_log(files, log, &config, &installations, part).ok();
        write_trace(file, logs.iter().filter_map(trace), output)?;
    }
    if let Some(file) = &args.plot {
        let logs = logs()?;
        let plots = |(files, log): &(_, String)| {
            estimate_plots::of_log(files, log, &config, &installations, part).ok()
        };
        let plots = logs.iter().filter_map(plots).flatten().map(|(_, plot)| plot);
        write_plots(file, plots, output)?;
    }
    let batch = || row_output::batch(&found);
    row_output::write_rows(&args.rows, output, batch, || page(&found))?;
    output.diagnostics(&diagnostics);
    Ok(if diagnostics.is_empty() { Code::Success } else { Code::LogsInError })
}

type Estimated = Result<(Vec<EstimateRow>, Vec<Diagnostic>), pipeline::Error>;

/// The rows and the diagnostics of one log, or why it was given up.
fn estimate_log(
    path: &Path,
    config: &Arc<Config>,
    installations: &Arc<Installations>,
    part: Option<&PartNumber>,
) -> Result<Estimated, Diagnostic> {
    let (path, part) = (path.to_owned(), part.cloned());
    let (own_config, installations) = (Arc::clone(config), Arc::clone(installations));
    within_time_limit(&display_path(&path.clone()), config, move || {
        let mut diagnostics = Vec::new();
        let rows =
            estimate::estimate(&path, &own_config, &installations, part.as_ref(), VERSION, &mut diagnostics);
        Ok(rows.map(|rows| (rows, diagnostics)))
    })
}

fn configured(config: &Config, number: &str) -> Result<PartNumber, Failure> {
    let name =
        PartNumber::new(number).map_err(|e| Failure::usage("empty_name", e, &configured_parts(config)))?;
    match part_of(config, &name) {
        Ok(_) => Ok(name),
        Err(_) => {
            let what = format!("part number {number} is not configured");
            Err(Failure::usage("part_unknown", what, &configured_parts(config)))
        }
    }
}

fn configured_parts(config: &Config) -> String {
    let parts: Vec<String> = config.parts.keys().map(ToString::to_string).collect();
    format!("configured parts: {}", parts.join(", "))
}

fn page(found: &[EstimateRow]) -> String {
    let unit = |r: &EstimateRow| unit_name(r.part_number.as_deref(), &or_dash(r.serial_number.as_deref()));
    let columns: &table::Columns<'_, EstimateRow> = &[
        (text("log", 3), &|r| or_dash(r.log_path.as_deref())),
        (text("position", 0), &|r| or_dash(r.position.as_deref())),
        (text("part / serial", 2), &unit),
        (number("gap [µm]", 0), &|r| table::micrometres(r.estimate.gap_m)),
        (number("SE [µm]", 3), &|r| table::micrometres(r.estimate.gap_se_m)),
        (number("mid-range [µm]", 4), &|r| table::micrometres(r.estimate.gap_midrange_m)),
        (number("load reversals", 6), &|r| r.estimate.load_reversals.to_string()),
        (number("load [N]", 5), &|r| load(&r.estimate)),
        (number("NIS", 7), &|r| r.estimate.nis.map_or_else(table::empty_cell, |n| format!("{n:.2}"))),
        (text("flags", 1), &|r| flags_text(&r.estimate)),
    ];
    format!("{}; nothing was stored\n", count(found.len(), "estimate")) + &table::of(found, columns)
}

/// Writes per-sample filter output of every actuator of the logs.
fn write_trace(file: &Path, traces: impl Iterator<Item = Trace>, output: &Output) -> Result<(), Failure> {
    if !file.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("parquet")) {
        let what = format!("{}: a trace is written as Parquet", display_path(file));
        return Err(Failure::usage("unknown_ending", what, "use the extension .parquet"));
    }
    let mut all = Trace::default();
    traces.for_each(|trace| all.extend(trace));
    let columns = all.columns();
    ingest::parquet::writer::write_parquet(file, &columns, &[])
        .map_err(|e| Failure::failed(e.diagnostic()))?;
    output.note(&format!("wrote {} samples to {}", all.samples(), display_path(file)));
    Ok(())
}
