//! Functions on logs and arrays, and the run: arguments to a request, result to a table.
#![expect(clippy::needless_pass_by_value, reason = "Python hands values over")]

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use arrow::array::RecordBatch;
use ingest::log::in_memory::ChannelArrays;
use ingest::parquet::writer::Encoding;
use pipeline::Request;
use pipeline::inspect::estimate::{self, EstimateRequest, LogEstimates};
use pipeline::logs::discover;
use pipeline::run::scheduler::Context;
use pyo3::prelude::*;
use records::row_schema::to_nullable_batch;
use records::{Diagnostic, Installations, PartNumber};

use crate::arrow_capsule::arrow_error;
use crate::config::{Config, VERSION};
use crate::error::{ExceptionClass, config_error, to_exception, to_run_exception};
use crate::numpy_input::numbers;
use crate::table::Table;

fn part(py: Python<'_>, config: &Config, number: &str) -> PyResult<PartNumber> {
    let named = PartNumber::new(number).map_err(|e| config_error(py, Diagnostic::new("empty_name", e)))?;
    job::flight_log::part_of(&config.inner, &named).map_err(|diagnostic| config_error(py, diagnostic))?;
    Ok(named)
}

/// Estimates of logs: as installed, or all as one part.
fn request(
    py: Python<'_>,
    config: &Config,
    number: Option<&str>,
    has_trace: bool,
) -> PyResult<EstimateRequest> {
    let (part, installations) = match number {
        Some(number) => (Some(part(py, config, number)?), Installations::default()),
        None => (None, config.installations(py)?.clone()),
    };
    let (config, installations) = (Arc::new(config.inner.clone()), Arc::new(installations));
    let (program_version, has_plots) = (VERSION, false);
    Ok(EstimateRequest { config, installations, part, program_version, has_trace, has_plots })
}

fn estimate_log(py: Python<'_>, log: &Path, request: &EstimateRequest) -> PyResult<LogEstimates> {
    py.check_signals()?;
    py.detach(|| estimate::estimate(log, request)).map_err(|error| to_run_exception(py, error))
}

/// Estimates logs: as installed, or all as one part. Errors of logs are in `Table.errors`.
#[pyfunction]
#[pyo3(name = "estimate", signature = (logs, config, part_number=None))]
pub(crate) fn estimate_logs(
    py: Python<'_>,
    logs: Vec<PathBuf>,
    config: &Config,
    part_number: Option<&str>,
) -> PyResult<Table> {
    let request = request(py, config, part_number, false)?;
    let (mut found, mut diagnostics) = (Vec::new(), Vec::new());
    for log in &logs {
        let of_log = estimate_log(py, log, &request)?;
        found.extend(of_log.rows);
        diagnostics.extend(of_log.diagnostics);
    }
    let batch = to_nullable_batch(&found).map_err(|e| to_run_exception(py, e.into()))?;
    Ok(Table::with_errors(batch, diagnostics))
}

/// Estimates channels held in memory.
#[pyfunction]
pub(crate) fn estimate_arrays(
    py: Python<'_>,
    time_s: &Bound<'_, PyAny>,
    motor_m: &Bound<'_, PyAny>,
    screw_m: &Bound<'_, PyAny>,
    load_n: &Bound<'_, PyAny>,
    part_number: &str,
    config: &Config,
) -> PyResult<Table> {
    let number = part(py, config, part_number)?;
    let [time_s, motor_m, screw_m, load_n] =
        [numbers(time_s)?, numbers(motor_m)?, numbers(screw_m)?, numbers(load_n)?];
    let found = py.detach(|| {
        let arrays = ChannelArrays { time_s: &time_s, motor_m: &motor_m, screw_m: &screw_m, load_n: &load_n };
        estimate::of_arrays(&arrays, &config.inner, &number, VERSION)
    });
    let found = found.map_err(|diagnostic| to_exception(py, ExceptionClass::Log, &[diagnostic]))?;
    Table::of_rows(py, &[found])
}

/// Inputs and outputs of the filter of a log, sample by sample.
#[pyfunction]
#[pyo3(signature = (log, config, part_number=None))]
pub(crate) fn trace(
    py: Python<'_>,
    log: PathBuf,
    config: &Config,
    part_number: Option<&str>,
) -> PyResult<Table> {
    let seen = estimate_log(py, &log, &request(py, config, part_number, true)?)?;
    if let Some(diagnostic) = seen.diagnostics.into_iter().next() {
        return Err(to_exception(py, ExceptionClass::Log, &[diagnostic]));
    }
    let columns = seen.trace.columns();
    Ok(Table::of(ingest::parquet::writer::batch(&columns).map_err(|e| arrow_error(&e))?))
}

/// Writes normalized logs below a folder.
#[pyfunction]
pub(crate) fn normalize(
    py: Python<'_>,
    logs: Vec<PathBuf>,
    output: PathBuf,
    config: &Config,
    compatible: bool,
    jobs: Option<usize>,
) -> PyResult<(Vec<PathBuf>, Option<Py<PyAny>>)> {
    let encoding = if compatible { Encoding::Compatible } else { Encoding::Split };
    let done = config.with(py, |config, installations| {
        let selected = discover::select(config, Some(&logs), usize::MAX)?;
        pipeline::inspect::normalize::normalize(
            config,
            installations,
            selected,
            &output,
            encoding,
            jobs,
            &|_| {},
        )
    })?;
    let trouble = (!done.diagnostics.is_empty())
        .then(|| to_exception(py, ExceptionClass::Log, &done.diagnostics).into_value(py).into_any());
    Ok((done.written, trouble))
}

/// Channels of logs, with errors of logs in `Table.errors`; nothing is estimated or written.
#[pyfunction]
pub(crate) fn check(
    py: Python<'_>,
    logs: Option<Vec<PathBuf>>,
    config: &Config,
    limit: usize,
) -> PyResult<Table> {
    let (batch, diagnostics) = config.with(py, |config, installations| {
        let selected = discover::select(config, logs.as_deref(), limit)?;
        let (config, installations) = (Arc::new(config.clone()), Arc::new(installations.clone()));
        let seen = pipeline::inspect::check::check_logs(&config, &installations, selected);
        let batch: RecordBatch = to_nullable_batch(&seen.channels())?;
        Ok((batch, seen.diagnostics.into_iter().chain(seen.mapping_faults).collect()))
    })?;
    Ok(Table::with_errors(batch, diagnostics))
}

/// Runs something that stores results, without Python's lock, as this process and with a longest wait for another run.
/// Returns its summary as JSON.
pub(crate) fn run_summary(
    py: Python<'_>,
    wait_s: Option<f64>,
    run: impl FnOnce(&Context<'_>) -> Result<pipeline::RunSummary, pipeline::Error> + Send,
) -> PyResult<String> {
    let stop = AtomicBool::new(false);
    let wait = wait_s.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
    let summary = py.detach(|| run(&Context { program_version: VERSION, wait, stop: &stop, watch: &|_| {} }));
    let summary = summary.map_err(|error| to_run_exception(py, error))?;
    serde_json::to_string(&summary)
        .map_err(|e| to_exception(py, ExceptionClass::Run, &[Diagnostic::new("run_failed", e)]))
}

/// The nightly run on this machine; its summary as JSON.
#[pyfunction]
pub(crate) fn run(
    py: Python<'_>,
    config: &Config,
    jobs: Option<usize>,
    redo: bool,
    retry: bool,
    wait_s: Option<f64>,
) -> PyResult<String> {
    let request = Request { jobs, redo, retry, ..Request::default() };
    run_summary(py, wait_s, |context| pipeline::run(&config.inner, &request, context))
}
