//! Loading of configuration and tables, common to all commands.

use std::collections::BTreeSet;
use std::path::Path;

use jiff::Timestamp;
use job::Config;
use pipeline::assess::trends::{self, UnitSelection};
use pipeline::fleet::histories::Histories;
use records::Installations;

use crate::args::{CONFIG, ExternalEstimatesArgs, Global, UnitFilterArgs};
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

/// Notes a date of assessment that has not come: nothing is known of the flights until then.
pub(crate) fn note_future(as_of: Option<Timestamp>, output: &Output) {
    const A_DAY: jiff::SignedDuration = jiff::SignedDuration::from_hours(24);
    if let Some(as_of) = as_of.filter(|as_of| *as_of > Timestamp::now() + A_DAY) {
        let date = as_of.strftime("%Y-%m-%d");
        output.note(&format!("--as-of {date} is in the future: states assume that no unit flies until then"));
    }
}

/// Refuses a range of departures without any instant.
pub(crate) fn check_range(since: Option<Timestamp>, until: Option<Timestamp>) -> Result<(), Failure> {
    match since.zip(until).filter(|(since, until)| since >= until) {
        Some((since, until)) => Err(Failure::usage(
            "empty_range",
            format!("no departure is at or after {since} and before {until}"),
            "set `--until` later than `--since`",
        )),
        None => Ok(()),
    }
}

/// Refuses a name that is not among the known ones, with the nearest of them.
pub(crate) fn check_name<'n>(
    what: &str,
    name: Option<&str>,
    known: impl IntoIterator<Item = &'n str>,
) -> Result<(), Failure> {
    let known: BTreeSet<&str> = known.into_iter().collect();
    let Some(name) = name.filter(|name| !known.contains(name)) else { return Ok(()) };
    let hint = match ingest::mapping::column_pattern::nearest(name, known.iter().copied()) {
        Some(nearest) => format!("the nearest known {what} is `{nearest}`"),
        None => "list the contents of the store with `freeplay store info`".to_owned(),
    };
    Err(Failure::usage(
        "unknown_name",
        format!("no {what} `{name}` in the store and the installations table ({} searched)", known.len()),
        &hint,
    ))
}

/// Names in the store and in the installations table.
pub(crate) struct KnownNames {
    histories: Histories,
    installations: Installations,
}

impl KnownNames {
    /// Names of a store and a table.
    pub(crate) fn new(histories: Histories, installations: Installations) -> Self {
        Self { histories, installations }
    }

    /// Reads the names of a store; a missing store or table has none.
    pub(crate) fn read(config: &Config) -> Self {
        let installations = pipeline::run::scheduler::installations(config).unwrap_or_default();
        let store = pipeline::open_store(config, &installations).ok();
        let histories = store.and_then(|store| trends::load_histories(&store).ok());
        Self { histories: histories.unwrap_or_default(), installations }
    }

    /// Tail numbers.
    pub(crate) fn tails(&self) -> impl Iterator<Item = &str> {
        self.histories
            .tails()
            .chain(self.installations.iter().map(|installation| installation.tail_number.as_str()))
    }

    /// Positions.
    pub(crate) fn positions(&self) -> impl Iterator<Item = &str> {
        self.histories
            .positions()
            .chain(self.installations.iter().map(|installation| installation.position.as_str()))
    }

    /// Serial numbers.
    pub(crate) fn serials(&self) -> impl Iterator<Item = &str> {
        let stored = self.histories.names().map(|(_, serial)| serial.as_str());
        stored.chain(self.installations.iter().map(|installation| installation.serial_number.as_str()))
    }

    /// Part numbers.
    pub(crate) fn parts(&self) -> impl Iterator<Item = &str> {
        let stored = self.histories.names().filter_map(|(part, _)| part.as_deref());
        stored.chain(self.installations.iter().map(|installation| installation.part_number.as_str()))
    }

    /// Flights.
    pub(crate) fn flights(&self) -> impl Iterator<Item = &str> {
        self.histories.iter().flat_map(|(_, history)| {
            history.flights().iter().filter_map(move |flown| history.flight_id(flown))
        })
    }

    /// What was searched, as text: the departures in the store.
    pub(crate) fn searched(&self) -> String {
        let day = |at: Timestamp| at.strftime("%Y-%m-%d").to_string();
        match (self.histories.oldest_utc(), self.histories.newest_utc()) {
            (Some(oldest), Some(newest)) => {
                format!("the departures in the store are from {} to {}", day(oldest), day(newest))
            }
            _ => "the store has no departures".to_owned(),
        }
    }

    /// Refuses the first name of a selection of units that is unknown.
    pub(crate) fn check_units(&self, units: &UnitFilterArgs) -> Result<(), Failure> {
        check_name("tail", units.tail.as_deref(), self.tails())?;
        check_name("serial number", units.serial.as_deref(), self.serials())?;
        check_name("part number", units.part.as_deref(), self.parts())
    }
}

impl UnitFilterArgs {
    /// The units, at a date.
    pub(crate) fn selection(&self, as_of_utc: Option<Timestamp>) -> UnitSelection {
        UnitSelection {
            tail_number: self.tail.clone(),
            serial_number: self.serial.clone(),
            part_number: self.part.clone(),
            as_of_utc,
        }
    }
}

/// A selection of units as text.
pub(crate) fn selection(ask: &UnitSelection) -> String {
    let named = |what: &str, name: &Option<String>| name.as_ref().map(|name| format!(" of {what} {name}"));
    let parts = [
        named("tail", &ask.tail_number),
        named("serial number", &ask.serial_number),
        named("part number", &ask.part_number),
        ask.as_of_utc.map(|as_of| format!(" until {as_of}")),
    ];
    parts.into_iter().flatten().collect()
}

/// Path as text for messages.
pub(crate) fn display_path(path: &Path) -> String {
    path.display().to_string()
}
