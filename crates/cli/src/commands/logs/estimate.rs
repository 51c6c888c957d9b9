//! `estimate`: estimates the given logs without storing the results.

use std::path::Path;
use std::sync::Arc;

use job::Config;
use job::trace::Trace;
use pipeline::inspect::estimate::{self, EstimateRequest, EstimateRow};
use pipeline::logs::discover;
use records::{Diagnostic, Installations, PartNumber};
use report::{EstimatePlot, estimate_plot_html, estimate_plot_svg};

use crate::args::{EstimateArgs, Global};
use crate::commands::context::{VERSION, display_path, load_config, load_with_installations};
use crate::commands::results::query::{flags_text, load};
use crate::table::{self, count, number, or_dash, text, unit_name};
use crate::{Code, Failure, Output, row_output};

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
    let request = EstimateRequest {
        part: args.part.as_ref().map(|number| configured(&config, number)).transpose()?,
        config: Arc::new(config),
        installations: Arc::new(installations),
        program_version: VERSION,
        has_trace: args.trace.is_some(),
        has_plots: args.plot.is_some(),
    };
    let (mut found, mut plots, mut diagnostics) = (Vec::new(), Vec::new(), Vec::new());
    let mut trace = Trace::default();
    for path in &discover::flight_paths(&request.config, &args.logs) {
        let of_log = estimate::estimate(path, &request)?;
        found.extend(of_log.rows);
        trace.extend(of_log.trace);
        plots.extend(of_log.plots);
        diagnostics.extend(of_log.diagnostics);
    }
    if let Some(file) = &args.trace {
        write_trace(file, &trace, output)?;
    }
    if let Some(file) = &args.plot {
        write_plots(file, &plots, output)?;
    }
    let batch = || row_output::batch(&found);
    row_output::write_rows(&args.rows, output, batch, || page(&found))?;
    output.diagnostics(&diagnostics);
    Ok(if diagnostics.is_empty() { Code::Success } else { Code::LogsInError })
}

fn configured(config: &Config, number: &str) -> Result<PartNumber, Failure> {
    let parts: Vec<String> = config.parts.keys().map(ToString::to_string).collect();
    let hint = format!("configured parts: {}", parts.join(", "));
    let name = PartNumber::new(number).map_err(|e| Failure::usage("empty_name", e, &hint))?;
    let unknown = || format!("part number {number} is not configured");
    if config.parts.contains_key(&name) {
        Ok(name)
    } else {
        Err(Failure::usage("part_unknown", unknown(), &hint))
    }
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

fn write_trace(file: &Path, trace: &Trace, output: &Output) -> Result<(), Failure> {
    if !file.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("parquet")) {
        let what = format!("{}: a trace is written as Parquet", display_path(file));
        return Err(Failure::usage("unknown_ending", what, "use the extension .parquet"));
    }
    ingest::parquet::writer::write_parquet(file, &trace.columns(), &[])
        .map_err(|e| Failure::failed(e.diagnostic()))?;
    output.note(&format!("wrote {} samples to {}", trace.samples(), display_path(file)));
    Ok(())
}

/// Draws the plots of all actuators into one file; the extension selects the format.
fn write_plots(file: &Path, plots: &[EstimatePlot], output: &Output) -> Result<(), Failure> {
    let draw = renderer(file)?;
    if plots.is_empty() {
        output.note(&format!("no actuator to draw; {} was not written", display_path(file)));
        return Ok(());
    }
    let failed = |what: &dyn std::fmt::Display| {
        Failure::failed(Diagnostic::new("cannot_write", format!("{}: {what}", display_path(file))))
    };
    let picture = draw(plots).map_err(|e| failed(&e))?;
    std::fs::write(file, picture).map_err(|e| failed(&e))?;
    output.note(&format!("drew {} to {}", count(plots.len(), "actuator"), display_path(file)));
    Ok(())
}

type Renderer = fn(&[EstimatePlot]) -> Result<Vec<u8>, report::Error>;

fn renderer(file: &Path) -> Result<Renderer, Failure> {
    let ending = file.extension().and_then(|e| e.to_str()).unwrap_or_default().to_lowercase();
    match ending.as_str() {
        "svg" => Ok(|plots| Ok(estimate_plot_svg(plots).into_bytes())),
        "html" | "htm" => Ok(|plots| estimate_plot_html(plots, None).map(String::into_bytes)),
        "png" => Err(Failure::usage(
            "unknown_ending",
            format!("{}: plots are not written as PNG", display_path(file)),
            "write .svg and convert it, for example with `rsvg-convert plot.svg -o plot.png`",
        )),
        _ => Err(Failure::usage(
            "unknown_ending",
            format!("{} has no known extension", display_path(file)),
            "use the extension .svg or .html",
        )),
    }
}
