//! Changes of state since the last one that the alert table has, and the messages that are due.
//!
//! A change is relative to the table, not to a run: a run that is killed before the change is written finds it again,
//! a run that is repeated finds none, and a state that leaves and returns within one back-fill is no change.

use std::collections::{BTreeMap, BTreeSet};

use jiff::{SignedDuration, Timestamp};
use job::config::AlertChannel;
use records::{AlertRecord, AlertStatus};

use crate::findings::alert_message;
use crate::findings::finding::{Finding, GAP, UNCHANGED};

/// Channels by name.
pub type Channels = BTreeMap<String, AlertChannel>;

const CHANGE: &str = "change";
const BASELINE: &str = "baseline";

/// Changes of one tail or part in one quantity within these days are one: later flights can move its date.
const SAME_CHANGE: SignedDuration = SignedDuration::from_hours(24 * 14);

/// Rows of changes by part number, serial number and quantity; those of a tail or part have no serial number.
type KnownChanges<'a> = BTreeMap<(Option<&'a str>, Option<&'a str>, &'a str), Vec<&'a AlertRecord>>;

/// Rows to write for the findings of a run: one for each change, and one for each message that is due.
///
/// Without any known state the rows are the baseline, and each channel gets one summary.
pub fn detect(
    known: &[AlertRecord],
    findings: &[Finding],
    channels: &Channels,
    run_id: &str,
    now: Timestamp,
) -> Vec<AlertRecord> {
    let mut changes = KnownChanges::new();
    for row in known.iter().filter(|row| row.status == AlertStatus::Recorded) {
        let key = (row.part_number.as_deref(), row.serial_number.as_deref(), row.quantity.as_str());
        changes.entry(key).or_default().push(row);
    }
    if changes.is_empty() {
        return baseline(findings, channels, run_id, now);
    }
    let mut rows = Vec::new();
    let gone = without_flights(&changes, findings);
    for finding in findings.iter().chain(&gone) {
        let key = (finding.unit.0.as_deref(), finding.serial_number(), finding.quantity);
        let of_finding = changes.get(&key).map_or(&[][..], Vec::as_slice);
        let Some((number, from)) = before(of_finding, finding) else { continue };
        let id = change_id(finding, number + 1, from);
        let change = row(&id, CHANGE, number + 1, from, finding, run_id, now);
        let message = alert_message::change(&id, from, finding, run_id);
        for (name, _) in channels.iter().filter(|(_, channel)| selects(channel, finding)) {
            rows.push(pending(&change, name, &message));
        }
        rows.push(change);
    }
    rows
}

/// Units whose gap has a known state, and of which no flight is left: they are not assessed any more.
fn without_flights(changes: &KnownChanges<'_>, findings: &[Finding]) -> Vec<Finding> {
    let Some(as_of_utc) = findings.first().map(|finding| finding.as_of_utc) else { return Vec::new() };
    let gaps = findings.iter().filter(|finding| finding.quantity == GAP);
    let present: BTreeSet<_> =
        gaps.map(|finding| (finding.unit.0.as_deref(), finding.unit.1.as_str())).collect();
    let gone = changes.iter().filter_map(|((part, serial, quantity), rows)| {
        let unit = (*part, (*serial)?);
        let last = rows.iter().max_by_key(|row| row.change_number).filter(|last| last.to_state.is_some())?;
        (*quantity == GAP && !present.contains(&unit)).then(|| Finding {
            unit: (part.map(str::to_owned), unit.1.to_owned()),
            tail_number: last.tail_number.clone(),
            position: last.position.clone(),
            quantity: GAP,
            reason: Some("no flight of it is left: see the installations table".to_owned()),
            as_of_utc,
            ..Finding::default()
        })
    });
    gone.collect()
}

