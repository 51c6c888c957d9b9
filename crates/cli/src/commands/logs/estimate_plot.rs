//! `estimate --plot`: diagnostic plot of an estimate as SVG or HTML.

use std::path::{Path, PathBuf};

use job::Config;
use job::estimate_plot_data::EstimatePlot;
use records::{Installations, PartNumber};
use report::{ContactInterval, estimate_plot_html, estimate_plot_svg};

use crate::exit::Failure;
use crate::output::Output;
use crate::table;

use crate::commands::context::display_path;

/// Draws every actuator of the logs into one file; the extension selects the format.
///
/// # Errors
/// If the extension is unknown or the file cannot be written.
pub(super) fn estimate_plot(
    file: &Path,
    logs: &[PathBuf],
    config: &Config,
    installations: &Installations,
    part: Option<&PartNumber>,
    output: &Output,
) -> Result<(), Failure> {
    let draw = renderer(file)?;
    let mut plots = Vec::new();
    for path in logs {
        let name = display_path(path);
        // A failed log is reported already; it is not drawn.
        let files = pipeline::run::discover::log_containing(config, path)?;
        let found =
            job::estimate_plot_data::of_log(&files, &name, config, installations, part).unwrap_or_default();
        plots.extend(found.into_iter().map(|data| to_plot(&name, data)));
    }
    if plots.is_empty() {
        output.note(&format!("no actuator to draw; {} was not written", display_path(file)));
        return Ok(());
    }
    let failed = |what: &dyn std::fmt::Display| {
        Failure::failed(records::Diagnostic::new("cannot_write", format!("{}: {what}", display_path(file))))
    };
    let picture = draw(&plots).map_err(|e| failed(&e))?;
    std::fs::write(file, picture).map_err(|e| failed(&e))?;
    output.note(&format!("drew {} to {}", table::count(plots.len(), "actuator"), display_path(file)));
    Ok(())
}

type Renderer = fn(&[report::EstimatePlot]) -> Result<Vec<u8>, report::Error>;

fn renderer(file: &Path) -> Result<Renderer, Failure> {
    let ending = file.extension().and_then(|e| e.to_str()).unwrap_or_default().to_lowercase();
    match ending.as_str() {
        "svg" => Ok(|plots| estimate_plot_svg(plots).map(String::into_bytes)),
        "html" | "htm" => Ok(|plots| estimate_plot_html(plots).map(String::into_bytes)),
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

fn to_plot(log: &str, data: EstimatePlot) -> report::EstimatePlot {
    let (upper, lower, touches) = match data.picture {
        Some(picture) => (picture.upper, picture.lower, picture.touches),
        None => Default::default(),
    };
    let mut plot = report::EstimatePlot {
        title: format!("{} in {log}", data.position),
        summary: words(&data.estimate),
        step_s: data.step_s,
        breaks: data.breaks,
        contacts: Vec::new(),
        bounds_m: data.midrange.map(|gap| (gap.upper_m, gap.lower_m)),
        flanks: [upper, lower],
        dx_m: data.dx_m,
        load_n: data.load_n,
        s_m: data.s_m,
    };
    let intervals = touches.into_iter().map(|touch| ContactInterval {
        time_s: plot.time_s(touch.time_s / plot.step_s),
        is_upper: touch.flank.sign() > 0.0,
        is_used: touch.trust.is_some_and(|trust| trust > 0.0),
        force_n: touch.force_n,
        dx_m: touch.dx_m,
    });
    plot.contacts = intervals.collect();
    plot
}

fn words(e: &records::GapEstimate) -> String {
    let mut words = Vec::new();
    let mut say = |name: &str, value: Option<f64>, unit: &str| {
        words.extend(value.map(|v| format!("{name} {v:.1} {unit}")));
    };
    say("gap", e.gap_m.map(|m| m * 1e6), "µm");
    say("standard error", e.gap_se_m.map(|m| m * 1e6), "µm");
    say("mid-range", e.gap_midrange_m.map(|m| m * 1e6), "µm");
    say("stiffness", e.stiffness_n_per_m.map(|k| k / 1e6), "N/µm");
    say("skew", e.skew_s.map(|s| s * 1e3), "ms");
    say("lost motion", e.lost_motion_m.map(|m| m * 1e6), "µm");
    words.extend(e.reason.as_ref().filter(|_| e.gap_m.is_none()).map(|why| format!("refused: {why}")));
    words.extend((!e.flags.is_empty()).then(|| e.flags.join(", ")));
    words.join(" · ")
}
