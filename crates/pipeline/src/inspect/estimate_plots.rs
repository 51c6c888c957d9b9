//! Diagnostic plots of the estimates of a log: for `estimate --plot` and for the flights of a report.

use ingest::ActuatorChannels;
use job::{Part, estimate};
use records::{Diagnostic, GapEstimate};
use report::{ContactInterval, EstimatePlot};

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
    let mut plot = EstimatePlot {
        title: format!("{} in {log_path}", channels.position),
        summary: summary(estimate),
        step_s: channels.step_s,
        breaks: channels.breaks.clone(),
        bounds_m: midrange.map(|gap| (gap.upper_m, gap.lower_m)),
        dx_m: channels.dx_m.clone(),
        load_n: channels.load_n.clone(),
        s_m,
        ..EstimatePlot::default()
    };
    if let Some(contact) = estimate::plot_data(channels, part)? {
        plot.flanks = [contact.upper.to_vec(), contact.lower.to_vec()];
        let intervals = contact.touches.into_iter().map(|touch| ContactInterval {
            time_s: plot.time_s(touch.time_s / plot.step_s),
            is_upper: touch.flank.sign() > 0.0,
            is_used: touch.trust.is_some_and(|trust| trust > 0.0),
            force_n: touch.force_n,
            dx_m: touch.dx_m,
        });
        plot.contacts = intervals.collect();
    }
    Ok(plot)
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
