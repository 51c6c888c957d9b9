//! Functions of the module: arguments to a request, result to a table.
#![expect(clippy::needless_pass_by_value, reason = "Python hands values over")]

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use ::records::row_schema::to_nullable_batch;
use ::records::{Diagnostic, Installations, PartNumber};
use arrow::array::RecordBatch;
use ingest::log::in_memory::ChannelArrays;
use ingest::parquet::writer::Encoding;
use ingest::tables::{Table as Cells, TableBatch};
use pipeline::Request;
use pipeline::assess::trends::{self, UnitSelection};
use pipeline::fleet::external_estimates;
use pipeline::run::scheduler::Context;
use pyo3::prelude::*;
use store::{Holder, Query};

use crate::VERSION;
use crate::arrow_capsule::{self, arrow_error};
use crate::config::Config;
use crate::error::{ExceptionClass, config_error, to_exception, to_run_exception};
use crate::numpy_input::numbers;
use crate::table::Table;

fn part(py: Python<'_>, config: &Config, number: &str) -> PyResult<PartNumber> {
    let named = PartNumber::new(number).map_err(|e| config_error(py, Diagnostic::new("empty_name", e)))?;
    job::flight_log::part_of(&config.inner, &named).map_err(|diagnostic| config_error(py, diagnostic))?;
    Ok(named)
}

pub(crate) fn instant(py: Python<'_>, text: Option<&str>) -> PyResult<Option<jiff::Timestamp>> {
    let read = text.map(ingest::tables::utc).transpose();
    read.map_err(|what| config_error(py, Diagnostic::new("bad_time", what)))
}

/// Estimates logs: as installed, or all as one part. Errors of logs are in `Table.errors`.
#[pyfunction]
#[pyo3(signature = (logs, config, part_number=None))]
pub(crate) fn estimate(
    py: Python<'_>,
    logs: Vec<PathBuf>,
    config: &Config,
    part_number: Option<&str>,
) -> PyResult<Table> {
    let no_installations = Installations::default();
    let number = part_number.map(|number| part(py, config, number)).transpose()?;
    let installations = if number.is_some() { &no_installations } else { config.installations(py)? };
    let (mut found, mut diagnostics) = (Vec::new(), Vec::new());
    for log in &logs {
        py.check_signals()?;
        let number = number.as_ref();
        let read = py.detach(|| {
            pipeline::inspect::estimate::estimate(
                log,
                &config.inner,
                installations,
                number,
                VERSION,
                &mut diagnostics,
            )
        });
        found.extend(read.map_err(|error| to_run_exception(py, error))?);
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
        pipeline::inspect::estimate::of_arrays(&arrays, &config.inner, &number, VERSION)
    });
    let found = found.map_err(|diagnostic| to_exception(py, ExceptionClass::Log, &[diagnostic]))?;
    Ok(Table::of(to_nullable_batch(&[found]).map_err(|e| to_run_exception(py, e.into()))?))
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
    let no_installations = Installations::default();
    let number = part_number.map(|number| part(py, config, number)).transpose()?;
    let installations = if number.is_some() { &no_installations } else { config.installations(py)? };
    let files = pipeline::logs::discover::log_containing(&config.inner, &log)
        .map_err(|error| to_run_exception(py, error))?;
    let log_path = log.display().to_string();
    let seen =
        py.detach(|| job::trace::of_log(&files, &log_path, &config.inner, installations, number.as_ref()));
    let columns = seen.map_err(|diagnostic| to_exception(py, ExceptionClass::Log, &[diagnostic]))?.columns();
    Ok(Table::of(ingest::parquet::writer::batch(&columns).map_err(|e| arrow_error(&e))?))
}

/// Trends of the store, or of an external estimates table; one row for each unit, or for each query.
#[pyfunction]
#[pyo3(signature = (estimates, config, tail, serial, part_number, as_of, queries))]
#[expect(clippy::too_many_arguments, reason = "they are Python's keywords")]
pub(crate) fn trend(
    py: Python<'_>,
    estimates: Option<&Bound<'_, PyAny>>,
    config: &Config,
    tail: Option<String>,
    serial: Option<String>,
    part_number: Option<String>,
    as_of: Option<&str>,
    queries: Option<&Bound<'_, PyAny>>,
) -> PyResult<Table> {
    let installations = config.installations(py)?;
    let as_of_utc = instant(py, as_of)?;
    let ask = UnitSelection { tail_number: tail, serial_number: serial, part_number, as_of_utc };
    let estimate_batches = estimates.map(arrow_capsule::batches).transpose()?;
    let queries_table = queries.map(|table| to_table(table, "queries")).transpose()?;
    let assess = || {
        let chunks = estimate_batches.map(chunks);
        let histories = chunks.map(|chunks| external_estimates::from_batches(&chunks)).transpose()?;
        let queries = queries_table.as_ref().map(external_estimates::queries).transpose()?;
        trends::assess(&config.inner, installations, histories, queries.as_deref(), &ask)
    };
    let found = py.detach(assess);
    let found = found.map_err(|error| to_run_exception(py, error))?;
    Ok(Table::of(to_nullable_batch(&found.now).map_err(|e| to_run_exception(py, e.into()))?))
}

