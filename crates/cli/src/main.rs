//! `freeplay`: the backlash gap of flight-control actuators, from the logs a fleet records anyway.
//!
//! This crate parses, calls and answers. Only it prints, exits and reads the environment: answers go
//! to stdout, progress and diagnostics to stderr.

mod args;
mod commands;
#[cfg(test)]
mod commands_doc;
mod exit;
mod json_log;
mod output;
mod progress;
mod row_output;
mod sparkline;
mod table;

use std::process::ExitCode;

use clap::Parser;

use args::{Args, Command};
use exit::{Code, Failure};
use output::Output;
use records::Diagnostic;

fn main() -> ExitCode {
    let args = match Args::try_parse() {
        Ok(args) => args,
        // Help and version are answers; anything else is a usage error, and clap says which.
        Err(error) => {
            let _ = error.print();
            return if error.use_stderr() { Code::Usage.into() } else { Code::Success.into() };
        }
    };
    ignore_file_size_signal();
    let output = Output::new(&args.global);
    // A panic while reading a log becomes a diagnostic about that log; its backtrace would help nobody.
    std::panic::set_hook(Box::new(|_| {}));
    let ended = std::panic::catch_unwind(|| dispatch(&args, &output)).unwrap_or_else(|_| {
        let diagnostic = Diagnostic::new("panic", "the program failed in a way that should not happen");
        Err(Failure::failed(diagnostic.hint("what was stored before is intact; please report the command")))
    });
    match ended {
        Ok(code) => code.into(),
        Err(failure) => output.failure(&failure).into(),
    }
}

/// A file that outgrows its limit should fail to be written and be complained of, not end the process
/// without a word, as the signal does by default.
fn ignore_file_size_signal() {
    #[cfg(unix)]
    {
        let heard = std::sync::Arc::new(std::sync::atomic::AtomicBool::new(false));
        // Where it cannot be registered things stay as they are.
        let _ = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, heard);
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
        Command::Completions(a) => commands::setup::shell::completions(a, output),
        Command::Man => commands::setup::shell::man(output),
    }
}
