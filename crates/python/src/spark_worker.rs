//! Entry points for a cluster engine such as Spark: process one log on a worker, and run with the engine's workers.
#![expect(clippy::needless_pass_by_value, reason = "Python hands values over")]

use pipeline::Request;
use pipeline::run::distributed::{self, Task};
use pyo3::prelude::*;
use records::Diagnostic;

use crate::config::{Config, VERSION};
use crate::error::{ExceptionClass, to_exception};
use crate::functions::run_summary;

/// Processes one log of a distributed run; its result, or its error, as JSON.
#[pyfunction]
pub(crate) fn process_task(py: Python<'_>, config: &Config, task: &str) -> PyResult<String> {
    let task: Task = serde_json::from_str(task)
        .map_err(|e| to_exception(py, ExceptionClass::Run, &[Diagnostic::new("run_failed", e)]))?;
    config.with(py, |config, installations| distributed::process_task(config, installations, &task, VERSION))
}

/// Run whose logs are processed by `engine`, which receives batches of tasks and returns their results; the run's
/// summary as JSON.
#[pyfunction]
#[pyo3(signature = (config, engine, at_a_time, redo, retry, wait_s))]
pub(crate) fn run_distributed(
    py: Python<'_>,
    config: &Config,
    engine: Py<PyAny>,
    at_a_time: usize,
    redo: bool,
    retry: bool,
    wait_s: Option<f64>,
) -> PyResult<String> {
    let request = Request { redo, retry, ..Request::default() };
    let mut thrown: Option<PyErr> = None;
    let mut ask = |tasks: &[Task]| {
        let asked: PyResult<Vec<String>> = Python::attach(|py| {
            let json = |task: &Task| serde_json::to_string(task).unwrap_or_default();
            let tasks: Vec<String> = tasks.iter().map(json).collect();
            engine.call1(py, (tasks,))?.extract(py)
        });
        asked.map_err(|error| {
            let what = error.to_string();
            thrown = Some(error);
            what
        })
    };
    let summary = run_summary(py, wait_s, |context| {
        distributed::run(&config.inner, &request, context, at_a_time, &mut ask)
    });
    // The traceback must show the engine's own exception.
    thrown.map_or(summary, Err)
}
