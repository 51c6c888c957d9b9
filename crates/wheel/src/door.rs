//! The doors: each function of the module, arguments to a request and answer to a table.
#![expect(clippy::needless_pass_by_value, reason = "Python hands values over")]

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use ::records::{Diagnostic, Installations, PartNumber};
use arrow::array::RecordBatch;
use ingest::arrays::Arrays;
use ingest::tables::{Chunk, Table as Cells};
use ingest::write::Encoding;
use pipeline::schedule::Context;
use pipeline::statement::TrendRow;
use pipeline::trends::{self, Ask};
use pipeline::{Request, adhoc, estimates, rows};
use pyo3::prelude::*;
use store::{Holder, Query, Store};

use crate::VERSION;
use crate::capsule::{self, broken};
use crate::error::{Class, failed, raised, refused};
use crate::numbers::numbers;
use crate::settings::Config;
use crate::table::Table;

/// A table, and what was wrong with some of the logs: an exception to be raised, or none.
type Partly = (Table, Option<Py<PyAny>>);

fn partly(py: Python<'_>, batch: RecordBatch, diagnostics: &[Diagnostic]) -> Partly {
    let trouble =
        (!diagnostics.is_empty()).then(|| raised(py, Class::Log, diagnostics).into_value(py).into_any());
    (Table::of(batch), trouble)
}

fn part(py: Python<'_>, config: &Config, number: &str) -> PyResult<PartNumber> {
    let named = PartNumber::new(number).map_err(|e| refused(py, Diagnostic::new("empty_name", e)))?;
    job::flight_log::part_of(&config.inner, &named).map_err(|diagnostic| refused(py, diagnostic))?;
    Ok(named)
}

fn instant(py: Python<'_>, text: Option<&str>) -> PyResult<Option<jiff::Timestamp>> {
    let read = text.map(ingest::tables::utc).transpose();
    read.map_err(|what| refused(py, Diagnostic::new("bad_time", what)))
}

/// Estimates logs: as booked, or all as one part.
#[pyfunction]
#[pyo3(signature = (logs, config, part_number=None))]
pub(crate) fn estimate(
    py: Python<'_>,
    logs: Vec<PathBuf>,
    config: &Config,
    part_number: Option<&str>,
) -> PyResult<Partly> {
    let nobody = Installations::default();
    let number = part_number.map(|number| part(py, config, number)).transpose()?;
    let booked = if number.is_some() { &nobody } else { config.booked(py)? };
    let (mut found, mut diagnostics) = (Vec::new(), Vec::new());
    for log in &logs {
        py.check_signals()?;
        let number = number.as_ref();
        let read =
            py.detach(|| adhoc::estimate(log, &config.inner, booked, number, VERSION, &mut diagnostics));
        found.extend(read.map_err(|error| failed(py, error))?);
    }
    let batch = rows::batch(&rows::estimates(), &found).map_err(|e| broken(&e))?;
    Ok(partly(py, batch, &diagnostics))
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
        let arrays = Arrays { time_s: &time_s, motor_m: &motor_m, screw_m: &screw_m, load_n: &load_n };
        adhoc::of_arrays(&arrays, &config.inner, &number, VERSION)
    });
    let found = found.map_err(|diagnostic| raised(py, Class::Log, &[diagnostic]))?;
    Ok(Table::of(rows::batch(&rows::estimates(), &[found]).map_err(|e| broken(&e))?))
}

/// What the filter saw of a log, sample by sample.
#[pyfunction]
#[pyo3(signature = (log, config, part_number=None))]
pub(crate) fn trace(
    py: Python<'_>,
    log: PathBuf,
    config: &Config,
    part_number: Option<&str>,
) -> PyResult<Table> {
    let nobody = Installations::default();
    let number = part_number.map(|number| part(py, config, number)).transpose()?;
    let booked = if number.is_some() { &nobody } else { config.booked(py)? };
    let files = pipeline::bundle::around(&config.inner, &log).map_err(|error| failed(py, error))?;
    let shown = log.display().to_string();
    let seen = py.detach(|| job::trace::of_log(&files, &shown, &config.inner, booked, number.as_ref()));
    let columns = seen.map_err(|diagnostic| raised(py, Class::Log, &[diagnostic]))?.columns();
    Ok(Table::of(ingest::write::batch(&columns).map_err(|e| broken(&e))?))
}

