//! Message of an alert: one JSON document, made once and sent unchanged in every attempt.

use std::collections::BTreeMap;

use job::config::alerts::NOT_ASSESSED;
use records::TrendRow;
use records::sanitize::escape_cell;
use serde_json::{Value, json};

use crate::findings::finding::{Finding, GAP};

/// Version of the message: it is raised when a key changes its meaning.
const VERSION: u32 = 1;
/// Units listed in the summary of a baseline.
const MAX_LISTED: usize = 50;

/// Word of a state in messages.
pub(super) fn word(state: Option<&str>) -> &str {
    state.unwrap_or(NOT_ASSESSED)
}

/// Name of a unit as text of one line.
pub(super) fn unit_text(part: Option<&str>, serial: &str) -> String {
    let name = part.map_or_else(|| serial.to_owned(), |part| format!("{part} / {serial}"));
    escape_cell(&name).into_owned()
}

pub(super) fn change(id: &str, from: Option<&str>, to: &Finding, run_id: &str) -> String {
    let mut message = unit_fields(to);
    message["freeplay_alert"] = json!(VERSION);
    message["id"] = json!(id);
    message["kind"] = json!("change");
    message["text"] = json!(change_text(from, to));
    message["from"] = json!(word(from));
    message["to"] = json!(word(to.state));
    message["cause"] = json!(to.cause);
    message["run_id"] = json!(run_id);
    message.to_string()
}

/// Summary of the states that are known when alerts begin.
pub(super) fn baseline(id: &str, known: &[&Finding], selected: &[&Finding], run_id: &str) -> String {
    let mut states = BTreeMap::<&str, usize>::new();
    known.iter().for_each(|finding| *states.entry(word(finding.state)).or_default() += 1);
    let text = format!(
        "Units known when alerts begin: {}; findings in a selected state: {}. From now on, changes are sent.",
        known.len(),
        selected.len()
    );
    json!({
        "freeplay_alert": VERSION,
        "id": id,
        "kind": "baseline",
        "text": text,
        "states": states,
        "units": selected.iter().take(MAX_LISTED).map(|f| unit_fields(f)).collect::<Vec<_>>(),
        "units_left_out": selected.len().saturating_sub(MAX_LISTED),
        "run_id": run_id,
    })
    .to_string()
}

fn unit_fields(finding: &Finding) -> Value {
    let row = finding.assessment.as_ref();
    json!({
        "part_number": finding.unit.0,
        "serial_number": finding.serial_number(),
        "tail_number": finding.tail_number,
        "position": finding.position,
        "quantity": finding.quantity,
        "state": word(finding.state),
        "reason": finding.reason,
        "statement": row.map(TrendRow::statement_text),
        "due_utc": row.and_then(|row| row.due_utc),
        "since_utc": finding.since_utc,
        "as_of_utc": finding.as_of_utc,
        "gap_m": row.and_then(|row| row.gap_m),
        "limit_m": row.and_then(|row| row.limit_m),
        "not_before_utc": row.and_then(|row| row.not_before_utc),
        "likely_utc": row.and_then(|row| row.likely_utc),
        "work_request": finding.work_request,
    })
}

/// One line for people.
fn change_text(from: Option<&str>, to: &Finding) -> String {
    let place = match (&to.tail_number, &to.position) {
        (Some(tail), Some(position)) => format!(" on {tail} {position}"),
        (Some(tail), None) => format!(" on {tail}"),
        _ => String::new(),
    };
    let quantity = if to.quantity == GAP { String::new() } else { format!("{} ", to.quantity) };
    let due = to.assessment.as_ref().and_then(TrendRow::due_text);
    let due = due.map(|due| format!(", due {due}")).unwrap_or_default();
    let why = to.assessment.as_ref().map(TrendRow::statement_text).or_else(|| to.reason.clone());
    let why = why.map(|why| format!(" ({why})")).unwrap_or_default();
    let name = match (to.serial_number(), &to.tail_number) {
        (Some(serial), _) => format!("{}{place}", unit_text(to.unit.0.as_deref(), serial)),
        (None, Some(tail)) => format!("all of {tail}"),
        (None, None) => format!("all of {}", to.unit.0.as_deref().unwrap_or_default()),
    };
    let cause = to.cause.as_deref().map(|cause| format!("; cause: {cause}")).unwrap_or_default();
    let text = format!("{name}: {quantity}{} → {}{due}{why}{cause}", word(from), word(to.state));
    escape_cell(&text).into_owned()
}
