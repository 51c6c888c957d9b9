//! JSON-lines log on stderr, for log collectors.

use std::collections::BTreeMap;

use jiff::Timestamp;
use pipeline::Event;
use records::Diagnostic;
use serde::Serialize;
use serde_json::{Value, json};

#[derive(Serialize)]
struct LogLine<'a> {
    time_utc: Timestamp,
    level: &'a str,
    event: &'a str,
    #[serde(flatten)]
    rest: BTreeMap<String, Value>,
}

fn line(level: &str, event: &str, rest: Value) -> String {
    let rest = match rest {
        Value::Object(fields) => fields.into_iter().filter(|(_, value)| !value.is_null()).collect(),
        _ => BTreeMap::new(),
    };
    // Text and numbers always have a JSON form.
    serde_json::to_string(&LogLine { time_utc: Timestamp::now(), level, event, rest }).unwrap_or_default()
}

pub(crate) fn note(text: &str) -> String {
    line("info", "note", json!({ "message": text }))
}

pub(crate) fn diagnostic(diagnostic: &Diagnostic) -> String {
    line("error", "complaint", serde_json::to_value(diagnostic).unwrap_or_default())
}

pub(crate) fn event(event: &Event) -> String {
    match event {
        Event::Planned { logs, bytes } => line("info", "planned", json!({ "logs": logs, "bytes": bytes })),
        Event::Started { log } => line("debug", "log_started", json!({ "log": log })),
        Event::Finished { log, bytes, estimated, refused, diagnostics } => {
            let codes: Vec<&str> = diagnostics.iter().map(|diagnostic| diagnostic.code.as_str()).collect();
            let level = if codes.is_empty() { "info" } else { "error" };
            let what = json!({ "log": log, "bytes": bytes, "estimated": estimated, "refused": refused, "codes": codes });
            line(level, "log_finished", what)
        }
        Event::Stored { logs } => line("info", "stored", json!({ "logs": logs })),
        Event::Trends { units } => line("info", "trends", json!({ "units": units })),
    }
}
