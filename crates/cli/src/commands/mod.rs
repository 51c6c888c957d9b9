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

use job::Config;
use records::Installations;

use crate::args::{CONFIG, Foreign, Global};
use crate::exit::Failure;
use crate::talk::Talk;

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

/// What statements need of a configuration and its installations table. For a table of estimates made elsewhere
/// there need not be one.
pub(crate) fn judging(
    foreign: &Foreign,
    global: &Global,
    talk: &Talk,
) -> Result<(Config, Installations), Failure> {
    let is_none_named = matches!(&global.config[..], [file] if file.as_os_str() == CONFIG && !file.exists());
    let (mut config, installations) = if foreign.estimates.is_some() && is_none_named {
        if foreign.limit_m.is_none() {
            talk.note("no pipeline.toml here: judged without a limit, so without states; `--limit-m 150e-6` gives one");
        }
        (Config::without_logs(), Installations::default())
    } else {
        booked(global)?
    };
    config.document.trend.limit_m = foreign.limit_m.or(config.document.trend.limit_m);
    Ok((config, installations))
}

/// A path as people see it.
pub(crate) fn shown(path: &Path) -> String {
    path.display().to_string()
}
