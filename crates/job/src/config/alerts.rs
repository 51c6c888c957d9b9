//! `[alerts.NAME]`: where a change of state is sent.

use std::time::Duration;

use records::Diagnostic;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_with::skip_serializing_none;
use smart_default::SmartDefault;

use super::keys::with_nearest;
use super::layers::{Faults, fits};

/// States of quantities other than the gap: of a unit, of a tail, of a part.
pub const QUANTITY_STATES: [&str; 11] = [
    "softening",
    "stiffening",
    "friction_rising",
    "friction_falling",
    "lost_motion_rising",
    "delay_moved",
    "load_zero_moved",
    "load_delay_moved",
    "innovations_moved",
    "recorder_moved",
    "settings_moved",
];

/// Word for a removed unit in `states` and in messages; in older configurations for an unassessed one as well.
pub const NOT_ASSESSED: &str = "not_assessed";

/// Longest time limit of one message, s: a run waits for it.
const MAX_TIMEOUT_S: f64 = 600.0;

/// `[alerts.NAME]`: a receiver of changes of state; it has one of `command`, `folder` and `url`.
#[skip_serializing_none]
#[derive(Debug, Clone, PartialEq, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct AlertChannel {
    /// Program and arguments, without a shell; it gets the message as JSON on standard input. Exit code 0 means sent.
    pub command: Option<Vec<String>>,
    /// Environment variables that `command` gets in addition to `PATH`, `HOME`, `LANG` and a few others.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub pass_environment: Vec<String>,
    /// Folder that gets one JSON file per message, named after the alert's `id`.
    pub folder: Option<String>,
    /// Address that the message is posted to as JSON. An answer of 200 to 299 means sent.
    pub url: Option<String>,
    /// New states that are sent: those of the gap and of other quantities, and `not_assessed` (removed, or
    /// unassessed). Default: all but `normal` and `not_assessed`.
    #[default(default_states())]
    pub states: Vec<String>,
    /// Only these part numbers, with `*` and `?`.
    pub parts: Vec<String>,
    /// Only these tail numbers, with `*` and `?`.
    pub tails: Vec<String>,
    /// Time limit of one message, s; at most 600. Default 30.
    #[default = 30.0]
    pub timeout_s: f64,
    /// Whether a message that may have been received is sent again, with the same `id`. Default false.
    pub resend_unconfirmed: bool,
    /// Whether messages are sent. Default true.
    #[default = true]
    pub enabled: bool,
}

fn default_states() -> Vec<String> {
    ["watch", "unassessed", "plan", "act"].into_iter().chain(QUANTITY_STATES).map(str::to_owned).collect()
}

impl AlertChannel {
    /// Whether a unit's change to a state is sent: state, part and tail are selected.
    pub fn selects(&self, state: Option<&str>, part: Option<&str>, tail: Option<&str>) -> bool {
        let word = state.unwrap_or(NOT_ASSESSED);
        let is_unassessed = state.is_none_or(|state| state == trend::State::Unassessed.as_str());
        self.states.iter().any(|wanted| wanted == word || (is_unassessed && wanted == NOT_ASSESSED))
            && is_among(&self.parts, part)
            && is_among(&self.tails, tail)
    }

    /// Time limit of one message.
    pub fn timeout(&self) -> Duration {
        Duration::from_secs_f64(self.timeout_s.clamp(1e-3, MAX_TIMEOUT_S))
    }

    pub(super) fn check(&self, name: &str, faults: &mut Faults<'_>) {
        let mut report =
            |key: &[&str], what: String, hint: &str| faults.wrong(key, "alert_channel", what, hint);
        let targets = [self.command.is_some(), self.folder.is_some(), self.url.is_some()];
        if targets.iter().filter(|given| **given).count() != 1 {
            let what = format!("`alerts.{name}` needs one of `command`, `folder` and `url`");
            report(&[], what, "folder = \"alerts\"");
        }
        if self.command.as_ref().is_some_and(|words| words.first().is_none_or(String::is_empty)) {
            let what = format!("`alerts.{name}.command` names no program");
            report(&["command"], what, "command = [\"/usr/local/bin/notify\"]");
        }
        if self.folder.as_ref().is_some_and(|folder| folder.is_empty() || object_io::is_address(folder)) {
            let what = format!("`alerts.{name}.folder` is not a local folder");
            report(&["folder"], what, "folder = \"alerts\"");
        }
        if let Some(detail) = self.url.as_ref().and_then(|url| object_io::check_url(url).err()) {
            let what = format!("`alerts.{name}.url` is not an address of HTTP: {detail}");
            report(&["url"], what, "write it as https://HOST/PATH");
            // The address may hold a secret: the line of the file is not quoted.
            if let Some(fault) = faults.found.last_mut() {
                fault.text = None;
            }
        }
        for (key, texts) in [("parts", &self.parts), ("tails", &self.tails)] {
            texts.iter().for_each(|text| drop(faults.pattern(&[key], text, "name pattern")));
        }
        let of_gap = trend::State::ALL.map(trend::State::as_str);
        let known: Vec<&str> = of_gap.into_iter().chain([NOT_ASSESSED]).chain(QUANTITY_STATES).collect();
        for state in self.states.iter().filter(|state| !known.contains(&state.as_str())) {
            let fault = Diagnostic::new("unknown_state", format!("`{state}` is not a state of a unit"));
            let states = format!("states are {}", known.join(", "));
            faults.report(&["states"], with_nearest(fault, state, known.iter().copied(), states));
        }
    }
}

fn is_among(patterns: &[String], name: Option<&str>) -> bool {
    patterns.is_empty() || name.is_some_and(|name| patterns.iter().any(|pattern| fits(pattern, name)))
}
