//! `freeplay`: the backlash gap of flight-control actuators, from the logs a fleet records anyway.
//!
//! This crate parses, calls and answers. Only it prints, exits and reads the environment: answers go
//! to stdout, progress and diagnostics to stderr.

mod args;
mod commands;
mod exit;
mod journal;
mod progress;
#[cfg(test)]
mod reference;
mod rows;
mod spark;
mod table;
mod talk;

use std::process::ExitCode;

use clap::Parser;

use args::{Args, Command};
use exit::{Code, Failure};
use records::Diagnostic;
use talk::Talk;

fn main() -> ExitCode {
    let args = match Args::try_parse() {
        Ok(args) => args,
        // Help and version are answers; anything else is a usage error, and clap says which.
        Err(error) => {
            let _ = error.print();
            return if error.use_stderr() { Code::Usage.into() } else { Code::Well.into() };
        }
    };
    ignore_file_size_signal();
    let talk = Talk::new(&args.global);
    // A panic while reading a log becomes a diagnostic about that log; its backtrace would help nobody.
    std::panic::set_hook(Box::new(|_| {}));
    let ended = std::panic::catch_unwind(|| dispatch(&args, &talk)).unwrap_or_else(|_| {
        let diagnostic = Diagnostic::new("panic", "the program failed in a way that should not happen");
        Err(Failure::failed(diagnostic.hint("what was stored before is intact; please report the command")))
    });
    match ended {
        Ok(code) => code.into(),
        Err(failure) => talk.fail(&failure).into(),
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

fn dispatch(args: &Args, talk: &Talk) -> Result<Code, Failure> {
    match &args.command {
        Command::Init(a) => commands::init::init(a, talk),
        Command::Check(a) => commands::check::check(a, &args.global, talk),
        Command::Run(a) => commands::run::run(a, &args.global, talk),
        Command::Explain(a) => commands::explain::explain(a, &args.global, talk),
        Command::Diff(a) => commands::diff::diff(a, talk),
        Command::Estimate(a) => commands::estimate::estimate(a, &args.global, talk),
        Command::Normalize(a) => commands::normalize::normalize(a, &args.global, talk),
        Command::Query(a) => commands::query::query(a, &args.global, talk),
        Command::Trend(a) => commands::trend::trend(a, &args.global, talk),
        Command::Backtest(a) => commands::backtest::backtest(a, &args.global, talk),
        Command::Report(a) => commands::report::report(a, &args.global, talk),
        Command::Simulate(a) => commands::simulate::simulate(a, talk),
        Command::Store(a) => commands::store::store(a, &args.global, talk),
        Command::Completions(a) => commands::shell::completions(a, talk),
        Command::Man => commands::shell::man(talk),
    }
}
