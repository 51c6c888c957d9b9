//! `store alerts`: changes of state and what became of their messages.

use std::collections::BTreeSet;

use job::Config;
use pipeline::findings::finding::GAP;
use records::{AlertRecord, AlertStatus};
use store::Store;

use crate::args::RowFormatArgs;
use crate::table::{self, count, number, or_dash, text, unit_name};
use crate::{Code, Failure, Output, row_output};

pub(crate) fn alerts(
    store: &Store,
    is_unsent: bool,
    format: &RowFormatArgs,
    output: &Output,
) -> Result<Code, Failure> {
    let mut found = store.alerts()?;
    // Rows without a channel: a change is listed unless its messages are; the states of a baseline are not listed.
    let messages: BTreeSet<String> =
        found.iter().filter(|row| !row.channel.is_empty()).map(|row| row.alert_id.clone()).collect();
    found
        .retain(|row| !row.channel.is_empty() || (row.kind == "change" && !messages.contains(&row.alert_id)));
    if is_unsent {
        found.retain(|row| row.status.is_unsent());
    }
    row_output::write_rows(format, output, || row_output::batch(&found), || page(&found))?;
    Ok(Code::Success)
}

/// Drops the unsent messages of a channel; if another channel is given, the next run sends them through that one.
///
/// # Errors
/// If the store cannot be read or written, the other channel is not configured, or no message is unsent.
pub(crate) fn drop_unsent(
    store: &Store,
    config: &Config,
    channel: &str,
    to: Option<&str>,
    output: &Output,
) -> Result<Code, Failure> {
    let channels = &config.document.alerts;
    if let Some(to) = to.filter(|to| !channels.contains_key(*to) || *to == channel) {
        let what = format!("no other channel `{to}` is configured");
        let known: Vec<&str> = channels.keys().map(String::as_str).collect();
        return Err(Failure::usage("no_such_alert", what, &format!("channels are {}", known.join(", "))));
    }
    let mut writer = store.lock(None)?;
    let rows = store.alerts()?;
    let is_known = |id: &str| rows.iter().any(|row| row.alert_id == id && Some(row.channel.as_str()) == to);
    let unsent = rows.iter().filter(|row| row.channel == channel && row.status.is_unsent());
    let dropped: Vec<AlertRecord> =
        unsent.map(|row| AlertRecord { status: AlertStatus::Dropped, ..row.clone() }).collect();
    if dropped.is_empty() {
        let what = format!("no unsent message of a channel `{channel}`");
        return Err(Failure::usage("no_such_alert", what, "`freeplay store alerts --unsent` lists them"));
    }
    let due = |to: &str| -> Vec<AlertRecord> {
        let moved = dropped.iter().filter(|row| !is_known(&row.alert_id)).cloned();
        let status = AlertStatus::Pending;
        moved
            .map(|row| AlertRecord { channel: to.to_owned(), status, attempts: 0, error: None, ..row })
            .collect()
    };
    let due = to.map(due).unwrap_or_default();
    let sends = to.map(|to| format!("; the next run sends {} through `{to}`", due.len())).unwrap_or_default();
    let dropped_count = count(dropped.len(), "message");
    writer.write_alerts(&[dropped, due].concat())?;
    output.write_result(&format!("took back {dropped_count} of `{channel}`{sends}\n"))?;
    Ok(Code::Success)
}

pub(crate) fn resend(store: &Store, id: &str, output: &Output) -> Result<Code, Failure> {
    let mut writer = store.lock(None)?;
    let mut rows = store.alerts()?;
    rows.retain(|row| row.alert_id == id && row.status == AlertStatus::Unconfirmed);
    if rows.is_empty() {
        let what = format!("no unconfirmed message of an alert `{id}`");
        return Err(Failure::usage("no_such_alert", what, "`freeplay store alerts --unsent` lists them"));
    }
    rows.iter_mut().for_each(|row| row.status = AlertStatus::Pending);
    writer.write_alerts(&rows)?;
    output.write_result(&format!("the next run sends {} of {id} again\n", count(rows.len(), "message")))?;
    Ok(Code::Success)
}

fn page(found: &[AlertRecord]) -> String {
    if found.is_empty() {
        return "no alert\n".to_owned();
    }
    let word = |state: &Option<String>| state.clone().unwrap_or_else(|| "not assessed".to_owned());
    let change = |row: &AlertRecord| {
        let change = format!("{} → {}", word(&row.from_state), word(&row.to_state));
        match row.kind.as_str() {
            "change" if row.quantity == GAP => change,
            "change" => format!("{}: {change}", row.quantity),
            kind => kind.to_owned(),
        }
    };
    let unit = |row: &AlertRecord| match (&row.serial_number, &row.part_number) {
        (Some(serial), part) => unit_name(part.as_deref(), serial),
        (None, part) => or_dash(part.as_deref()),
    };
    let channel = |row: &AlertRecord| Some(row.channel.clone()).filter(|channel| !channel.is_empty());
    let columns: &table::Columns<'_, AlertRecord> = &[
        (text("alert", 2), &|r| r.alert_id.clone()),
        (text("part / serial", 0), &unit),
        (text("tail", 3), &|r| or_dash(r.tail_number.as_deref())),
        (text("change", 0), &change),
        (text("channel", 0), &|r| or_dash(channel(r).as_deref())),
        (text("status", 0), &|r| r.status.as_str().to_owned()),
        (number("attempts", 4), &|r| r.attempts.to_string()),
        (text("error", 5), &|r| or_dash(r.error.as_deref())),
    ];
    count(found.len(), "row") + "\n" + &table::of(found, columns)
}
