//! Delivery of alerts: each message is claimed in the store, sent, and marked.
//!
//! ```text
//! pending ──claim──→ sending ──send──→ sent
//!    ↑                 │ │
//!    └── not received ─┘ └── killed, or no answer ──→ unconfirmed
//! ```
//!
//! A run that is killed between claim and mark leaves `sending`. The next run makes it `unconfirmed`, since the
//! receiver may have the message. A channel that drops doubles, as a folder does, needs no claim: what was not marked
//! is sent again.

use std::collections::{BTreeMap, BTreeSet};
use std::time::{Duration, Instant};

use jiff::Timestamp;
use job::config::AlertChannel;
use records::{AlertRecord, AlertStatus};

use crate::findings::alert_changes::Channels;
use crate::findings::summary::AlertSummary;

/// Failures in a row after which a channel is left until the next run.
const MAX_FAILURES: usize = 3;
/// Attempts after which a message that is not accepted no longer holds back later ones of its unit.
const MAX_HOLDING: i64 = 5;
/// Messages of a channel without claims that are marked in one commit.
const MAX_MARKED: usize = 50;
/// Time after which a channel is left until the next run.
const MAX_CHANNEL_TIME: Duration = Duration::from_mins(5);

/// Outcome of one attempt.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Attempt {
    /// The receiver accepted the message.
    Sent,
    /// The receiver has not accepted the message.
    NotSent(String),
    /// The receiver may have the message.
    Unknown(String),
}

/// Where rows are written, and how messages are sent.
pub trait Courier {
    /// Error of the store.
    type Error;

    /// Writes rows in one commit; they are durable when the call returns.
    ///
    /// # Errors
    /// When the store cannot be written.
    fn write(&mut self, rows: &[AlertRecord]) -> Result<(), Self::Error>;

    /// Sends the message of a row through its channel.
    fn send(&mut self, channel: &AlertChannel, row: &AlertRecord) -> Attempt;

    /// Whether the run must end soon.
    fn is_stopped(&self) -> bool;
}

/// Sends every message that is due in an enabled channel, oldest attempt first, and counts the messages in `summary`.
/// Returns those that this run could not send, or that may have been received, each with its error.
///
/// # Errors
/// When the store cannot be written; what was not marked is `sending`.
pub fn deliver<C: Courier>(
    mut rows: Vec<AlertRecord>,
    channels: &Channels,
    run_id: &str,
    courier: &mut C,
    summary: &mut AlertSummary,
) -> Result<Vec<AlertRecord>, C::Error> {
    let channel_of = |row: &AlertRecord| channels.get(&row.channel).filter(|channel| channel.enabled);
    let mut killed = Vec::new();
    for row in rows.iter_mut().filter(|row| row.status == AlertStatus::Sending) {
        if channel_of(row).is_some_and(|channel| !is_repeatable(channel)) {
            row.error = Some("the run was killed while the message was sent".to_owned());
            mark(row, AlertStatus::Unconfirmed, run_id);
            killed.push(row.clone());
        }
    }
    if !killed.is_empty() {
        courier.write(&killed)?;
    }
    // A message that always fails must not keep those of other units back; those of one unit keep their order.
    let mut attempts: BTreeMap<Subject, i64> = BTreeMap::new();
    for row in &rows {
        let most = attempts.entry(subject(row)).or_default();
        *most = row.attempts.max(*most);
    }
    rows.sort_by_cached_key(|row| {
        (attempts[&subject(row)], row.as_of_utc, row.change_number, row.alert_id.clone())
    });
    for (name, channel) in channels.iter().filter(|(_, channel)| channel.enabled) {
        let due = rows.iter_mut().filter(|row| row.channel == *name && is_due(row, channel));
        send_due(due, channel, run_id, courier)?;
    }
    for row in &rows {
        match channel_of(row) {
            Some(channel) => summary.count(row, run_id, is_due(row, channel)),
            None if channels.contains_key(&row.channel) || row.status != AlertStatus::Pending => {}
            None => *summary.without_channel.entry(row.channel.clone()).or_default() += 1,
        }
    }
    rows.retain(|row| row.run_id == run_id && row.error.is_some() && channel_of(row).is_some());
    Ok(rows)
}

/// Channel, part, serial number or tail, and quantity: the last message about them says the present state.
type Subject = (String, Option<String>, Option<String>, String);

fn subject(row: &AlertRecord) -> Subject {
    let name = row.serial_number.as_ref().or(row.tail_number.as_ref());
    (row.channel.clone(), row.part_number.clone(), name.cloned(), row.quantity.clone())
}

fn is_due(row: &AlertRecord, channel: &AlertChannel) -> bool {
    match row.status {
        AlertStatus::Pending => true,
        AlertStatus::Sending | AlertStatus::Unconfirmed => is_repeatable(channel),
        _ => false,
    }
}

/// Whether a message may be sent twice, so that it needs no claim: a file of one name is written once, and some receivers
/// drop doubles.
fn is_repeatable(channel: &AlertChannel) -> bool {
    channel.resend_unconfirmed || channel.folder.is_some()
}

/// Sends messages of one channel in order. One commit marks a message and claims the next one; where no claim is needed,
/// it marks many.
fn send_due<'r, C: Courier>(
    due: impl Iterator<Item = &'r mut AlertRecord>,
    channel: &AlertChannel,
    run_id: &str,
    courier: &mut C,
) -> Result<(), C::Error> {
    let (begun, mut failures) = (Instant::now(), 0);
    let mut marked: Vec<AlertRecord> = Vec::new();
    let mut held: BTreeSet<Subject> = BTreeSet::new();
    for row in due {
        if held.contains(&subject(row)) {
            continue;
        }
        if failures == MAX_FAILURES || begun.elapsed() >= MAX_CHANNEL_TIME || courier.is_stopped() {
            break;
        }
        row.attempts += 1;
        row.error = None;
        if is_repeatable(channel) {
            if marked.len() == MAX_MARKED {
                courier.write(&std::mem::take(&mut marked))?;
            }
        } else {
            mark(row, AlertStatus::Sending, run_id);
            marked.push(row.clone());
            courier.write(&std::mem::take(&mut marked))?;
        }
        let (status, error) = match courier.send(channel, row) {
            Attempt::Sent => (AlertStatus::Sent, None),
            Attempt::NotSent(why) => (AlertStatus::Pending, Some(why)),
            Attempt::Unknown(why) => (AlertStatus::Unconfirmed, Some(why)),
        };
        failures = if error.is_some() { failures + 1 } else { 0 };
        row.error = error;
        mark(row, status, run_id);
        // Else the older message would come last, in the next run.
        if is_due(row, channel) && row.attempts < MAX_HOLDING {
            held.insert(subject(row));
        }
        marked.push(row.clone());
    }
    if marked.is_empty() { Ok(()) } else { courier.write(&marked) }
}

fn mark(row: &mut AlertRecord, status: AlertStatus, run_id: &str) {
    row.status = status;
    run_id.clone_into(&mut row.run_id);
    row.recorded_utc = Timestamp::now();
}
