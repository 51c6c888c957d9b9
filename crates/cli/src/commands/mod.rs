//! A file for each command: arguments to a request, request to the library, answer to text.

pub(crate) mod backtest;
pub(crate) mod check;
pub(crate) mod diff;
pub(crate) mod estimate;
pub(crate) mod explain;
pub(crate) mod init;
pub(crate) mod metrics;
pub(crate) mod normalize;
mod plot;
pub(crate) mod query;
pub(crate) mod report;
pub(crate) mod run;
pub(crate) mod runs;
pub(crate) mod shell;
pub(crate) mod simulate;
pub(crate) mod store;
pub(crate) mod trend;

use std::path::Path;

use fleet::Installations;
use job::Config;

use crate::args::Global;
use crate::exit::Failure;

/// The version written into every record.
pub(crate) const VERSION: &str = env!("CARGO_PKG_VERSION");

/// The configuration that the options name.
pub(crate) fn config(global: &Global) -> Result<Config, Failure> {
    Config::read_layers(&global.config).map_err(Failure::Refused)
}

/// The configuration and its installations table.
pub(crate) fn booked(global: &Global) -> Result<(Config, Installations), Failure> {
    let config = config(global)?;
    let installations = pipeline::schedule::installations(&config)?;
    Ok((config, installations))
}

/// A path as people see it.
pub(crate) fn shown(path: &Path) -> String {
    path.display().to_string()
}
