//! Arguments of `work`.

use clap::{Args as ClapArgs, Subcommand};
use jiff::Timestamp;

use super::shared::{RowFormatArgs, UnitFilterArgs, parse_utc};

#[derive(Debug, ClapArgs)]
pub(crate) struct WorkArgs {
    #[command(subcommand)]
    pub command: WorkCommand,
}

/// Commands on work requests.
#[derive(Debug, Subcommand)]
pub(crate) enum WorkCommand {
    /// List work requests, the earliest due date first
    List(WorkListArgs),
    /// Record that you have seen a request
    Acknowledge {
        #[command(flatten)]
        who: WorkDecisionArgs,
        /// Your remark.
        #[arg(long, value_name = "TEXT")]
        reason: Option<String>,
    },
    /// Postpone a request; it comes back on the date, or when the state becomes worse
    Defer {
        #[command(flatten)]
        who: WorkDecisionArgs,
        /// Date on which the request comes back, e.g. `2026-12-01`.
        #[arg(long, value_parser = parse_utc, value_name = "UTC")]
        until: Timestamp,
        /// Why it can wait.
        #[arg(long, value_name = "TEXT")]
        reason: String,
    },
    /// Close a request without an entry in the maintenance or installations table
    Close {
        #[command(flatten)]
        who: WorkDecisionArgs,
        /// What was done, or why nothing is to be done.
        #[arg(long, value_name = "TEXT")]
        reason: String,
    },
}

#[derive(Debug, ClapArgs)]
pub(crate) struct WorkListArgs {
    #[command(flatten)]
    pub units: UnitFilterArgs,
    /// Only requests with this status; default: all that are not closed.
    #[arg(
        long,
        value_parser = ["open", "acknowledged", "deferred", "closed", "all"],
        value_name = "STATUS",
        help_heading = "Selection"
    )]
    pub status: Option<String>,
    #[command(flatten)]
    pub rows: RowFormatArgs,
}

/// Request and person of a decision.
#[derive(Debug, ClapArgs)]
pub(crate) struct WorkDecisionArgs {
    /// The request, e.g. `W12`.
    pub request: String,
    /// Who decides.
    #[arg(long, value_name = "NAME", env = "USER", hide_env_values = true)]
    pub by: String,
}
