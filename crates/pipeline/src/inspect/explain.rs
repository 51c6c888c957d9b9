//! One stored estimate with its settings, recomputed from its log.

use ingest::ActuatorChannels;
use job::Config;
use job::flight_log::{FlightLog, catch_panic};
use records::{Diagnostic, GapEstimate, GapRecord, Installations, Status};
use serde_json::{Value, json};
use store::{Query, Store};

use crate::error::Error;
use crate::logs::discover;

/// A record, and its recomputation.
#[derive(Debug)]
#[expect(missing_docs, reason = "each field is named for what it holds")]
pub struct Explanation {
    pub record: GapRecord,
    /// The recomputation, or why there is none.
    pub replayed: Result<Recomputation, Diagnostic>,
    pub verdict: ReplayVerdict,
    config_digest: String,
}

impl Explanation {
    /// Whether the record is reproduced, or its settings changed, so that it cannot be compared.
    pub fn is_sound(&self) -> bool {
        matches!(self.verdict, ReplayVerdict::Same | ReplayVerdict::OtherSettings)
    }

    /// Whether the settings of the record are those of the configuration.
    pub fn has_current_settings(&self) -> bool {
        self.config_digest == self.record.provenance.config_digest
    }

    /// Record, remedy, settings and result of the recomputation, SI.
    pub fn to_json(&self, config: &Config) -> Value {
        let digest = self.config_digest.as_str();
        let is_current = self.has_current_settings();
        let part = config.document.part.get(self.record.part_number.as_str());
        json!({
            "record": self.record,
            "remedy": remedy(&self.record.estimate),
            "settings": { "part": part, "config_digest": digest, "is_current": is_current },
            "replay": {
                "verdict": <&str>::from(self.verdict),
                "says": self.verdict.to_string(),
                "error": self.replayed.as_ref().err(),
            },
        })
    }
}

/// Remedy of a rejected estimate.
pub fn remedy(estimate: &GapEstimate) -> Option<&'static str> {
    let code = estimate.reason.as_deref().filter(|_| estimate.status == Status::Refused);
    code.and_then(job::rejection::remedy)
}

/// Explains the one record of a store that a query selects, usually by flight and position.
///
/// # Errors
/// When the store cannot be read, or the query selects no record or several.
pub fn explain(
    config: &Config,
    installations: &Installations,
    store: &Store,
    query: &Query,
) -> Result<Explanation, Error> {
    let record = find(query, store)?;
    let replayed = replay(&record, config, installations);
    let flight = &record.flight;
    let installed = installations.installed_at(&flight.tail_number, &record.position, flight.departure_utc);
    let part = installed.map_or(&record.part_number, |installation| &installation.part_number);
    let config_digest = config.digest(&flight.tail_number, part).to_string();
    let verdict = ReplayVerdict::of(&record, &replayed, &config_digest);
    Ok(Explanation { record, replayed, verdict, config_digest })
}

fn find(query: &Query, store: &Store) -> Result<GapRecord, Error> {
    let mut found = store.records(query)?;
    let named = |name: &Option<String>| name.clone().unwrap_or_default();
    let (flight, position) = (named(&query.flight_id), named(&query.position));
    let (what, hint) = match found.as_slice() {
        [_] => return Ok(found.remove(0)),
        [] => {
            let tail = query.tail_number.as_ref().map(|tail| format!(" of tail {tail}")).unwrap_or_default();
            let what = format!("no record of {position} in flight {flight}{tail}");
            (what, format!("list its records with `freeplay query flight {flight}`"))
        }
        [.., last] => {
            let (count, last) = (found.len(), &last.flight);
            let (tail, time) = (&last.tail_number, last.departure_utc.strftime("%Y-%m-%dT%H:%M:%SZ"));
            let what = format!("{count} flights are named {flight}; the latest is of {tail}, {time}");
            let hint =
                format!("select one with `--tail {tail} --since {time}`, and `--until` for an earlier one");
            (what, hint)
        }
    };
    Err(Error::refused(Diagnostic::new("no_such_record", what).hint(hint)))
}

/// Result of recomputing a record.
#[derive(Debug)]
pub struct Recomputation {
    digest: String,
    /// Channels of the actuator; `None` when the log lacks one.
    pub channels: Option<ActuatorChannels>,
    estimate: GapEstimate,
}

fn replay(
    record: &GapRecord,
    config: &Config,
    installations: &Installations,
) -> Result<Recomputation, Diagnostic> {
    let log_path = &record.provenance.log_path;
    let files = discover::stored_log(config, log_path);
    catch_panic(log_path, || {
        let opened = FlightLog::open(&files, log_path, config, installations)?;
        let at = opened.actuator_at(record.position.as_str())?;
        let (_, part) = opened.unit(at)?;
        let (estimate, channels) = opened.estimate(at, part)?;
        Ok(Recomputation { digest: opened.digest, channels, estimate })
    })
}

/// Whether a record is reproduced.
#[derive(Debug, Clone, Copy, PartialEq, Eq, strum::IntoStaticStr)]
#[strum(serialize_all = "snake_case")]
#[expect(missing_docs, reason = "each variant's text is below")]
pub enum ReplayVerdict {
    Same,
    OtherSettings,
    OtherLog,
    /// Same log and settings, but another number.
    OtherNumber,
    NotReplayed,
}

impl ReplayVerdict {
    fn of(record: &GapRecord, replayed: &Result<Recomputation, Diagnostic>, digest: &str) -> Self {
        let Ok(replayed) = replayed else { return Self::NotReplayed };
        if replayed.digest != record.provenance.log_digest {
            Self::OtherLog
        } else if digest != record.provenance.config_digest {
            Self::OtherSettings
        } else if in_bits(&replayed.estimate) == in_bits(&record.estimate) {
            Self::Same
        } else {
            Self::OtherNumber
        }
    }
}

impl std::fmt::Display for ReplayVerdict {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Same => "recomputed: bit-identical",
            Self::OtherSettings => "settings changed since; `freeplay run` will recompute it",
            Self::OtherLog => "the log changed since; `freeplay run` will recompute it",
            Self::OtherNumber => "recomputed value differs: please report this with the log",
            Self::NotReplayed => "could not be recomputed",
        })
    }
}

/// JSON form of an estimate, for bitwise comparison: numbers are written so that they read back unchanged.
fn in_bits(estimate: &GapEstimate) -> Value {
    serde_json::to_value(estimate).unwrap_or_default()
}
