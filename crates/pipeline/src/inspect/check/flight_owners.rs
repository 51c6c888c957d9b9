//! Logs of a check that hold the same flight.

use std::collections::BTreeMap;

use ingest::{ActuatorColumns, LogFiles};
use job::Config;
use job::flight_log::{FlightLog, duplicate_flight, may_be_pieces, pieces_undeclared, sample_digest};
use records::{Diagnostic, FlightId, Installations};

/// Departure, tail and position, as in the key of a record: what one log holds, no other may.
pub(super) type FlightKey = (jiff::Timestamp, String, String);

pub(super) fn flight_keys(opened: &FlightLog, installations: &Installations) -> Vec<FlightKey> {
    let id = &opened.identity;
    let key = |at: &ActuatorColumns| (id.departure_utc, id.tail_number.to_string(), at.position.to_string());
    opened.actuators(installations).map(key).collect()
}

/// A log that was opened.
pub(super) struct CheckedLog {
    pub(super) files: LogFiles,
    pub(super) name: String,
    pub(super) digest: String,
    pub(super) flight_id: FlightId,
}

/// The log of each flight and position: another log of the same flight is an error in a run, too.
#[derive(Default)]
pub(super) struct FlightOwners {
    owners: BTreeMap<FlightKey, usize>,
    logs: Vec<CheckedLog>,
}

impl FlightOwners {
    /// Enters a log; an error where another log holds its flight with other samples.
    pub(super) fn enter(
        &mut self,
        log: CheckedLog,
        keys: Vec<FlightKey>,
        config: &Config,
        installations: &Installations,
    ) -> Option<Diagnostic> {
        let own = self.logs.len();
        let owners = keys.into_iter().map(|key| *self.owners.entry(key).or_insert(own));
        let other = owners.filter(|owner| *owner != own).min();
        let first = other.map(|other| &self.logs[other]).filter(|first| first.digest != log.digest);
        let samples = |log: &CheckedLog| sample_digest(&log.files, &log.name, config, installations).ok();
        let fault = first.and_then(|first| {
            let is_copy = samples(first).is_some_and(|digest| samples(&log) == Some(digest));
            (!is_copy).then(|| duplicate_flight(&log.name, &first.name))
        });
        self.logs.push(log);
        fault
    }

    /// An error for each log with the tail, flight id and position of another, and another departure close by.
    pub(super) fn undeclared_pieces(&self) -> Vec<Diagnostic> {
        let mut same_id: BTreeMap<_, Vec<(jiff::Timestamp, usize)>> = BTreeMap::new();
        for ((departure, tail, position), log) in &self.owners {
            let flight = &self.logs[*log].flight_id;
            same_id.entry((tail, flight, position)).or_default().push((*departure, *log));
        }
        let mut found = BTreeMap::new();
        for logs in same_id.values() {
            for (departure, log) in logs {
                let others = logs.iter().filter(|(other, _)| may_be_pieces(*departure, *other));
                if let Some((other_departure, other)) =
                    others.min_by_key(|(_, other)| &self.logs[*other].name)
                {
                    let (name, other) = (&self.logs[*log].name, &self.logs[*other].name);
                    let fault = || pieces_undeclared(name, *departure, other, *other_departure);
                    found.entry(*log).or_insert_with(fault);
                }
            }
        }
        found.into_values().collect()
    }
}
