//! Diagnostics as exceptions: the same codes, sentences and remedies as on the command line.

use pyo3::prelude::*;
use records::Diagnostic;

/// Which exception, by what the command's exit code would be: `LogError` and so on.
#[derive(Debug, Clone, Copy)]
pub(crate) enum ExceptionClass {
    /// Some logs failed: 1.
    Log,
    /// Configuration, tables or arguments: 2.
    Config,
    /// The store or the run itself: 3.
    Run,
}

/// An exception of `freeplay_ema._errors` that carries diagnostics.
pub(crate) fn to_exception(py: Python<'_>, class: ExceptionClass, diagnostics: &[Diagnostic]) -> PyErr {
    let make = || -> PyResult<PyErr> {
        let texts: Vec<String> = diagnostics.iter().map(ToString::to_string).collect();
        let facts = serde_json::to_string(diagnostics).unwrap_or_default();
        let class = py.import("freeplay_ema._errors")?.getattr(format!("{class:?}Error"))?;
        Ok(PyErr::from_value(class.call1((texts.join("\n"), facts))?))
    };
    make().unwrap_or_else(|error| error)
}

/// Diagnostics about configuration, tables or arguments.
pub(crate) fn config_error(py: Python<'_>, diagnostic: Diagnostic) -> PyErr {
    to_exception(py, ExceptionClass::Config, &[diagnostic])
}

/// Converts a pipeline error to the exception that matches the command's exit code.
pub(crate) fn to_run_exception(py: Python<'_>, error: pipeline::Error) -> PyErr {
    match error {
        pipeline::Error::Refused(diagnostics) => to_exception(py, ExceptionClass::Config, &diagnostics),
        pipeline::Error::Store(error) => to_exception(py, ExceptionClass::Run, &[error.diagnostic()]),
        other => to_exception(py, ExceptionClass::Run, &[Diagnostic::new("run_failed", other)]),
    }
}
