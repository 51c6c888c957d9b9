//! Arguments of `store`.

use clap::{Args as ClapArgs, Subcommand};

use super::shared::{DepartureArgs, RowFormatArgs, parse_count, parse_span};
use crate::completion;

#[derive(Debug, ClapArgs)]
pub(crate) struct StoreArgs {
    #[command(subcommand)]
    pub command: StoreCommand,
}

/// Commands on the results store.
#[derive(Debug, Subcommand)]
pub(crate) enum StoreCommand {
    /// Show store contents and the last run
    Info {
        /// Exit with code 1 if the last completed run is older, e.g. `30h`.
        #[arg(long, value_parser = parse_span, value_name = "TIME")]
        max_age: Option<std::time::Duration>,
        /// Print JSON.
        #[arg(long)]
        json: bool,
    },
    /// List recent runs, or the logs of one run
    Runs {
        /// List the logs of this run; `last` is the newest.
        #[arg(long, value_name = "ID")]
        run: Option<String>,
        /// Show at most N runs.
        #[arg(long, value_name = "N", value_parser = parse_count, allow_negative_numbers = true, default_value_t = 20)]
        last: usize,
        #[command(flatten)]
        rows: RowFormatArgs,
    },
    /// List changes of state, and what became of their messages
    Alerts {
        /// Show only messages that were not sent, or perhaps not received.
        #[arg(long)]
        unsent: bool,
        /// Let the next run send the unconfirmed messages of this alert again.
        #[arg(long, value_name = "ID")]
        resend: Option<String>,
        /// Discard the unsent messages of this channel, e.g. of one that is no longer configured.
        #[arg(long, value_name = "CHANNEL", conflicts_with = "resend")]
        drop: Option<String>,
        /// With `--drop`: let the next run send them through this channel.
        #[arg(long, value_name = "CHANNEL", requires = "drop")]
        to: Option<String>,
        #[command(flatten)]
        rows: RowFormatArgs,
    },
    /// List the current data files of a table, for tools without Delta support
    Files {
        /// Table to list: records of estimates, logs, runs, alerts, events of work requests, or states of the units.
        #[arg(
            long,
            value_parser = ["gaps", "logs", "runs", "alerts", "work", "states"],
            default_value = "gaps"
        )]
        table: String,
    },
    /// Verify store integrity
    Verify {
        /// Accept the commits of other programs: they get the digests that Freeplay's own have.
        #[arg(long)]
        accept_foreign: bool,
    },
    /// Merge small files, sorted for queries
    Compact,
    /// Take records out, e.g. those of a log that was sent under a wrong tail; nothing is deleted
    Forget(ForgetArgs),
    /// Export all records
    Export {
        #[command(flatten)]
        rows: RowFormatArgs,
    },
}

/// `store forget`: the records that meet all of its options.
#[derive(Debug, ClapArgs)]
pub(crate) struct ForgetArgs {
    /// Records of this flight.
    #[arg(long, value_name = "ID", add = completion::of("flight_id"))]
    pub flight: Option<String>,
    /// Records of this log, by its path in the store.
    #[arg(long, value_name = "PATH")]
    pub log: Option<String>,
    /// Records of this tail.
    #[arg(long, add = completion::of("tail_number"))]
    pub tail: Option<String>,
    /// Records of this position.
    #[arg(long)]
    pub position: Option<String>,
    /// Bring forgotten records back instead.
    #[arg(long)]
    pub undo: bool,
    #[command(flatten)]
    pub departures: DepartureArgs,
}
