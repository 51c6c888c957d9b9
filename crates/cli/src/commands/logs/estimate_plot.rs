//! `estimate --plot`: diagnostic plot of an estimate as SVG or HTML.

use std::path::Path;

use report::{EstimatePlot, estimate_plot_html, estimate_plot_svg};

use crate::exit::Failure;
use crate::output::Output;
use crate::table;

use crate::commands::context::display_path;

/// Draws the plots of all actuators into one file; the extension selects the format.
///
/// # Errors
/// If the extension is unknown or the file cannot be written.
pub(super) fn write_plots(file: &Path, plots: &[EstimatePlot], output: &Output) -> Result<(), Failure> {
    let draw = renderer(file)?;
    if plots.is_empty() {
        output.note(&format!("no actuator to draw; {} was not written", display_path(file)));
        return Ok(());
    }
    let failed = |what: &dyn std::fmt::Display| {
        Failure::failed(records::Diagnostic::new("cannot_write", format!("{}: {what}", display_path(file))))
    };
    let picture = draw(plots).map_err(|e| failed(&e))?;
    std::fs::write(file, picture).map_err(|e| failed(&e))?;
    output.note(&format!("drew {} to {}", table::count(plots.len(), "actuator"), display_path(file)));
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
