//! Check of logs before a run: how they are mapped, and what would be refused. Nothing is estimated or written.

mod channels;

use std::collections::BTreeMap;
use std::sync::Arc;

use jiff::Timestamp;
use job::flight_log::{FlightLog, duplicate_flight, may_be_pieces, pieces_undeclared};
use job::part_identification::IdentifiedParams;
use job::{Config, rejection};
use records::{Diagnostic, Installations, PartNumber, Position};

use crate::logs::discover::SelectedLogs;
use crate::run::time_limit::within_time_limit;

use channels::{ActuatorCheck, Identified, actuator};
pub use channels::{ChannelCheck, RATIO};

/// What was found in one log.
#[derive(Debug, Default)]
#[expect(missing_docs, reason = "each field is named for what it holds")]
pub struct LogCheck {
    pub name: String,
    /// Tail number, flight and departure.
    pub flight: [String; 3],
    pub rows: usize,
    /// Time bases of its actuators, as text; equal neighbours once.
    pub clocks: Vec<String>,
    /// Whether all pages have checksums; `None` when the page headers cannot be read.
    pub has_checksums: Option<bool>,
    pub column_types: Vec<(String, String)>,
    pub channels: Vec<ChannelCheck>,
    diagnostics: Vec<Diagnostic>,
    identified: Vec<Identified>,
    departure_utc: Timestamp,
    positions: Vec<Position>,
    /// blake3 of what is read of its files.
    digest: String,
}

/// What was found in logs.
#[derive(Debug, Default)]
#[expect(missing_docs, reason = "each field is named for what it holds")]
pub struct LogsCheck {
    pub logs: Vec<LogCheck>,
    pub diagnostics: Vec<Diagnostic>,
    /// One error for each part number most of whose actuator-flights would be refused for a wrong mapping, or fit
    /// another stiffness than the configured one.
    pub mapping_faults: Vec<Diagnostic>,
    pub identified: BTreeMap<PartNumber, Vec<IdentifiedParams>>,
}

impl LogsCheck {
    /// Channels of all logs.
    pub fn channels(&self) -> Vec<ChannelCheck> {
        self.logs.iter().flat_map(|log| log.channels.iter().cloned()).collect()
    }
}

/// Checks logs.
pub fn check_logs(
    config: &Arc<Config>,
    installations: &Arc<Installations>,
    selected: SelectedLogs,
) -> LogsCheck {
    let mut seen = LogsCheck { diagnostics: selected.faults, ..LogsCheck::default() };
    for (name, files) in selected.logs {
        let (of_log, installed, shown) = (Arc::clone(config), Arc::clone(installations), name.clone());
        let looked = within_time_limit(&name, config, move || {
            let opened = FlightLog::open(&files, &shown, &of_log, &installed)?;
            Ok(check_log(&opened))
        });
        match looked {
            Ok(mut found) => {
                seen.diagnostics.append(&mut found.diagnostics);
                seen.logs.push(found);
            }
            Err(diagnostic) => seen.diagnostics.push(diagnostic),
        }
    }
    seen.diagnostics.extend(duplicate_flights(&seen.logs));
    if config.document.logs.pieces.is_none() {
        seen.diagnostics.extend(undeclared_pieces(&seen.logs));
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

/// Whether two logs hold the same samples, however their files are encoded: all numbers that the samples give are the same.
fn is_copy(one: &LogCheck, other: &LogCheck) -> bool {
    let ranges = |log: &LogCheck| -> Vec<_> {
        log.channels.iter().map(|channel| (channel.samples, channel.min, channel.max)).collect()
    };
    one.digest == other.digest || (ranges(one) == ranges(other) && one.identified == other.identified)
}

/// An error for each log with the flight and a position of an earlier log and other samples.
fn duplicate_flights(logs: &[LogCheck]) -> Vec<Diagnostic> {
    let mut owners = BTreeMap::new();
    let mut faults = Vec::new();
    for (number, log) in logs.iter().enumerate() {
        let key = |position| (log.departure_utc, &log.flight[0], position);
        let owner = log.positions.iter().map(|position| *owners.entry(key(position)).or_insert(number)).min();
        let Some(first) = owner.filter(|owner| *owner != number).map(|owner| &logs[owner]) else { continue };
        if !is_copy(first, log) {
            faults.push(duplicate_flight(&log.name, &first.name));
        }
    }
    faults
}

/// An error for each log with the tail, flight id and a position of another, and another departure close by.
fn undeclared_pieces(logs: &[LogCheck]) -> Vec<Diagnostic> {
    let mut same_id = BTreeMap::<_, Vec<&LogCheck>>::new();
    for (log, position) in logs.iter().flat_map(|log| log.positions.iter().map(move |at| (log, at))) {
        same_id.entry((&log.flight[..2], position)).or_default().push(log);
    }
    let fault = |log: &LogCheck| {
        let others = log.positions.iter().flat_map(|position| &same_id[&(&log.flight[..2], position)]);
        let pieces = others.filter(|other| may_be_pieces(log.departure_utc, other.departure_utc));
        let other = pieces.min_by_key(|other| &other.name)?;
        Some(pieces_undeclared(&log.name, log.departure_utc, &other.name, other.departure_utc))
    };
    logs.iter().filter_map(fault).collect()
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

fn check_log(opened: &FlightLog<'_>) -> LogCheck {
    let (id, name) = (&opened.identity, opened.display_name.as_str());
    let mut seen = LogCheck {
        name: name.to_owned(),
        flight: [
            id.flight.tail_number.to_string(),
            id.flight.flight_id.to_string(),
            id.flight.departure_utc.to_string(),
        ],
        rows: opened.log.rows(),
        has_checksums: opened.is_checked().ok(),
        column_types: opened.log.column_types(),
        departure_utc: id.flight.departure_utc,
        positions: opened.actuators().map(|at| at.columns.position.clone()).collect(),
        digest: opened.digest.clone(),
        ..LogCheck::default()
    };
    for at in opened.actuators() {
        match actuator(opened, at) {
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
