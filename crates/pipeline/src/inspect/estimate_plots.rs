//! Diagnostic plots of the estimates of a log: for `estimate --plot` and for the flights of a report.

use ingest::LogFiles;
use job::Config;
use job::estimate_plot_data::{self, EstimatePlot};
use records::{Diagnostic, GapEstimate, Installations, PartNumber, Position};
use report::ContactInterval;

/// The plot of every actuator of a log, with its position: as installed, or all as one part.
///
/// # Errors
/// A diagnostic when the log or an actuator in it cannot be read.
pub fn of_log(
    files: &LogFiles,
    log_path: &str,
    config: &Config,
    installations: &Installations,
    part: Option<&PartNumber>,
) -> Result<Vec<(Position, report::EstimatePlot)>, Diagnostic> {
    let data = estimate_plot_data::of_log(files, log_path, config, installations, part)?;
    Ok(data.into_iter().map(|data| (data.position.clone(), plot(log_path, data))).collect())
}

fn plot(log: &str, data: EstimatePlot) -> report::EstimatePlot {
    let (upper, lower, touches) = match data.picture {
        Some(picture) => (picture.upper.to_vec(), picture.lower.to_vec(), picture.touches),
        None => Default::default(),
    };
    let mut plot = report::EstimatePlot {
        title: format!("{} in {log}", data.position),
        summary: summary(&data.estimate),
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

/// The estimate in one line.
fn summary(e: &GapEstimate) -> String {
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
