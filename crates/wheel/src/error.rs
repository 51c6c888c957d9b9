//! Complaints as exceptions: the same codes, sentences and remedies as on the command line.

use fleet::Complaint;
use pyo3::prelude::*;

/// Which exception, by what the command's exit code would be.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Class {
    /// Some logs are in error: 1.
    Log,
    /// Configuration, tables or arguments: 2.
    Config,
    /// The store or the run itself: 3.
    Run,
}

impl Class {
    fn name(self) -> &'static str {
        match self {
            Self::Log => "LogError",
            Self::Config => "ConfigError",
            Self::Run => "RunError",
        }
    }
}

/// An exception of `freeplay._errors` that carries complaints.
pub(crate) fn raised(py: Python<'_>, class: Class, complaints: &[Complaint]) -> PyErr {
    let make = || -> PyResult<PyErr> {
        let texts: Vec<String> = complaints.iter().map(ToString::to_string).collect();
        let facts = serde_json::to_string(complaints).unwrap_or_default();
        let class = py.import("freeplay._errors")?.getattr(class.name())?;
        Ok(PyErr::from_value(class.call1((texts.join("\n"), facts))?))
    };
    make().unwrap_or_else(|error| error)
}

/// Complaints about configuration, tables or arguments.
pub(crate) fn refused(py: Python<'_>, complaint: Complaint) -> PyErr {
    raised(py, Class::Config, &[complaint])
}

/// What ended a run or a question, as the command would tell it.
pub(crate) fn failed(py: Python<'_>, error: pipeline::Error) -> PyErr {
    match error {
        pipeline::Error::Refused(complaints) => raised(py, Class::Config, &complaints),
        pipeline::Error::Store(error) => raised(py, Class::Run, &[error.complaint()]),
        other => raised(py, Class::Run, &[Complaint::new("run_failed", other)]),
    }
}
