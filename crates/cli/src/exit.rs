//! How a command ends: the exit codes that schedulers are written against, and why one was chosen.

use std::process::ExitCode;

use records::Diagnostic;

/// The codes of the contract.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Code {
    /// All well; refused flights are all well.
    Success = 0,
    /// Finished, but some logs were in error, or a check that was asked for failed.
    LogsInError = 1,
    /// Usage or configuration is wrong: nothing was run.
    Usage = 2,
    /// The run itself failed; what was stored before is intact.
    RunFailed = 3,
    /// With `--fail-on`: an actuator is at or past that state.
    StateReached = 4,
    /// Interrupted: finished flights are stored, the rest will run next time.
    Interrupted = 130,
}

impl From<Code> for ExitCode {
    fn from(code: Code) -> Self {
        Self::from(code as u8)
    }
}

/// WorkReason a command could not answer.
#[derive(Debug)]
pub(crate) enum Failure {
    /// Configuration, tables or arguments: code 2.
    Refused(Vec<Diagnostic>),
    /// Store or disk: code 3.
    Failed(Box<Diagnostic>),
    /// The reader of our answer closed its pipe; nobody is left to tell.
    PipeClosed,
}

impl Failure {
    /// A wrong argument.
    pub(crate) fn usage(code: &str, what: impl std::fmt::Display, hint: &str) -> Self {
        Self::Refused(vec![Diagnostic::new(code, what).hint(hint)])
    }

    /// Store or disk.
    pub(crate) fn failed(diagnostic: Diagnostic) -> Self {
        Self::Failed(Box::new(diagnostic))
    }

    /// Its exit code.
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
        Self::failed(Diagnostic::new("output_failed", format!("the answer cannot be written: {error}")))
    }
}
