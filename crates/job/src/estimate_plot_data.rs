//! Everything one would draw of an estimate: channels, S(t), and the flanks as they were found.

use estimator::contact::ContactPlot;
use estimator::{GainSchedule, GapStatistic, gap};
use ingest::{ActuatorChannels, LogFiles};
use records::{Diagnostic, GapEstimate, Installations, PartNumber, Position};

use crate::config::Config;
use crate::config::part::Part;
use crate::estimate;
use crate::flight_log;

/// One actuator in one flight.
#[derive(Debug, Clone, PartialEq)]
pub struct EstimatePlot {
    /// Its place.
    pub position: Position,
    /// Its record, or why there is none.
    pub estimate: GapEstimate,
    /// Time between samples, s.
    pub step_s: f64,
    /// The first sample after each break of the clock, and its time, s.
    pub breaks: Vec<(usize, f64)>,
    /// δX, m; NaN where missing.
    pub dx_m: Vec<f64>,
    /// Load, N.
    pub load_n: Vec<f64>,
    /// S(t), m; NaN outside the segments.
    pub s_m: Vec<f64>,
    /// The published statistic of S, where it moves.
    pub midrange: Option<GapStatistic>,
    /// Plot data of the contact regression; `None` where it rejected the flight.
    pub picture: Option<ContactPlot>,
}

impl EstimatePlot {
    fn of(channels: &ActuatorChannels, part: &Part, config: &Config) -> Result<Self, Diagnostic> {
        let mut s_m = Vec::new();
        GainSchedule::new(&estimate::filter(channels, part)?)
            .track(&estimate::samples(channels), &mut s_m)
            .map_err(|e| Diagnostic::new("estimate_failed", e))?;
        Ok(Self {
            position: channels.position.clone(),
            estimate: estimate::estimate(channels, part, &config.document.estimate)?,
            step_s: channels.step_s,
            breaks: channels.breaks.clone(),
            dx_m: channels.dx_m.clone(),
            load_n: channels.load_n.clone(),
            midrange: gap::mid_range(&s_m).ok(),
            s_m,
            picture: estimate::plot_data(channels, part)?,
        })
    }
}

/// Plot data of every actuator of a log: as installed, or all as one part.
///
/// # Errors
/// A diagnostic when the log or an actuator in it cannot be read.
pub fn of_log(
    files: &LogFiles,
    log_path: &str,
    config: &Config,
    installations: &Installations,
    part: Option<&PartNumber>,
) -> Result<Vec<EstimatePlot>, Diagnostic> {
    let mut plots = Vec::new();
    flight_log::for_each_actuator(files, log_path, config, installations, part, |channels, part| {
        plots.push(EstimatePlot::of(channels, part, config)?);
        Ok(())
    })?;
    Ok(plots)
}
