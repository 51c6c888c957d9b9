//! Exit codes and the failures that lead to them.

use std::process::ExitCode;

use records::Diagnostic;

/// Exit codes; schedulers rely on them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Code {
    /// Success; rejected flights count as success.
    Success = 0,
    /// Finished, but some logs or a requested check failed.
    LogsInError = 1,
    /// Wrong usage or configuration: nothing was processed.
    Usage = 2,
    /// The run itself failed; what was stored before is intact.
    RunFailed = 3,
    /// With `--fail-on`: a unit is in that state or worse.
    StateReached = 4,
    /// The run is complete, but an alert was not sent, or work requests and alerts could not be stored.
    AlertsNotSent = 5,
    /// Interrupted: finished flights are stored; the next run processes the others.
    Interrupted = 130,
}

impl From<Code> for ExitCode {
    fn from(code: Code) -> Self {
        Self::from(code as u8)
    }
}

#[derive(Debug)]
pub(crate) enum Failure {
    /// Configuration, tables or arguments: code 2.
    Refused(Vec<Diagnostic>),
    /// Store or disk: code 3.
    Failed(Box<Diagnostic>),
    /// The reader closed the pipe; there is nothing to report.
    PipeClosed,
}

impl Failure {
    pub(crate) fn usage(code: &str, what: impl std::fmt::Display, hint: &str) -> Self {
        Self::Refused(vec![Diagnostic::new(code, what).hint(hint)])
    }

    pub(crate) fn failed(diagnostic: Diagnostic) -> Self {
        Self::Failed(Box::new(diagnostic))
    }

    pub(crate) fn code(&self) -> Code {
        match self {
            Self::Refused(_) => Code::Usage,
            Self::Failed(_) => Code::RunFailed,
            Self::PipeClosed => Code::Success,
        }
    }
}

impl From<pipeline::Error> for Failure {
    fn from(error: pipeline::Error) -> Self {
        match error {
            pipeline::Error::Refused(diagnostics) => Self::Refused(diagnostics),
            pipeline::Error::Store(error) => error.into(),
            pipeline::Error::Objects(error) => {
                Self::failed(Diagnostic::new(error.code(), &error).hint(error.remedy()))
            }
            pipeline::Error::Pages { .. } => Self::failed(Diagnostic::new("output_failed", error).hint(
                "the report that was there is unchanged; free space, or name a folder that can be written",
            )),
            other => Self::failed(Diagnostic::new("run_failed", other)),
        }
    }
}

impl From<store::Error> for Failure {
    fn from(error: store::Error) -> Self {
        Self::failed(error.diagnostic())
    }
}

impl From<std::io::Error> for Failure {
    fn from(error: std::io::Error) -> Self {
        if error.kind() == std::io::ErrorKind::BrokenPipe {
            return Self::PipeClosed;
        }
        Self::failed(Diagnostic::new("output_failed", format!("the output cannot be written: {error}")))
    }
}
