//! `freeplay`: estimates actuator backlash from flight logs and forecasts when each unit reaches its limit.
//!
//! This crate parses arguments, calls the libraries and formats their results. Only it prints, exits and reads
//! the environment: results go to stdout, progress and diagnostics to stderr.

mod args;
mod commands;
#[cfg(test)]
mod commands_doc;
mod completion;
mod exit;
mod json_log;
mod output;
mod progress;
mod row_output;
mod sparkline;
mod table;

use std::process::ExitCode;

use clap::{CommandFactory, Parser};
use clap_complete::CompleteEnv;

use args::{Args, Command};
pub(crate) use exit::{Code, Failure};
pub(crate) use output::Output;
use records::Diagnostic;

fn main() -> ExitCode {
    // The shell asks for completions with a variable in the environment; nothing else of the program runs then.
    CompleteEnv::with_factory(Args::command).complete();
    let args = match Args::try_parse() {
        Ok(args) => args,
        // Help and version go to stdout with code 0; other parser errors are usage errors.
        Err(error) => {
            let _ = error.print();
            return if error.use_stderr() { Code::Usage.into() } else { Code::Success.into() };
        }
    };
    ignore_file_size_signal();
    let output = Output::new(&args.global);
    // A panic becomes a diagnostic with its message and location; `RUST_BACKTRACE=1` prints the backtrace too.
    job::panic::install_hook();
    let ended = std::panic::catch_unwind(|| dispatch(&args, &output)).unwrap_or_else(|caught| {
        let message = format!("internal error: {}", job::panic::describe(caught.as_ref()));
        let hint = "stored results are intact; please report this message with the command";
        Err(Failure::failed(Diagnostic::new("panic", message).hint(hint)))
    });
    match ended {
        Ok(code) => code.into(),
        Err(failure) => output.failure(&failure).into(),
    }
}

/// Ignores the file-size signal: a write beyond the limit must fail with an error instead of killing the process.
fn ignore_file_size_signal() {
    #[cfg(unix)]
    {
        let received = std::sync::Arc::new(std::sync::atomic::AtomicBool::new(false));
        // Without registration, the default action of the signal stays.
        let _ = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, received);
    }
}

fn dispatch(args: &Args, output: &Output) -> Result<Code, Failure> {
    match &args.command {
        Command::Init(a) => commands::setup::init::init(a, output),
        Command::Check(a) => commands::logs::check::check(a, &args.global, output),
        Command::Run(a) => commands::run::run(a, &args.global, output),
        Command::Explain(a) => commands::results::explain::explain(a, &args.global, output),
        Command::Diff(a) => commands::results::diff::diff(a, output),
        Command::Estimate(a) => commands::logs::estimate::estimate(a, &args.global, output),
        Command::Normalize(a) => commands::logs::normalize::normalize(a, &args.global, output),
        Command::Query(a) => commands::results::query::query(a, &args.global, output),
        Command::Trend(a) => commands::results::trend::trend(a, &args.global, output),
        Command::Backtest(a) => commands::results::backtest::backtest(a, &args.global, output),
        Command::Report(a) => commands::results::report::report(a, &args.global, output),
        Command::Simulate(a) => commands::setup::simulate::simulate(a, output),
        Command::Store(a) => commands::store::store(a, &args.global, output),
        Command::Work(a) => commands::work::work(a, &args.global, output),
        Command::Completions(a) => commands::setup::shell::completions(a, output),
        Command::Man => commands::setup::shell::man(output),
    }
}
