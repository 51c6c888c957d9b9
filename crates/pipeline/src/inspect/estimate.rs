//! Estimates without a store: from logs or arrays to rows.

use std::path::Path;
use std::sync::Arc;

use ingest::log::in_memory::ChannelArrays;
use ingest::{ActuatorChannels, LogFiles};
use job::flight_log::{FlightLog, part_of, read_as_part};
use job::trace::Trace;
use job::{Config, Part};
use records::row_schema::Row;
use records::{Diagnostic, GapEstimate, GapRecord, Installations, PartNumber, Position};
use report::EstimatePlot;

use crate::error::Error;
use crate::logs::discover;
use crate::run::time_limit::within_time_limit;

records::row! {
    /// An estimate without a store: the columns of a record except those of a run. Columns of an unidentified log are
    /// null.
    #[derive(Debug, Clone, Default)]
    pub struct EstimateRow {
        pub tail_number: Option<String>,
        pub position: Option<String>,
        pub part_number: Option<String>,
        pub serial_number: Option<String>,
        pub flight_id: Option<String>,
        pub departure_utc: Option<jiff::Timestamp>,
        pub flight_hours: Option<f64>,
        pub tail_hours_end: Option<f64>,
        pub estimate: GapEstimate,
        pub log_path: Option<String>,
        pub log_digest: Option<String>,
        pub config_digest: String,
        pub program_version: String,
    }
    order = <GapRecord as Row>::order
}

/// How logs are estimated.
#[derive(Debug, Clone)]
#[expect(missing_docs, reason = "each field is named for what it holds")]
pub struct EstimateRequest {
    pub config: Arc<Config>,
    /// The part in each position; not needed with a `part`.
    pub installations: Arc<Installations>,
    /// The part as which every actuator is taken. The logs need no identity then.
    pub part: Option<PartNumber>,
    pub program_version: &'static str,
    pub has_trace: bool,
    pub has_plots: bool,
}

/// Estimates of a log.
#[derive(Debug, Default)]
#[expect(missing_docs, reason = "each field is named for what it holds")]
pub struct LogEstimates {
    pub rows: Vec<EstimateRow>,
    /// Inputs and outputs of the filters, one actuator after the other.
    pub trace: Trace,
    pub plots: Vec<EstimatePlot>,
    /// Errors of the log, or of single actuators: also where an estimate has no trace or no plot.
    pub diagnostics: Vec<Diagnostic>,
}

/// Estimates every actuator of a log, within `run.log_timeout_s`.
///
/// # Errors
/// When the configured logs cannot be listed, or the log takes longer.
pub fn estimate(path: &Path, request: &EstimateRequest) -> Result<LogEstimates, Error> {
    let (path, of_log) = (path.to_owned(), request.clone());
    let log_path = path.display().to_string();
    let found = within_time_limit(&log_path.clone(), &request.config, move || {
        let files = match of_log.part {
            Some(_) => Ok(LogFiles::one(path)),
            None => discover::log_containing(&of_log.config, &path),
        };
        Ok(files.map(|files| {
            let mut found = LogEstimates::default();
            let failed = found.fill(&files, &log_path, &of_log).err();
            found.diagnostics.extend(failed);
            found
        }))
    });
    found.unwrap_or_else(|diagnostic| {
        Ok(LogEstimates { diagnostics: vec![diagnostic], ..LogEstimates::default() })
    })
}

