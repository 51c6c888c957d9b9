//! Functions that read a store: records, trends, backtest, comparison, explanation, report and work requests.
#![expect(clippy::needless_pass_by_value, reason = "Python hands values over")]

use std::path::PathBuf;

use ::records::Diagnostic;
use ::records::row_schema::to_nullable_batch;
use arrow::array::RecordBatch;
use ingest::tables::TableBatch;
use jiff::Timestamp;
use pipeline::assess::backtest;
use pipeline::assess::trends::{self, UnitSelection};
use pipeline::findings::work_list::{self, WorkSelection};
use pipeline::fleet::external_estimates;
use pipeline::inspect::store_diff::compare_stores;
use pipeline::open_store;
use pipeline::report::{compose, data, publish};
use pyo3::prelude::*;
use store::Query;

use crate::arrow_capsule;
use crate::config::{Config, VERSION};
use crate::error::{config_error, to_run_exception};
use crate::table::Table;

fn instant(py: Python<'_>, text: Option<&str>) -> PyResult<Option<Timestamp>> {
    let read = text.map(ingest::tables::utc).transpose();
    read.map_err(|what| config_error(py, Diagnostic::new("bad_time", what)))
}

fn selection(py: Python<'_>, units: [Option<String>; 3], as_of: Option<&str>) -> PyResult<UnitSelection> {
    let [tail_number, serial_number, part_number] = units;
    let as_of_utc = instant(py, as_of)?;
    Ok(UnitSelection { tail_number, serial_number, part_number, as_of_utc })
}

/// The histories of a table from memory, its rows counted through.
fn external(
    batches: Vec<RecordBatch>,
    config: &job::config::Config,
) -> Result<pipeline::fleet::histories::Histories, pipeline::Error> {
    let mut before = 0;
    let chunk = |batch: RecordBatch| {
        let rows = batch.num_rows();
        before += rows;
        TableBatch::new("estimates".as_ref(), batch, before - rows)
    };
    let chunks: Vec<TableBatch> = batches.into_iter().map(chunk).collect();
    external_estimates::from_batches(&chunks, &config.parts_by_largest_gap())
}

/// Stored records that fit.
#[pyfunction]
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
    Ok(Table::of(
        config.with(py, |config, installations| Ok(open_store(config, installations)?.scan(&query)?))?,
    ))
}

/// Trends of the store, or of an external estimates table; one row for each unit, or for each query.
#[pyfunction]
pub(crate) fn trend(
    py: Python<'_>,
    estimates: Option<&Bound<'_, PyAny>>,
    config: &Config,
    units: [Option<String>; 3],
    as_of: Option<&str>,
    queries: Option<&Bound<'_, PyAny>>,
) -> PyResult<Table> {
    let ask = selection(py, units, as_of)?;
    let [estimates, queries] =
        [estimates, queries].map(|table| table.map(arrow_capsule::batches).transpose());
    let (estimates, queries) = (estimates?, queries?);
    let found = config.with(py, |config, installations| {
        let histories = estimates.map(|batches| external(batches, config)).transpose()?;
        let queries = queries.map(|rows| TableBatch::as_text("queries".as_ref(), &rows)).transpose()?;
        let queries = queries.as_ref().map(external_estimates::queries).transpose()?;
        Ok(trends::assess(config, installations, histories, queries.as_deref(), &ask)?.now)
    })?;
    Table::of_rows(py, &found)
}

/// What `trend` shows besides the gap: every followed quantity of the selected units, or what changed on units, tails and
/// parts.
#[pyfunction]
pub(crate) fn followed(
    py: Python<'_>,
    config: &Config,
    units: [Option<String>; 3],
    as_of: Option<&str>,
    only_changes: bool,
) -> PyResult<Table> {
    let ask = selection(py, units, as_of)?;
    let batch = config.with(py, |config, installations| {
        let store = open_store(config, installations)?;
        let followed = trends::assess_store(config, installations, &store, &ask)?.followed;
        let batch = if only_changes {
            to_nullable_batch(&followed.changes)
        } else {
            to_nullable_batch(&followed.rows)
        };
        Ok(batch?)
    });
    Ok(Table::of(batch?))
}

/// Past forecasts against later measurements.
#[pyfunction]
pub(crate) fn backtest_forecasts(
    py: Python<'_>,
    estimates: Option<&Bound<'_, PyAny>>,
    config: &Config,
) -> PyResult<Table> {
    let batches = estimates.map(arrow_capsule::batches).transpose()?;
    let rows = config.with(py, |config, installations| {
        let histories = match batches {
            Some(batches) => external(batches, config)?,
            None => {
                trends::load_histories(&open_store(config, installations)?, &config.parts_by_largest_gap())?
            }
        };
        backtest::of_histories(config, installations, histories)
    })?;
    Table::of_rows(py, &rows)
}

/// Actuator-flights that differ between two stores.
#[pyfunction]
pub(crate) fn diff(py: Python<'_>, before: PathBuf, after: PathBuf, min_change_m: f64) -> PyResult<Table> {
    let found = py.detach(|| compare_stores(&before, &after, min_change_m));
    Table::of_rows(py, &found.map_err(|error| to_run_exception(py, error))?.rows)
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
    let [since_utc, until_utc] = departures.each_ref().map(|text| instant(py, text.as_deref()));
    let query = Query {
        flight_id: Some(flight),
        position: Some(position),
        tail_number: tail,
        since_utc: since_utc?,
        until_utc: until_utc?,
        ..Query::default()
    };
    let (facts, record) = config.with(py, |config, installations| {
        let store = open_store(config, installations)?;
        let found = pipeline::inspect::explain::explain(config, installations, &store, &query)?;
        Ok((found.to_json(config).to_string(), found.record))
    })?;
    Ok((facts, Table::of_rows(py, &[record])?))
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
    let ask = selection(py, units, as_of)?;
    config.with(py, |config, installations| {
        let store = open_store(config, installations)?;
        let program = format!("Freeplay {VERSION}");
        let composed = compose::compose(config, installations, &store, &ask, Timestamp::now(), &program)?;
        if composed.units.is_empty() {
            let hint = "list all units of the store with `freeplay trend --all`; fill it with `freeplay run`";
            let fault = Diagnostic::new("nothing_to_report", "no selected unit has flown").hint(hint);
            return Err(pipeline::Error::Refused(vec![fault]));
        }
        let files = if with_data { data::tables(&composed)? } else { Vec::new() };
        let written = publish::write(&composed, files, &output, &|_| {})?;
        Ok((written.files, written.bytes))
    })
}

/// Selected work requests, by due date.
#[pyfunction]
pub(crate) fn work(
    py: Python<'_>,
    config: &Config,
    status: Option<String>,
    units: [Option<String>; 3],
) -> PyResult<Table> {
    let selection = WorkSelection { status, units: selection(py, units, None)? };
    let found = py.detach(|| work_list::work_list(&config.inner, &selection));
    Table::of_rows(py, &found.map_err(|error| to_run_exception(py, error))?.0)
}
