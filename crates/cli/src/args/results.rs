//! Arguments of the commands that read results: `query`, `trend`, `explain`, `diff`, `backtest`, `report`.

use std::path::PathBuf;

use clap::Args as ClapArgs;
use clap_complete::ArgValueCompleter;
use jiff::Timestamp;

use super::shared::{DepartureArgs, RowFormatArgs, UnitFilterArgs, parse_count, parse_limit, parse_utc};
use crate::completion;

#[derive(Debug, ClapArgs)]
pub(crate) struct QueryArgs {
    /// `tail`, `serial`, `flight` or `position`; or the value alone, if it is known.
    #[arg(value_name = "BY", required_unless_present_any = ["tail", "serial", "flight", "position", "part", "since", "until", "last"])]
    pub first: Option<String>,
    /// Value to match.
    #[arg(value_name = "ID", add = ArgValueCompleter::new(completion::queried))]
    pub second: Option<String>,
    /// Records of this tail.
    #[arg(long, help_heading = "Selection", conflicts_with = "first", add = completion::of("tail_number"))]
    pub tail: Option<String>,
    /// Records of this unit.
    #[arg(long, help_heading = "Selection", conflicts_with = "first", add = completion::of("serial_number"))]
    pub serial: Option<String>,
    /// Records of this flight.
    #[arg(long, help_heading = "Selection", conflicts_with = "first", add = completion::of("flight_id"))]
    pub flight: Option<String>,
    /// Records of this position.
    #[arg(long, help_heading = "Selection", conflicts_with = "first", add = completion::of("position"))]
    pub position: Option<String>,
    #[command(flatten)]
    pub departures: DepartureArgs,
    /// Show only the newest N records.
    #[arg(long, value_name = "N", value_parser = parse_count, allow_negative_numbers = true, help_heading = "Selection")]
    pub last: Option<usize>,
    /// Only this part number.
    #[arg(long, help_heading = "Selection", add = completion::of("part_number"))]
    pub part: Option<String>,
    #[command(flatten)]
    pub rows: RowFormatArgs,
}

#[derive(Debug, ClapArgs)]
#[allow(clippy::struct_excessive_bools, reason = "each is a flag of the command line")]
pub(crate) struct TrendArgs {
    #[command(flatten)]
    pub units: UnitFilterArgs,
    /// Date of the assessment; default: now, or that of `trend.as_of`. Later data are ignored.
    #[arg(long, value_parser = parse_utc, value_name = "UTC", help_heading = "Selection")]
    pub as_of: Option<Timestamp>,
    #[command(flatten)]
    pub external: ExternalEstimatesArgs,
    /// Table of (`serial_number`, `as_of_utc`, optional `part_number`) to assess, one row each.
    #[arg(long, value_name = "FILE", help_heading = "Selection", conflicts_with_all = ["as_of", "tail", "serial", "part"])]
    pub queries: Option<PathBuf>,
    /// List normal and removed units too; otherwise a table only counts them.
    #[arg(long, help_heading = "Views")]
    pub all: bool,
    /// Ignored; scripts may still pass it.
    #[arg(long, hide = true)]
    pub statistics: bool,
    /// Show every followed quantity of the units instead: stiffness, friction, delays, load zero, lost motion, NIS.
    #[arg(long, help_heading = "Views", conflicts_with_all = ["queries", "statistics", "estimates"])]
    pub quantities: bool,
    /// Show what changed instead, of units, tails and parts, with the evidence.
    #[arg(long, help_heading = "Views", conflicts_with_all = ["quantities", "queries", "statistics", "estimates"])]
    pub changes: bool,
    #[command(flatten)]
    pub rows: RowFormatArgs,
}

/// Options for estimates made by another program.
#[derive(Debug, ClapArgs)]
#[command(next_help_heading = "Estimates of another program")]
pub(crate) struct ExternalEstimatesArgs {
    /// Read this table of estimates instead of the store; needs no configuration.
    #[arg(long, value_name = "FILE")]
    pub estimates: Option<PathBuf>,
    /// Limit in m for parts without a `limit_m` of their own, e.g. 150e-6.
    #[arg(long, value_name = "M", value_parser = parse_limit)]
    pub limit_m: Option<f64>,
}

#[derive(Debug, ClapArgs)]
pub(crate) struct ExplainArgs {
    /// Flight to trace.
    #[arg(add = completion::of("flight_id"))]
    pub flight: String,
    /// Position of the actuator.
    #[arg(add = completion::of("position"))]
    pub position: String,
    /// Tail number, if several aircraft have a flight of this name.
    #[arg(long, add = completion::of("tail_number"))]
    pub tail: Option<String>,
    #[command(flatten)]
    pub departures: DepartureArgs,
    /// Print JSON, SI.
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, ClapArgs)]
pub(crate) struct DiffArgs {
    /// First store.
    pub before: PathBuf,
    /// Second store.
    pub after: PathBuf,
    /// Ignore differences below this, µm.
    #[arg(long, alias = "least-um", value_name = "UM", default_value_t = 0.0)]
    pub min_change_um: f64,
    #[command(flatten)]
    pub rows: RowFormatArgs,
}

#[derive(Debug, ClapArgs)]
pub(crate) struct BacktestArgs {
    #[command(flatten)]
    pub external: ExternalEstimatesArgs,
    #[command(flatten)]
    pub rows: RowFormatArgs,
}

#[derive(Debug, ClapArgs)]
pub(crate) struct ReportArgs {
    /// Write to this folder. A report in it is replaced; a folder with other files is refused.
    #[arg(long, short, value_name = "DIR")]
    pub output: PathBuf,
    #[command(flatten)]
    pub units: UnitFilterArgs,
    /// Date of the assessments; default: now, or as `trend.as_of` says. Later data are ignored.
    #[arg(long, value_parser = parse_utc, value_name = "UTC", help_heading = "Selection")]
    pub as_of: Option<Timestamp>,
    /// Also draw the diagnostic plots of the latest flights from their logs, linked from the unit's page: of each unit that
    /// needs action, or of all selected units; at most 200.
    #[arg(
        long,
        value_name = "FLIGHTS",
        num_args = 0..=1,
        default_missing_value = "3",
        value_parser = clap::value_parser!(u16).range(1..),
        help_heading = "Contents"
    )]
    pub diagnostics: Option<u16>,
    /// Also write what the pages show as Parquet tables to `data/` in the folder.
    #[arg(long, help_heading = "Contents")]
    pub data: bool,
}
