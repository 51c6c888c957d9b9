//! `[alerts.NAME]`: where a change of state is sent.

use std::time::Duration;

use records::Diagnostic;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_with::skip_serializing_none;

use super::keys::with_nearest;
use super::layers::Source;

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
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
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
    pub states: Vec<String>,
    /// Only these part numbers, with `*` and `?`.
    pub parts: Vec<String>,
    /// Only these tail numbers, with `*` and `?`.
    pub tails: Vec<String>,
    /// Time limit of one message, s; at most 600. Default 30.
    pub timeout_s: f64,
    /// Whether a message that may have been received is sent again, with the same `id`. Default false.
    pub resend_unconfirmed: bool,
    /// Whether messages are sent. Default true.
    pub enabled: bool,
}

impl Default for AlertChannel {
    fn default() -> Self {
        Self {
            command: None,
            pass_environment: Vec::new(),
            folder: None,
            url: None,
            states: default_states(),
            parts: Vec::new(),
            tails: Vec::new(),
            timeout_s: 30.0,
            resend_unconfirmed: false,
            enabled: true,
        }
    }
}

/// Every state that a person should know of.
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

    /// Everything about the channel that cannot be meant.
    pub(super) fn check(&self, name: &str, source: &Source<'_>, found: &mut Vec<Diagnostic>) {
        let targets = [self.command.is_some(), self.folder.is_some(), self.url.is_some()];
        if targets.iter().filter(|given| **given).count() != 1 {
            let what = format!("`alerts.{name}` needs one of `command`, `folder` and `url`");
            let c = Diagnostic::new("alert_channel", what).hint("folder = \"alerts\"");
            found.push(source.at(&["alerts", name], c));
        }
        if self.command.as_ref().is_some_and(|words| words.first().is_none_or(String::is_empty)) {
            let c = Diagnostic::new("alert_channel", format!("`alerts.{name}.command` names no program"));
            found.push(
                source.at(&["alerts", name, "command"], c.hint("command = [\"/usr/local/bin/notify\"]")),
            );
        }
        if self.folder.as_ref().is_some_and(|folder| folder.is_empty() || object_io::is_address(folder)) {
            let c = Diagnostic::new("alert_channel", format!("`alerts.{name}.folder` is not a local folder"));
            found.push(source.at(&["alerts", name, "folder"], c.hint("folder = \"alerts\"")));
        }
        if let Some(detail) = self.url.as_ref().and_then(|url| object_io::check_url(url).err()) {
            // The address may hold a secret: the line of the file is not quoted.
            let what = format!("`alerts.{name}.url` is not an address of HTTP: {detail}");
            let c = Diagnostic::new("alert_channel", what).hint("write it as https://HOST/PATH");
            found.push(Diagnostic { text: None, ..source.at(&["alerts", name, "url"], c) });
        }
        for (key, texts) in [("parts", &self.parts), ("tails", &self.tails)] {
            for (text, e) in texts.iter().filter_map(|text| Some((text, glob::Pattern::new(text).err()?))) {
                let what = format!("`{text}` is not a valid name pattern: {e}");
                found.push(source.at(&["alerts", name, key], Diagnostic::new("bad_pattern", what)));
            }
        }
        let of_gap = trend::State::ALL.map(trend::State::as_str);
        let known: Vec<&str> = of_gap.into_iter().chain([NOT_ASSESSED]).chain(QUANTITY_STATES).collect();
        for state in self.states.iter().filter(|state| !known.contains(&state.as_str())) {
            let c = Diagnostic::new("unknown_state", format!("`{state}` is not a state of a unit"));
            let c = with_nearest(c, state, known.iter().copied(), format!("states are {}", known.join(", ")));
            found.push(source.at(&["alerts", name, "states"], c));
        }
    }
}

/// Whether a name fits one of the patterns, or there is none.
fn is_among(patterns: &[String], name: Option<&str>) -> bool {
    let fits =
        |pattern: &String, name| glob::Pattern::new(pattern).is_ok_and(|pattern| pattern.matches(name));
    patterns.is_empty() || name.is_some_and(|name| patterns.iter().any(|pattern| fits(pattern, name)))
}
