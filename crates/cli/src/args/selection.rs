//! Options that select units and departures.

use clap::Args as ClapArgs;
use jiff::Timestamp;

use super::parse::parse_utc;
use crate::completion;

/// Selection of units.
#[derive(Debug, Clone, ClapArgs)]
#[command(next_help_heading = "Selection")]
pub(crate) struct UnitFilterArgs {
    /// Only units on this tail.
    #[arg(long, add = completion::of("tail_number"))]
    pub tail: Option<String>,
    /// Only this unit.
    #[arg(long, add = completion::of("serial_number"))]
    pub serial: Option<String>,
    /// Only this part number.
    #[arg(long, add = completion::of("part_number"))]
    pub part: Option<String>,
}

/// Range of departures.
#[derive(Debug, Clone, ClapArgs)]
#[command(next_help_heading = "Selection")]
pub(crate) struct DepartureArgs {
    /// Only departures at or after this UTC time.
    #[arg(long, value_parser = parse_utc, value_name = "UTC")]
    pub since: Option<Timestamp>,
    /// Only departures before this UTC time.
    #[arg(long, value_parser = parse_utc, value_name = "UTC")]
    pub until: Option<Timestamp>,
}
