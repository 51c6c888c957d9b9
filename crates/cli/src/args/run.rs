//! Arguments of `run`.

use std::path::PathBuf;

use clap::Args as ClapArgs;
use pipeline::State;

use super::shared::{DepartureArgs, parse_count, parse_span, parse_workers, state_parser};
use crate::completion;

#[derive(Debug, ClapArgs)]
#[expect(clippy::struct_excessive_bools, reason = "each is a flag that a user types")]
pub(crate) struct RunArgs {
    #[command(flatten)]
    pub departures: DepartureArgs,
    /// Only this tail.
    #[arg(long, help_heading = "Selection", add = completion::of("tail_number"))]
    pub tail: Option<String>,
    /// Only flights of this unit.
    #[arg(long, help_heading = "Selection", add = completion::of("serial_number"))]
    pub serial: Option<String>,
    /// Process at most N logs.
    #[arg(long, value_name = "N", value_parser = parse_count, allow_negative_numbers = true, help_heading = "Selection")]
    pub limit: Option<usize>,
    /// Use N workers; default: one per core.
    #[arg(long, short, value_name = "N", value_parser = parse_workers, allow_negative_numbers = true, help_heading = "Processing")]
    pub jobs: Option<u16>,
    /// Retry failed logs.
    #[arg(long, help_heading = "Processing")]
    pub retry: bool,
    /// Reprocess all logs.
    #[arg(long, help_heading = "Processing")]
    pub redo: bool,
    /// Hash known logs and reprocess those whose content changed.
    #[arg(long, help_heading = "Processing")]
    pub verify_content: bool,
    /// Show what would be processed and why, without processing it (dry run).
    #[arg(long, help_heading = "Processing")]
    pub dry_run: bool,
    /// Write run metrics in Prometheus text format, e.g. for a node exporter.
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub metrics: Option<PathBuf>,
    /// Wait up to TIME for another run to release the store, e.g. `20m`.
    #[arg(long, value_parser = parse_span, value_name = "TIME", help_heading = "Processing")]
    pub wait: Option<std::time::Duration>,
    /// Exit with code 4 if any unit is in this state or worse.
    #[arg(long, value_parser = state_parser(), value_name = "STATE", help_heading = "Output")]
    pub fail_on: Option<State>,
    /// Print the run summary as JSON on stdout.
    #[arg(long, help_heading = "Output")]
    pub json: bool,
}
