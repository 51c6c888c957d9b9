//! Time limit for the work on one log outside a run, such as in `estimate` and `check`.

use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

use job::Config;
use job::flight_log::catch_panic;
use records::Diagnostic;

/// Does the work on one log in a thread of its own and waits for it at most `run.log_timeout_s`.
///
/// No thread can be ended from outside: the thread of a log that takes longer ends with the process.
///
/// # Errors
/// The error of the work, `panic` when it panics, `log_timeout` when it takes too long.
pub(crate) fn within_time_limit<T: Send + 'static>(
    display_name: &str,
    config: &Config,
    work: impl FnOnce() -> Result<T, Diagnostic> + Send + 'static,
) -> Result<T, Diagnostic> {
    let limit_s = config.document.run.log_timeout_s;
    let (sender, receiver) = channel();
    let name = display_name.to_owned();
    let started = std::thread::Builder::new().spawn(move || {
        // The receiver is gone after the limit.
        let _ = sender.send(catch_panic(&name, work));
    });
    if let Err(e) = started {
        let what = format!("a thread could not be started: {e}");
        return Err(Diagnostic::new("run_failed", what).in_file(display_name));
    }
    let limit = Duration::try_from_secs_f64(limit_s).unwrap_or(Duration::MAX);
    receiver.recv_timeout(limit).unwrap_or_else(|why| match why {
        RecvTimeoutError::Timeout => Err(log_timeout(display_name, limit_s)),
        RecvTimeoutError::Disconnected => {
            Err(Diagnostic::new("panic", "the thread of this log ended").in_file(display_name))
        }
    })
}

pub(crate) fn log_timeout(display_name: &str, limit_s: f64) -> Diagnostic {
    let what = format!("the log was not finished within {limit_s} s");
    Diagnostic::new("log_timeout", what).in_file(display_name).hint(
        "check its disk or share and its size, or raise `run.log_timeout_s`; the next run tries it again",
    )
}
