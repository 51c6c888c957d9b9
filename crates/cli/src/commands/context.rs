//! Loading of configuration and tables, common to all commands.

use std::path::Path;

use job::Config;
use records::Installations;

use crate::args::{CONFIG, ExternalEstimatesArgs, Global};
use crate::exit::Failure;
use crate::output::Output;

/// Version written into every record.
pub(crate) const VERSION: &str = env!("CARGO_PKG_VERSION");

/// Reads the configuration files named by the options.
pub(crate) fn load_config(global: &Global) -> Result<Config, Failure> {
    Config::read_layers(&global.config).map_err(Failure::Refused)
}

/// Reads the configuration and its installations table.
pub(crate) fn load_with_installations(global: &Global) -> Result<(Config, Installations), Failure> {
    let config = load_config(global)?;
    let installations = pipeline::run::scheduler::installations(&config)?;
    Ok((config, installations))
}

/// Reads configuration and installations for trends. An external table of estimates needs neither.
pub(crate) fn load_trend_context(
    external: &ExternalEstimatesArgs,
    global: &Global,
    output: &Output,
) -> Result<(Config, Installations), Failure> {
    let is_none_named = matches!(&global.config[..], [file] if file.as_os_str() == CONFIG && !file.exists());
    let (mut config, installations) = if external.estimates.is_some() && is_none_named {
        if external.limit_m.is_none() {
            output.note("no pipeline.toml here and no limit, so no states; set one with `--limit-m 150e-6`");
        }
        (Config::without_logs(), Installations::default())
    } else {
        load_with_installations(global)?
    };
    config.document.trend.limit_m = external.limit_m.or(config.document.trend.limit_m);
    Ok((config, installations))
}

/// Path as text for messages.
pub(crate) fn display_path(path: &Path) -> String {
    path.display().to_string()
}