/// Number and state of the last of the known changes, unless the finding is known.
fn before<'a>(known: &[&'a AlertRecord], finding: &Finding) -> Option<(i64, Option<&'a str>)> {
    let Some(since_utc) = finding.since_utc else {
        return match known.iter().max_by_key(|row| row.change_number) {
            Some(last) => {
                let state = last.to_state.as_deref();
                let is_calm = matches!(finding.state, Some("normal" | "watch"));
                let stands = state == Some("plan") && is_calm && finding.is_near_plan;
                (state != finding.state && !stands).then_some((last.change_number, state))
            }
            // A unit that is not assessed and was not known, or a quantity that never changed, is no change.
            None => finding.is_noteworthy().then_some((0, None)),
        };
    };
    let of_place = || known.iter().filter(|row| row.tail_number == finding.tail_number);
    let is_same = |at: Timestamp| since_utc.duration_since(at).abs() <= SAME_CHANGE;
    let is_known = of_place().any(|row| row.since_utc.is_some_and(is_same));
    let number = of_place().map(|row| row.change_number).max().unwrap_or(0);
    (!is_known).then_some((number, Some(UNCHANGED)))
}

fn selects(channel: &AlertChannel, finding: &Finding) -> bool {
    let (part, tail) = (finding.unit.0.as_deref(), finding.tail_number.as_deref());
    channel.enabled && channel.selects(finding.state, part, tail)
}

fn baseline(findings: &[Finding], channels: &Channels, run_id: &str, now: Timestamp) -> Vec<AlertRecord> {
    let is_kept = |finding: &&Finding| finding.quantity == GAP || finding.is_noteworthy();
    let state = |to: &Finding| row(&change_id(to, 0, None), BASELINE, 0, None, to, run_id, now);
    let mut rows: Vec<AlertRecord> = findings.iter().filter(is_kept).map(state).collect();
    let Some(first) = findings.first() else { return rows };
    let all: Vec<&Finding> = findings.iter().filter(|finding| finding.quantity == GAP).collect();
    for (name, channel) in channels.iter().filter(|(_, channel)| channel.enabled) {
        let selected: Vec<&Finding> = findings.iter().filter(|finding| selects(channel, finding)).collect();
        let id = identifier(first.as_of_utc, &[BASELINE, name, run_id]);
        let message = alert_message::baseline(&id, &all, &selected, run_id);
        let (quantity, as_of_utc) = (first.quantity, first.as_of_utc);
        let of_fleet = Finding { quantity, as_of_utc, ..Finding::default() };
        let summary = row(&id, BASELINE, 0, None, &of_fleet, run_id, now);
        let summary = AlertRecord { serial_number: None, ..summary };
        rows.push(pending(&summary, name, &message));
    }
    rows
}

fn row(
    id: &str,
    kind: &str,
    number: i64,
    from: Option<&str>,
    to: &Finding,
    run_id: &str,
    now: Timestamp,
) -> AlertRecord {
    AlertRecord {
        alert_id: id.to_owned(),
        kind: kind.to_owned(),
        part_number: to.unit.0.clone(),
        serial_number: to.serial_number().map(str::to_owned),
        tail_number: to.tail_number.clone(),
        position: to.position.clone(),
        quantity: to.quantity.to_owned(),
        change_number: number,
        from_state: from.map(str::to_owned),
        to_state: to.state.map(str::to_owned),
        since_utc: to.since_utc,
        as_of_utc: to.as_of_utc,
        status: AlertStatus::Recorded,
        run_id: run_id.to_owned(),
        recorded_utc: now,
        ..AlertRecord::default()
    }
}

fn pending(change: &AlertRecord, channel: &str, message: &str) -> AlertRecord {
    AlertRecord {
        channel: channel.to_owned(),
        message: Some(message.to_owned()),
        status: AlertStatus::Pending,
        ..change.clone()
    }
}

/// Identifier of a change: the same whenever it is computed from the same table.
fn change_id(to: &Finding, number: i64, from: Option<&str>) -> String {
    let number = number.to_string();
    let state = |state: Option<&str>| alert_message::word(state).to_owned();
    let part = to.unit.0.as_deref().unwrap_or_default();
    let name = to.serial_number().or(to.tail_number.as_deref()).unwrap_or_default();
    identifier(to.as_of_utc, &[part, name, to.quantity, &number, &state(from), &state(to.state)])
}

/// Date and digest: names of files sort by date, and hold no character of a name from a log.
fn identifier(at: Timestamp, parts: &[&str]) -> String {
    let mut digest = blake3::Hasher::new();
    for part in parts {
        digest.update(&(part.len() as u64).to_le_bytes());
        digest.update(part.as_bytes());
    }
    format!("{}-{}", at.strftime("%Y%m%dT%H%M%SZ"), &digest.finalize().to_hex()[..16])
}