/// Trends: of the store, or of estimates made elsewhere; one row for each unit, or for each query.
#[pyfunction]
#[pyo3(signature = (estimates, config, tail, serial, part_number, as_of, queries, statistics))]
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
    statistics: bool,
) -> PyResult<Table> {
    let booked = config.booked(py)?;
    let as_of_utc = instant(py, as_of)?;
    let ask = Ask { tail_number: tail, serial_number: serial, part_number, as_of_utc, statistics };
    let given = estimates.map(capsule::batches).transpose()?;
    let days = queries.map(|table| cells(table, "queries")).transpose()?;
    let found = py.detach(|| stated(&config.inner, booked, given, days.as_ref(), &ask));
    let found = found.map_err(|error| failed(py, error))?;
    Ok(Table::of(rows::batch(&rows::trends(), &found).map_err(|e| broken(&e))?))
}

fn cells(table: &Bound<'_, PyAny>, name: &str) -> PyResult<Cells> {
    let read = Cells::of_batches(name.as_ref(), &capsule::batches(table)?);
    read.map_err(|error| refused(table.py(), error.diagnostic()))
}

fn stated(
    config: &job::Config,
    booked: &Installations,
    given: Option<Vec<RecordBatch>>,
    days: Option<&Cells>,
    ask: &Ask,
) -> Result<Vec<TrendRow>, pipeline::Error> {
    let histories = match (given, days) {
        (None, None) => return trends::of_store(config, booked, &Store::open(config.store())?, ask),
        (Some(batches), _) => estimates::gathered(&chunks(batches))?,
        (None, Some(_)) => trends::in_store(&Store::open(config.store())?)?,
    };
    match days {
        None => trends::of_histories(config, booked, histories, ask),
        Some(days) => trends::of_queries(config, booked, histories, &estimates::asked(days)?, ask.statistics),
    }
}

/// The rows of a table from memory, counted through.
fn chunks(batches: Vec<RecordBatch>) -> Vec<Chunk> {
    let mut before = 0;
    let chunk = |batch: RecordBatch| {
        let rows = batch.num_rows();
        before += rows;
        Chunk::new("estimates".as_ref(), batch, before - rows)
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
    let found = py.detach(|| Store::open(config.inner.store())?.scan(&query));
    Ok(Table::of(found.map_err(|error| failed(py, error.into()))?))
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
    let booked = config.booked(py)?;
    let encoding = if compatible { Encoding::Compatible } else { Encoding::Split };
    let done = py.detach(|| {
        let whole =
            |log: &PathBuf| Ok((pipeline::bundle::around(&config.inner, log)?, log.display().to_string()));
        let logs = logs.iter().map(whole).collect::<Result<Vec<_>, pipeline::Error>>()?;
        let place = (output.as_path(), encoding);
        pipeline::normalize::normalize(&config.inner, booked, &logs, place, jobs, &|_| {})
    });
    let done = done.map_err(|error| failed(py, error))?;
    let trouble = (!done.diagnostics.is_empty())
        .then(|| raised(py, Class::Log, &done.diagnostics).into_value(py).into_any());
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
    account(py, report)
}

/// What a run did, as JSON.
pub(crate) fn account(py: Python<'_>, report: Result<pipeline::Report, pipeline::Error>) -> PyResult<String> {
    let report = report.map_err(|error| failed(py, error))?;
    serde_json::to_string(&report).map_err(|e| raised(py, Class::Run, &[Diagnostic::new("run_failed", e)]))
}
