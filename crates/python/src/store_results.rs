//! Functions that read a store: followed quantities, backtest, comparison, explanation, report and work requests.
#![expect(clippy::needless_pass_by_value, reason = "Python hands values over")]

use std::path::PathBuf;
use std::sync::Arc;

use ::records::row_schema::{Row, to_nullable_batch};
use ::records::{Diagnostic, GapRecord};
use jiff::Timestamp;
use pipeline::assess::backtest;
use pipeline::assess::trends::{self, StoreAssessment, UnitSelection};
use pipeline::findings::work_list::{self, WorkSelection};
use pipeline::fleet::external_estimates;
use pipeline::inspect::store_diff::compare_stores;
use pipeline::report::{compose, data, publish};
use pyo3::prelude::*;
use store::Query;

use crate::VERSION;
use crate::arrow_capsule;
use crate::config::Config;
use crate::error::{config_error, to_run_exception};
use crate::functions::{chunks, instant};
use crate::table::Table;

fn table<R: Row>(py: Python<'_>, rows: Result<Vec<R>, pipeline::Error>) -> PyResult<Table> {
    let batch = rows.and_then(|rows| Ok(to_nullable_batch(&rows)?));
    Ok(Table::of(batch.map_err(|error| to_run_exception(py, error))?))
}

fn selection(py: Python<'_>, units: [Option<String>; 3], as_of: Option<&str>) -> PyResult<UnitSelection> {
    let [tail_number, serial_number, part_number] = units;
    let as_of_utc = instant(py, as_of)?;
    Ok(UnitSelection { tail_number, serial_number, part_number, as_of_utc })
}

/// What `trend` shows of the followed quantities.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Followed {
    Quantities,
    Changes,
}

fn followed(
    py: Python<'_>,
    config: &Config,
    units: [Option<String>; 3],
    as_of: Option<&str>,
    what: Followed,
) -> PyResult<Table> {
    let (installations, ask) = (config.installations(py)?, selection(py, units, as_of)?);
    let config = &config.inner;
    let found = py.detach(|| {
        trends::assess_store(config, installations, &pipeline::open_store(config, installations)?, &ask)
    });
    let StoreAssessment { followed, .. } = found.map_err(|error| to_run_exception(py, error))?;
    match what {
        Followed::Quantities => table(py, Ok(followed.rows)),
        Followed::Changes => table(py, Ok(followed.changes)),
    }
}

/// Every followed quantity of the selected units.
#[pyfunction]
pub(crate) fn quantities(
    py: Python<'_>,
    config: &Config,
    units: [Option<String>; 3],
    as_of: Option<&str>,
) -> PyResult<Table> {
    followed(py, config, units, as_of, Followed::Quantities)
}

/// What changed on units, tails and parts.
#[pyfunction]
pub(crate) fn changes(
    py: Python<'_>,
    config: &Config,
    units: [Option<String>; 3],
    as_of: Option<&str>,
) -> PyResult<Table> {
    followed(py, config, units, as_of, Followed::Changes)
}

/// Past forecasts against later measurements.
#[pyfunction]
pub(crate) fn backtest_forecasts(
    py: Python<'_>,
    estimates: Option<&Bound<'_, PyAny>>,
    config: &Config,
) -> PyResult<Table> {
    let installations = config.installations(py)?;
    let batches = estimates.map(arrow_capsule::batches).transpose()?;
    let config = &config.inner;
    let rows = py.detach(|| {
        let histories = match batches {
            Some(batches) => external_estimates::from_batches(&chunks(batches))?,
            None => trends::load_histories(&pipeline::open_store(config, installations)?)?,
        };
        backtest::of_histories(config, installations, histories)
    });
    table(py, rows)
}

/// Actuator-flights that differ between two stores.
#[pyfunction]
pub(crate) fn diff(py: Python<'_>, before: PathBuf, after: PathBuf, min_change_m: f64) -> PyResult<Table> {
    table(py, py.detach(|| compare_stores(&before, &after, min_change_m)).map(|found| found.rows))
}

