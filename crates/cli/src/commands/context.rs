//! Loading of configuration and tables, common to all commands.

use std::path::Path;

use job::Config;
use records::Installations;

use crate::args::{CONFIG, ExternalEstimatesArgs, Global};
use crate::exit::Failure;
use crate::output::Output;

/// The version written into every record.
pub(crate) const VERSION: &str = env!("CARGO_PKG_VERSION");

/// The configuration that the options name.
pub(crate) fn load_config(global: &Global) -> Result<Config, Failure> {
    Config::read_layers(&global.config).map_err(Failure::Refused)
}

/// The configuration and its installations table.
pub(crate) fn load_with_installations(global: &Global) -> Result<(Config, Installations), Failure> {
    let config = load_config(global)?;
    let installations = pipeline::run::scheduler::installations(&config)?;
    Ok((config, installations))
}

/// What statements need of a configuration and its installations table. For a table of estimates made elsewhere
/// there need not be one.
pub(crate) fn load_trend_context(
    external: &ExternalEstimatesArgs,
    global: &Global,
    output: &Output,
) -> Result<(Config, Installations), Failure> {
    let is_none_named = matches!(&global.config[..], [file] if file.as_os_str() == CONFIG && !file.exists());
    let (mut config, installations) = if external.estimates.is_some() && is_none_named {
        if external.limit_m.is_none() {
            output.note("no pipeline.toml here: judged without a limit, so without states; `--limit-m 150e-6` gives one");
        }
        (Config::without_logs(), Installations::default())
    } else {
        load_with_installations(global)?
    };
    config.document.trend.limit_m = external.limit_m.or(config.document.trend.limit_m);
    Ok((config, installations))
}

/// A path as people see it.
pub(crate) fn display_path(path: &Path) -> String {
    path.display().to_string()
}
