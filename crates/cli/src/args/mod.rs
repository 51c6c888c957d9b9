//! Command-line arguments; the doc comments are the help texts.

mod logs;
mod results;
mod run;
mod shared;
mod store;
mod work;

use std::path::PathBuf;

use clap::{ArgAction, Args as ClapArgs, ColorChoice, Parser, Subcommand, ValueEnum};

pub(crate) use logs::{CheckArgs, EstimateArgs, InitArgs, NormalizeArgs, SimulateArgs};
pub(crate) use results::{
    BacktestArgs, DiffArgs, ExplainArgs, ExternalEstimatesArgs, QueryArgs, ReportArgs, TrendArgs,
};
pub(crate) use run::RunArgs;
pub(crate) use shared::{DepartureArgs, Format, RowFormatArgs, UnitFilterArgs};
pub(crate) use store::{ForgetArgs, StoreArgs, StoreCommand};
pub(crate) use work::{WorkArgs, WorkCommand, WorkDecisionArgs, WorkListArgs};

const AFTER: &str = "\
First steps:
  freeplay init --sample   set up a simulated fleet here and try everything on it
  freeplay init            write a commented pipeline.toml here
  freeplay check           see what your logs offer, before anything is computed
  freeplay run             estimate every new flight, store it, update trends
  freeplay query tail N412FP

Exit codes: 0 success, 1 some logs failed, 2 usage or configuration, 3 the run failed,
4 a unit met --fail-on, 5 an alert was not sent, 130 interrupted.";

/// What `--version` prints after the name; `-V` prints the first line only.
const LONG_VERSION: &str = concat!(
    env!("CARGO_PKG_VERSION"),
    "\ncommit: ",
    env!("FREEPLAY_COMMIT"),
    "\nbuild: ",
    env!("FREEPLAY_BUILD"),
    "\nfeatures: ",
    env!("FREEPLAY_FEATURES")
);

/// Estimate actuator backlash (free play) from flight logs and forecast when each unit reaches its limit.
#[derive(Debug, Parser)]
#[command(
    name = "freeplay",
    version,
    long_version = LONG_VERSION,
    after_help = AFTER,
    infer_subcommands = false,
    propagate_version = true
)]
pub(crate) struct Args {
    #[command(flatten)]
    pub global: Global,
    #[command(subcommand)]
    pub command: Command,
}

/// Default configuration file.
pub(crate) const CONFIG: &str = "pipeline.toml";

/// Options common to all commands.
#[derive(Debug, ClapArgs)]
#[command(next_help_heading = "Global options")]
pub(crate) struct Global {
    /// Configuration file; repeat to override keys of earlier files.
    #[arg(
        long,
        global = true,
        env = "FREEPLAY_CONFIG",
        default_value = CONFIG,
        value_name = "FILE"
    )]
    pub config: Vec<PathBuf>,
    /// Print only results and errors.
    #[arg(short, long, global = true)]
    pub quiet: bool,
    /// Show every diagnostic and every checked log in full.
    #[arg(short, long, global = true, action = ArgAction::Count)]
    pub verbose: u8,
    /// Disable progress output.
    #[arg(long, global = true)]
    pub no_progress: bool,
    /// Format of messages on stderr: text or JSON lines.
    #[arg(long, global = true, value_enum, default_value_t = LogFormat::Text, value_name = "FORM")]
    pub log_format: LogFormat,
    /// When to use colour; `auto`: on a terminal, unless `NO_COLOR` is set.
    #[arg(long, global = true, value_enum, default_value_t = ColorChoice::Auto, value_name = "WHEN")]
    pub color: ColorChoice,
}