/// One stored record, its settings, and whether it is reproduced: as JSON, with the record as a table.
#[pyfunction]
pub(crate) fn explain(
    py: Python<'_>,
    config: &Config,
    flight: String,
    position: String,
    tail: Option<String>,
    departures: [Option<String>; 2],
) -> PyResult<(String, Table)> {
    let installations = config.installations(py)?;
    let config = &config.inner;
    let [since_utc, until_utc] = departures.each_ref().map(|text| instant(py, text.as_deref()));
    let query = Query {
        flight_id: Some(flight),
        position: Some(position),
        tail_number: tail,
        since_utc: since_utc?,
        until_utc: until_utc?,
        ..Query::default()
    };
    let found = py
        .detach(|| {
            pipeline::inspect::explain::explain(
                config,
                installations,
                &pipeline::open_store(config, installations)?,
                &query,
            )
        })
        .map_err(|error| to_run_exception(py, error))?;
    let facts = found.to_json(config).to_string();
    Ok((facts, table(py, Ok::<Vec<GapRecord>, _>(vec![found.record]))?))
}

/// Writes the report; the number of files and of bytes.
#[pyfunction]
pub(crate) fn report(
    py: Python<'_>,
    config: &Config,
    output: PathBuf,
    units: [Option<String>; 3],
    as_of: Option<&str>,
    with_data: bool,
) -> PyResult<(u64, u64)> {
    let (installations, ask) = (config.installations(py)?, selection(py, units, as_of)?);
    let config = &config.inner;
    let composed = py
        .detach(|| {
            let store = pipeline::open_store(config, installations)?;
            let program = format!("Freeplay {VERSION}");
            compose::compose(config, installations, &store, &ask, Timestamp::now(), &program)
        })
        .map_err(|error| to_run_exception(py, error))?;
    if composed.units.is_empty() {
        let hint = "list all units of the store with `freeplay trend`; fill it with `freeplay run`";
        let what = "no selected unit has flown";
        return Err(config_error(py, Diagnostic::new("nothing_to_report", what).hint(hint)));
    }
    let written = py.detach(|| {
        let files = if with_data { data::tables(&composed)? } else { Vec::new() };
        publish::write(&composed, files, &output, &|_| {})
    });
    let written = written.map_err(|error| to_run_exception(py, error))?;
    Ok((written.files, written.bytes))
}

/// Selected work requests, by the date until when.
#[pyfunction]
pub(crate) fn work(
    py: Python<'_>,
    config: &Config,
    status: Option<String>,
    units: [Option<String>; 3],
) -> PyResult<Table> {
    let selection = WorkSelection { status, units: selection(py, units, None)? };
    let config = &config.inner;
    let found = py.detach(|| Ok(work_list::work_list(config, &selection)?.0));
    table(py, found)
}

/// Channels of logs, with errors of logs in `Table.errors`; nothing is estimated or written.
#[pyfunction]
pub(crate) fn check(
    py: Python<'_>,
    logs: Option<Vec<PathBuf>>,
    config: &Config,
    limit: usize,
) -> PyResult<Table> {
    let installations = Arc::new(config.installations(py)?.clone());
    let config = Arc::new(config.inner.clone());
    let seen = py.detach(|| {
        let (logs, faults) = match logs {
            Some(logs) => (pipeline::logs::discover::named_logs(&config, &logs)?, Vec::new()),
            None => {
                let found = pipeline::logs::discover::discover(&config)?;
                let faults = found.faulty.into_values().map(|(_, diagnostic)| diagnostic).collect();
                let logs = found.logs.into_iter().map(|(name, files)| (files, name)).take(limit);
                (logs.collect(), faults)
            }
        };
        Ok(pipeline::inspect::check::check_logs(&config, &installations, logs, faults))
    });
    let seen = seen.map_err(|error| to_run_exception(py, error))?;
    let batch = to_nullable_batch(&seen.channels()).map_err(|e| to_run_exception(py, e.into()))?;
    let diagnostics = seen.diagnostics.into_iter().chain(seen.mapping_faults).collect();
    Ok(Table::with_errors(batch, diagnostics))
}
