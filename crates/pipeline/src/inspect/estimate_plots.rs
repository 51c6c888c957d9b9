//! Diagnostic plots of the estimates of a log: for `estimate --plot` and for the flights of a report.

use ingest::ActuatorChannels;
use job::{Part, estimate};
use records::{Diagnostic, GapEstimate};
use report::EstimatePlot;

/// The plot of an actuator of a log.
///
/// # Errors
/// A diagnostic when the settings of the part do not fit the step of the log.
pub(crate) fn plot(
    log_path: &str,
    channels: &ActuatorChannels,
    part: &Part,
    estimate: &GapEstimate,
) -> Result<EstimatePlot, Diagnostic> {
    let (s_m, midrange) = estimate::filter_output(channels, part)?;
    Ok(EstimatePlot {
        title: format!("{} in {log_path}", channels.position),
        summary: summary(estimate),
        step_s: channels.step_s,
        breaks: channels.breaks.clone(),
        bounds_m: midrange.map(|gap| (gap.upper_m, gap.lower_m)),
        dx_m: channels.dx_m.clone(),
        load_n: channels.load_n.clone(),
        s_m,
        contact: estimate::plot_data(channels, part)?,
    })
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
