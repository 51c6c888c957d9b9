//! Check of logs before a run: how they are mapped, and what would be refused. Nothing is estimated or written.

mod channels;
mod flight_owners;

use std::collections::BTreeMap;
use std::sync::Arc;

use ingest::LogFiles;
use job::flight_log::FlightLog;
use job::part_identification::IdentifiedParams;
use job::{Config, rejection};
use records::{Diagnostic, Installations, PartNumber};

use crate::run::time_limit::within_time_limit;

use channels::{ActuatorCheck, Identified, actuator};
pub use channels::{ChannelCheck, RATIO};
use flight_owners::{CheckedLog, FlightOwners, flight_keys};

/// What was found in one log.
#[derive(Debug, Default)]
pub struct LogCheck {
    /// Its name.
    pub name: String,
    /// Tail number, flight and departure.
    pub flight: [String; 3],
    /// Number of rows.
    pub rows: usize,
    /// Time bases of its actuators, as text; equal neighbours once.
    pub clocks: Vec<String>,
    /// Whether all pages have checksums; `None` when the page headers cannot be read.
    pub has_checksums: Option<bool>,
    /// Its columns with their types.
    pub column_types: Vec<(String, String)>,
    /// Its channels.
    pub channels: Vec<ChannelCheck>,
    diagnostics: Vec<Diagnostic>,
    identified: Vec<Identified>,
}

/// What was found in logs.
#[derive(Debug, Default)]
pub struct LogsCheck {
    /// Logs that could be opened.
    pub logs: Vec<LogCheck>,
    /// Errors of logs.
    pub diagnostics: Vec<Diagnostic>,
    /// One error for each part number most of whose actuator-flights would be refused for a wrong mapping, or fit
    /// another stiffness than the configured one.
    pub mapping_faults: Vec<Diagnostic>,
    /// Identified parameters by part number.
    pub identified: BTreeMap<PartNumber, Vec<IdentifiedParams>>,
}

impl LogsCheck {
    /// Channels of all logs.
    pub fn channels(&self) -> Vec<ChannelCheck> {
        self.logs.iter().flat_map(|log| log.channels.iter().cloned()).collect()
    }
}

/// Checks logs, each with its name. `faults` are errors of logs that could not be listed.
pub fn check_logs(
    config: &Arc<Config>,
    installations: &Arc<Installations>,
    logs: Vec<(LogFiles, String)>,
    faults: Vec<Diagnostic>,
) -> LogsCheck {
    let mut seen = LogsCheck { diagnostics: faults, ..LogsCheck::default() };
    let mut flights = FlightOwners::default();
    for (files, name) in logs {
        let (of_log, installed, shown) = (Arc::clone(config), Arc::clone(installations), name.clone());
        let looked = within_time_limit(&name, config, move || {
            let opened = FlightLog::open(&files, &shown, &of_log, &installed)?;
            let keys = flight_keys(&opened, &installed);
            let (digest, flight_id) = (opened.digest.clone(), opened.identity.flight_id.clone());
            let checked = check_log(&opened, &shown, &of_log, &installed);
            Ok((checked, keys, CheckedLog { files, name: shown, digest, flight_id }))
        });
        match looked {
            Ok((mut found, keys, log)) => {
                seen.diagnostics.append(&mut found.diagnostics);
                seen.logs.push(found);
                seen.diagnostics.extend(flights.enter(log, keys, config, installations));
            }
            Err(diagnostic) => seen.diagnostics.push(diagnostic),
        }
    }
    if config.document.logs.pieces.is_none() {
        seen.diagnostics.extend(flights.undeclared_pieces());
    }
    let mut rejections: BTreeMap<PartNumber, Vec<Option<&'static str>>> = BTreeMap::new();
    for log in &mut seen.logs {
        for (part, found, rejection) in log.identified.drain(..) {
            rejections.entry(part.clone()).or_default().push(rejection);
            seen.identified.entry(part).or_default().push(found);
        }
    }
    seen.mapping_faults = rejections.iter().filter_map(mapping_fault).collect();
    seen
}

fn mapping_fault((part, codes): (&PartNumber, &Vec<Option<&'static str>>)) -> Option<Diagnostic> {
    let (code, refused) = rejection::majority(codes)?;
    let remedy = rejection::part_remedy(code)?;
    let flights = if codes.len() == 1 { "actuator-flight" } else { "actuator-flights" };
    let what = match code {
        rejection::STIFFNESS_UNLIKE => "fit a stiffness unlike the configured one",
        _ => "would be refused",
    };
    let what = format!("part {part}: {refused} of {} checked {flights} {what}", codes.len());
    Some(Diagnostic::new(code, what).hint(remedy))
}

fn check_log(opened: &FlightLog, name: &str, config: &Config, installations: &Installations) -> LogCheck {
    let id = &opened.identity;
    let mut seen = LogCheck {
        name: name.to_owned(),
        flight: [id.tail_number.to_string(), id.flight_id.to_string(), id.departure_utc.to_string()],
        rows: opened.rows(),
        has_checksums: opened.is_checked().ok(),
        column_types: opened.column_types(),
        ..LogCheck::default()
    };
    for at in opened.actuators(installations) {
        match actuator(opened, name, at, config, installations) {
            Ok(ActuatorCheck { found, clock, identified }) => {
                seen.channels.extend(found);
                seen.clocks.extend(clock);
                seen.identified.extend(identified);
            }
            // A fault of the whole log is reported for each of its actuators.
            Err(diagnostic) => {
                let diagnostic = diagnostic.in_file(name);
                if !seen.diagnostics.contains(&diagnostic) {
                    seen.diagnostics.push(diagnostic);
                }
            }
        }
    }
    seen.clocks.dedup();
    seen
}
