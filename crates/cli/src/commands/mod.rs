//! A file for each command: arguments to a request, request to the library, answer to text.

pub mod check;
pub mod estimate;
pub mod init;
pub mod query;
pub mod run;
pub mod shell;
pub mod simulate;
pub mod store;
pub mod trend;

use std::path::Path;

use fleet::Installations;
use job::Config;

use crate::args::Global;
use crate::exit::Failure;

/// The version written into every record.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

/// The configuration that the options name.
pub fn config(global: &Global) -> Result<Config, Failure> {
    Config::read(&global.config).map_err(Failure::Refused)
}

/// The configuration and its installations table.
pub fn booked(global: &Global) -> Result<(Config, Installations), Failure> {
    let config = config(global)?;
    let installations = pipeline::schedule::installations(&config)?;
    Ok((config, installations))
}

/// A path as people see it.
pub fn shown(path: &Path) -> String {
    path.display().to_string()
}
