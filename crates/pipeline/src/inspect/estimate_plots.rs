//! Diagnostic plots of the estimates of a log: for `estimate --plot` and for the flights of a report.

use ingest::{ActuatorChannels, LogFiles};
use job::flight_log::for_each_actuator;
use job::{Config, Part, estimate};
use records::{Diagnostic, GapEstimate, Installations, PartNumber, Position};
use report::{ContactInterval, EstimatePlot};

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
) -> Result<Vec<(Position, EstimatePlot)>, Diagnostic> {
    let mut plots = Vec::new();
    for_each_actuator(files, log_path, config, installations, part, |channels, part| {
        plots.push((channels.position.clone(), plot(log_path, channels, part, config)?));
        Ok(())
    })?;
    Ok(plots)
}

fn plot(
    log: &str,
    channels: &ActuatorChannels,
    part: &Part,
    config: &Config,
) -> Result<EstimatePlot, Diagnostic> {
    let (s_m, midrange) = estimate::filter_output(channels, part)?;
    let estimate = estimate::estimate(channels, part, &config.document.estimate)?;
    let mut plot = EstimatePlot {
        title: format!("{} in {log}", channels.position),
        summary: summary(&estimate),
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