fn to_table(table: &Bound<'_, PyAny>, name: &str) -> PyResult<Cells> {
    let read = Cells::of_batches(name.as_ref(), &arrow_capsule::batches(table)?);
    read.map_err(|error| config_error(table.py(), error.diagnostic()))
}

/// The rows of a table from memory, counted through.
pub(crate) fn chunks(batches: Vec<RecordBatch>) -> Vec<TableBatch> {
    let mut before = 0;
    let chunk = |batch: RecordBatch| {
        let rows = batch.num_rows();
        before += rows;
        TableBatch::new("estimates".as_ref(), batch, before - rows)
    };
    batches.into_iter().map(chunk).collect()
}

/// Stored records that fit.
#[pyfunction]
#[pyo3(signature = (config, texts, since, until, last))]
pub(crate) fn records(
    py: Python<'_>,
    config: &Config,
    texts: [Option<String>; 5],
    since: Option<&str>,
    until: Option<&str>,
    last: Option<usize>,
) -> PyResult<Table> {
    let [tail_number, serial_number, part_number, flight_id, position] = texts;
    let (since_utc, until_utc) = (instant(py, since)?, instant(py, until)?);
    let query = Query {
        tail_number,
        serial_number,
        part_number,
        flight_id,
        position,
        since_utc,
        until_utc,
        last,
        ..Query::default()
    };
    let (installations, config) = (config.installations(py)?, &config.inner);
    let found = py.detach(|| Ok(pipeline::open_store(config, installations)?.scan(&query)?));
    Ok(Table::of(found.map_err(|error| to_run_exception(py, error))?))
}

/// Writes normalized logs below a folder.
#[pyfunction]
#[pyo3(signature = (logs, output, config, compatible, jobs))]
pub(crate) fn normalize(
    py: Python<'_>,
    logs: Vec<PathBuf>,
    output: PathBuf,
    config: &Config,
    compatible: bool,
    jobs: Option<usize>,
) -> PyResult<(Vec<PathBuf>, Option<Py<PyAny>>)> {
    let installations = config.installations(py)?;
    let encoding = if compatible { Encoding::Compatible } else { Encoding::Split };
    let done = py.detach(|| {
        let logs = pipeline::logs::discover::named_logs(&config.inner, &logs)?;
        let place = (output.as_path(), encoding);
        pipeline::inspect::normalize::normalize(&config.inner, installations, &logs, place, jobs, &|_| {})
    });
    let done = done.map_err(|error| to_run_exception(py, error))?;
    let trouble = (!done.diagnostics.is_empty())
        .then(|| to_exception(py, ExceptionClass::Log, &done.diagnostics).into_value(py).into_any());
    Ok((done.written, trouble))
}

/// The nightly run on this machine; its account as JSON.
#[pyfunction]
#[pyo3(signature = (config, jobs, redo, retry, wait_s))]
pub(crate) fn run(
    py: Python<'_>,
    config: &Config,
    jobs: Option<usize>,
    redo: bool,
    retry: bool,
    wait_s: Option<f64>,
) -> PyResult<String> {
    let request = Request { jobs, redo, retry, ..Request::default() };
    let stop = AtomicBool::new(false);
    let wait = wait_s.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
    let holder = Holder::this_process();
    let context = Context { program_version: VERSION, holder, wait, stop: &stop, watch: &|_| {} };
    let report = py.detach(|| pipeline::run(&config.inner, &request, &context));
    run_summary(py, report)
}

/// What a run did, as JSON.
pub(crate) fn run_summary(
    py: Python<'_>,
    report: Result<pipeline::RunSummary, pipeline::Error>,
) -> PyResult<String> {
    let report = report.map_err(|error| to_run_exception(py, error))?;
    serde_json::to_string(&report)
        .map_err(|e| to_exception(py, ExceptionClass::Run, &[Diagnostic::new("run_failed", e)]))
}
