//! Loading of configuration and tables, common to all commands.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use ingest::mapping::column_pattern::nearest;
use jiff::Timestamp;
use job::Config;
use pipeline::assess::trends::UnitSelection;
use pipeline::fleet::histories::Histories;
use records::Installations;
use store::Store;

use crate::args::{CONFIG, ExternalEstimatesArgs, Global, UnitFilterArgs};
use crate::{Failure, Output};

pub(crate) const VERSION: &str = env!("CARGO_PKG_VERSION");

pub(crate) fn load_config(global: &Global) -> Result<Config, Failure> {
    Config::read_layers(&global.config).map_err(Failure::Refused)
}

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
            output.note("no pipeline.toml here and no limit, so every unit is unassessed; set one with `--limit-m 150e-6`");
        }
        (Config::default(), Installations::default())
    } else {
        load_with_installations(global)?
    };
    config.document.trend.limit_m = external.limit_m.or(config.document.trend.limit_m);
    Ok((config, installations))
}

/// Prints a note if the date of assessment is in the future: flights until then are unknown.
pub(crate) fn note_future(as_of: Option<Timestamp>, output: &Output) {
    const A_DAY: jiff::SignedDuration = jiff::SignedDuration::from_hours(24);
    if let Some(as_of) = as_of.filter(|as_of| *as_of > Timestamp::now() + A_DAY) {
        let date = as_of.strftime("%Y-%m-%d");
        output.note(&format!(
            "--as-of {date} is in the future: until then, usage goes on at each unit's own rate"
        ));
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

/// Columns of names, each with the word that messages use for it.
const NAMES: [(&str, &str); 5] = [
    ("tail_number", "tail"),
    ("serial_number", "serial number"),
    ("flight_id", "flight"),
    ("position", "position"),
    ("part_number", "part number"),
];

pub(crate) enum KnownNames {
    /// A store, if there is one, and the installations table.
    Store(Option<Box<Store>>, Installations),
    /// A table of estimates made elsewhere, and its units.
    Estimates(PathBuf, Histories),
}

/// The word that messages use for a column of names.
pub(crate) fn called(column: &str) -> &str {
    NAMES.iter().find(|(name, _)| *name == column).map_or(column, |(_, word)| word)
}

impl KnownNames {
    /// The names of the configured store and table; a missing store or table has none.
    pub(crate) fn of(config: &Config) -> Self {
        let installations = pipeline::run::scheduler::installations(config).unwrap_or_default();
        Self::Store(pipeline::open_store(config, &installations).ok().map(Box::new), installations)
    }

    /// The names in a column of the records, such as `tail_number`.
    pub(crate) fn names(&self, column: &str) -> BTreeSet<String> {
        match self {
            Self::Store(store, installations) => {
                let stored = store.as_ref().and_then(|store| store.distinct(column).ok());
                let installed = installations.iter().filter_map(|stay| match column {
                    "tail_number" => Some(stay.tail_number.to_string()),
                    "serial_number" => Some(stay.unit().1.to_string()),
                    "position" => Some(stay.position.to_string()),
                    "part_number" => Some(stay.unit().0.to_string()),
                    _ => None,
                });
                stored.unwrap_or_default().into_iter().chain(installed).collect()
            }
            Self::Estimates(_, histories) => match column {
                "tail_number" => histories.tails().map(str::to_owned).collect(),
                "serial_number" => histories.units.keys().map(|(_, serial)| serial.clone()).collect(),
                "part_number" => histories.units.keys().filter_map(|(part, _)| part.clone()).collect(),
                _ => BTreeSet::new(),
            },
        }
    }

    /// Refuses a name that none of the columns contains; the error suggests the nearest one.
    pub(crate) fn check(&self, columns: &[&str], name: Option<&str>) -> Result<(), Failure> {
        let Some(name) = name else { return Ok(()) };
        let known: BTreeSet<String> = columns.iter().flat_map(|column| self.names(column)).collect();
        if known.contains(name) {
            return Ok(());
        }
        let what = columns.iter().map(|column| called(column)).collect::<Vec<_>>().join(", ");
        let what =
            what.rsplit_once(", ").map_or(what.clone(), |(others, last)| format!("{others} or {last}"));
        let today = match self {
            Self::Store(_, table) => table.unit_today((None, name.to_owned()), Timestamp::MAX).1,
            Self::Estimates(..) => name.to_owned(),
        };
        let hint = match nearest(name, known.iter().map(String::as_str)) {
            _ if today != name => format!("the serial number of this unit today is `{today}`"),
            Some(nearest) => format!("the nearest known {what} is `{nearest}`"),
            None => format!("list all units of {} with `{}`", self.place(), self.listing()),
        };
        let searched = match self {
            Self::Store(..) => "the store and the installations table".to_owned(),
            Self::Estimates(..) => self.place(),
        };
        let what = format!("no {what} `{name}` in {searched} ({} searched)", known.len());
        Err(Failure::usage("unknown_name", what, &hint))
    }

    /// Refuses the first name of a selection of units that is unknown.
    pub(crate) fn check_units(&self, units: &UnitFilterArgs) -> Result<(), Failure> {
        self.check(&["tail_number"], units.tail.as_deref())?;
        self.check(&["serial_number"], units.serial.as_deref())?;
        self.check(&["part_number"], units.part.as_deref())
    }

    /// Why a selection has no unit: none is installed there now, or none has flown.
    pub(crate) fn why_nothing(&self, ask: &UnitSelection) -> String {
        let flown_on = match (self, &ask.tail_number, ask.as_of_utc) {
            (Self::Store(Some(store), installations), Some(tail), None) => store
                .distinct("tail_number")
                .is_ok_and(|flown| flown.contains(tail))
                .then_some((tail, installations)),
            _ => None,
        };
        let Some((tail, installations)) = flown_on else {
            return format!("no unit{} has flown; {}", selection(ask), self.searched());
        };
        let tails: BTreeSet<&str> = installations.iter().map(|stay| stay.tail_number.as_str()).collect();
        let table = if tails.contains(tail.as_str()) {
            format!("the installations table has none{} now", selection(ask))
        } else {
            let near = nearest(tail, tails).map(|near| format!(" (nearest: {near})")).unwrap_or_default();
            format!("the installations table does not know tail {tail}{near}")
        };
        format!("{table}; list the flights there with `freeplay query tail {tail}`")
    }

    fn listing(&self) -> String {
        match self {
            Self::Store(..) => "freeplay trend".to_owned(),
            Self::Estimates(file, _) => format!("freeplay trend --estimates {} --all", display_path(file)),
        }
    }

    fn place(&self) -> String {
        match self {
            Self::Store(..) => "the store".to_owned(),
            Self::Estimates(file, _) => display_path(file),
        }
    }

    /// What was searched, as text: the departures in the store.
    fn searched(&self) -> String {
        let range = match self {
            Self::Store(store, _) => store
                .as_ref()
                .and_then(|store| store.info().ok())
                .and_then(|info| info.first_departure_utc.zip(info.last_departure_utc)),
            Self::Estimates(_, histories) => histories.oldest_utc().zip(histories.newest_utc()),
        };
        let (day, place) = (|at: Timestamp| at.strftime("%Y-%m-%d"), self.place());
        range.map_or_else(
            || format!("{place} has no departures"),
            |(from, to)| format!("the departures in {place} are from {} to {}", day(from), day(to)),
        )
    }
}

impl UnitFilterArgs {
    pub(crate) fn selection(&self, as_of_utc: Option<Timestamp>) -> UnitSelection {
        UnitSelection {
            tail_number: self.tail.clone(),
            serial_number: self.serial.clone(),
            part_number: self.part.clone(),
            as_of_utc,
        }
    }
}

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

pub(crate) fn display_path(path: &Path) -> String {
    path.display().to_string()
}