/// Format of messages on stderr.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum LogFormat {
    /// Human-readable text.
    Text,
    /// One JSON object per line.
    Json,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Write a commented pipeline.toml and an example installations.csv; nothing is overwritten
    #[command(
        after_help = "Examples:\n  freeplay init fleet-a\n  freeplay init --from /data/logs\n  freeplay init --sample demo && cd demo && freeplay run"
    )]
    Init(InitArgs),
    /// Check how logs are mapped: columns, units, signs and rates per channel; no gap is computed
    #[command(after_help = "Example:\n  freeplay check logs/N412FP/20261119_0413.parquet")]
    Check(CheckArgs),
    /// Process new and changed logs, then update trends (nightly job)
    #[command(
        after_help = "Examples:\n  freeplay run\n  freeplay run --since 2026-11-01 --tail N412FP --redo\n  freeplay run --fail-on act && echo \"no unit at its limit\""
    )]
    Run(RunArgs),
    /// Estimate the given logs without storing the results
    #[command(
        after_help = "Examples:\n  freeplay estimate logs/N412FP/*.parquet\n  freeplay estimate bench.parquet --part EMA-27-1040 --trace trace.parquet\n  freeplay estimate bench.parquet --part EMA-27-1040 --plot look.html"
    )]
    Estimate(EstimateArgs),
    /// Export normalized channels (SI units, common time base), one file per actuator and flight
    #[command(
        after_help = "Examples:\n  freeplay normalize logs/N412FP/*.parquet --output normalized\n  freeplay normalize --output for-spark --encoding compatible"
    )]
    Normalize(NormalizeArgs),
    /// List stored estimates by tail, serial, flight or position
    #[command(
        after_help = "Examples:\n  freeplay query tail N412FP --last 20\n  freeplay query serial 00317 --since 2026-01-01 --json"
    )]
    Query(QueryArgs),
    /// Show current gap, wear rate, time to limit and state of each unit
    #[command(
        after_help = "Examples:\n  freeplay trend --tail N412FP\n  freeplay trend --estimates history.csv --queries dates.csv --format csv"
    )]
    Trend(TrendArgs),
    /// Trace one estimate to its inputs and settings, and recompute it
    #[command(after_help = "Example:\n  freeplay explain N412FP-0007 aileron_left")]
    Explain(ExplainArgs),
    /// Compare the estimates of two stores
    #[command(
        after_help = "Example:\n  freeplay run --config pipeline.toml --config trial.toml && freeplay diff results results-trial\n\nTo switch to the other store, set its path under [store] in pipeline.toml."
    )]
    Diff(DiffArgs),
    /// Score past forecasts against what happened
    #[command(
        after_help = "Examples:\n  freeplay backtest\n  freeplay backtest --estimates history.parquet --json"
    )]
    Backtest(BacktestArgs),
    /// Write an HTML report (fleet, tails, serials); works offline
    #[command(
        after_help = "Examples:\n  freeplay report --output report\n  freeplay report --output n412fp --tail N412FP"
    )]
    Report(ReportArgs),
    /// Simulate a fleet with known gaps: logs, installations, ground truth
    #[command(
        after_help = "Example:\n  freeplay simulate --output /tmp/fleet && freeplay run --config /tmp/fleet/pipeline.toml"
    )]
    Simulate(SimulateArgs),
    /// Inspect and maintain the results store
    #[command(
        after_help = "Examples:\n  freeplay store info --max-age 30h\n  freeplay store export --format csv --output gaps.csv"
    )]
    Store(StoreArgs),
    /// List and decide about work requests: open findings of the fleet
    #[command(
        after_help = "Examples:\n  freeplay work list --tail N412FP\n  freeplay work defer W12 --until 2027-01-15 --reason \"C-check\" --by \"M. Kaya\""
    )]
    Work(WorkArgs),
    /// Generate shell completions
    #[command(
        after_help = "Example:\n  freeplay completions bash > ~/.local/share/bash-completion/completions/freeplay"
    )]
    Completions(CompletionsArgs),
    /// Print the manual page
    #[command(after_help = "Example:\n  freeplay man | man -l -")]
    Man,
}

#[derive(Debug, ClapArgs)]
pub(crate) struct CompletionsArgs {
    /// Shell to generate completions for.
    #[arg(value_enum)]
    pub shell: clap_complete::Shell,
}