impl LogEstimates {
    fn fill(
        &mut self,
        files: &LogFiles,
        log_path: &str,
        request: &EstimateRequest,
    ) -> Result<(), Diagnostic> {
        let EstimateRequest { config, installations, .. } = request;
        if let Some(number) = &request.part {
            return read_as_part(files, log_path, config, number, |channels, part| {
                let estimate = job::estimate::estimate(&channels, part, &config.document.estimate)?;
                let row = EstimateRow {
                    position: Some(channels.position.to_string()),
                    ..unidentified(estimate, config, number, request.program_version)
                };
                self.add(log_path, request, part, row, Some(channels));
                Ok(())
            });
        }
        let opened = FlightLog::open(files, log_path, config, installations)?;
        let flight = &opened.identity.flight;
        for at in opened.actuators() {
            let estimated = opened.unit(at).and_then(|(installation, part)| {
                let (estimate, channels) = opened.estimate(at, part)?;
                let row = EstimateRow {
                    tail_number: Some(flight.tail_number.to_string()),
                    position: Some(at.columns.position.to_string()),
                    part_number: Some(installation.part_number.to_string()),
                    serial_number: Some(installation.serial_number.to_string()),
                    flight_id: Some(flight.flight_id.to_string()),
                    departure_utc: Some(flight.departure_utc),
                    flight_hours: flight.flight_hours,
                    tail_hours_end: flight.tail_hours_end,
                    estimate,
                    log_digest: Some(opened.digest.clone()),
                    config_digest: opened.config_digest(installation),
                    program_version: request.program_version.to_owned(),
                    ..EstimateRow::default()
                };
                self.add(log_path, request, part, row, channels);
                Ok(())
            });
            self.diagnostics.extend(estimated.err().map(|diagnostic| diagnostic.in_file(log_path)));
        }
        Ok(())
    }

    /// Adds a row, and a trace and a plot of its actuator where they are asked for and the log has its channels.
    fn add(
        &mut self,
        log_path: &str,
        request: &EstimateRequest,
        part: &Part,
        row: EstimateRow,
        channels: Option<ActuatorChannels>,
    ) {
        self.rows.push(EstimateRow { log_path: Some(log_path.to_owned()), ..row });
        let shown = channels.map_or(Ok(()), |channels| self.show(log_path, request, part, channels));
        self.diagnostics.extend(shown.err().map(|diagnostic| diagnostic.in_file(log_path)));
    }

    /// Traces and draws the actuator of the last row.
    fn show(
        &mut self,
        log_path: &str,
        request: &EstimateRequest,
        part: &Part,
        channels: ActuatorChannels,
    ) -> Result<(), Diagnostic> {
        if request.has_trace {
            self.trace.add(log_path, &channels, part)?;
        }
        if let Some(row) = self.rows.last().filter(|_| request.has_plots) {
            self.plots.push(plot(log_path, &channels, part, &row.estimate)?);
        }
        channels.recycle_buffers();
        Ok(())
    }
}

/// Estimates in-memory channels as a part.
///
/// # Errors
/// A diagnostic when the part is not configured, or the arrays are no channels.
pub fn of_arrays(
    arrays: &ChannelArrays<'_>,
    config: &Config,
    number: &PartNumber,
    program_version: &str,
) -> Result<EstimateRow, Diagnostic> {
    let part = part_of(config, number)?;
    // A position is part of a log's identity, which arrays have none of.
    let own = Position::new("arrays").map_err(|e| Diagnostic::new("empty_name", e))?;
    let channels = arrays.to_channels(own).map_err(|e| e.diagnostic())?;
    let estimate = job::estimate::estimate(&channels, part, &config.document.estimate)?;
    Ok(unidentified(estimate, config, number, program_version))
}

/// The row of an estimate of a part, of which neither aircraft nor flight is known.
fn unidentified(
    estimate: GapEstimate,
    config: &Config,
    number: &PartNumber,
    program_version: &str,
) -> EstimateRow {
    EstimateRow {
        part_number: Some(number.to_string()),
        estimate,
        config_digest: config.digest_of_part(number),
        program_version: program_version.to_owned(),
        ..EstimateRow::default()
    }
}

/// The diagnostic plot of an actuator of a log, for `estimate --plot` and for the flights of a report.
pub(crate) fn plot(
    log_path: &str,
    channels: &ActuatorChannels,
    part: &Part,
    estimate: &GapEstimate,
) -> Result<EstimatePlot, Diagnostic> {
    let (s_m, midrange) = job::estimate::filter_output(channels, part)?;
    Ok(EstimatePlot {
        title: format!("{} in {log_path}", channels.position),
        summary: summary(estimate),
        step_s: channels.step_s,
        breaks: channels.breaks.clone(),
        bounds_m: midrange.map(|gap| (gap.upper_m, gap.lower_m)),
        dx_m: channels.dx_m.clone(),
        load_n: channels.load_n.clone(),
        s_m,
        contact: job::estimate::plot_data(channels, part)?,
    })
}

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
