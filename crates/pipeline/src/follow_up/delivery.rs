//! Delivery of alerts: each message is claimed in the store, sent, and marked.
//!
//! ```text
//! pending ──claim──→ sending ──send──→ sent
//!    ↑                 │ │
//!    └── not received ─┘ └── killed, or no answer ──→ unconfirmed
//! ```
//!
//! A run that is killed between claim and mark leaves `sending`. The next run makes it `unconfirmed`, since the
//! receiver may have the message; or it sends the message again, where the channel drops doubles.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use jiff::Timestamp;
use records::{AlertRecord, AlertStatus};

use crate::follow_up::alert_changes::Channels;

/// Failures in a row after which a channel is left until the next run.
const MAX_FAILURES: usize = 3;
/// Time after which a channel is left until the next run.
const MAX_CHANNEL_TIME: Duration = Duration::from_secs(300);

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

/// What a delivery did, by message.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Delivery {
    /// Messages that were accepted.
    pub sent: usize,
    /// Messages that were not accepted, and why: the next run sends them again.
    pub failed: Vec<AlertRecord>,
    /// Messages that may have been received, new in this run.
    pub unconfirmed: Vec<AlertRecord>,
    /// Messages that earlier runs left unconfirmed, and that are not sent again.
    pub unconfirmed_before: usize,
    /// Messages left for the next run without an attempt.
    pub waiting: usize,
}

/// Where rows are written, and how messages are sent.
pub trait Courier {
    /// Error of the store.
    type Error;

    /// Writes a row; it is durable when the call returns.
    ///
    /// # Errors
    /// When the store cannot be written.
    fn write(&mut self, row: &AlertRecord) -> Result<(), Self::Error>;

    /// Sends the message of a row.
    fn send(&mut self, row: &AlertRecord) -> Attempt;

    /// Whether the run must end soon.
    fn is_stopped(&self) -> bool;
}

/// Sends every message that is due in a configured channel, oldest attempt first.
///
/// # Errors
/// When the store cannot be written; what was not marked is `sending`.
pub fn deliver<C: Courier>(
    rows: Vec<AlertRecord>,
    channels: &Channels,
    run_id: &str,
    courier: &mut C,
) -> Result<Delivery, C::Error> {
    let mut delivery = Delivery::default();
    let mut due = BTreeMap::<String, Vec<AlertRecord>>::new();
    for mut row in rows {
        let Some(channel) = channels.get(&row.channel).filter(|channel| channel.enabled) else { continue };
        // A file of one name is written once, whatever happens.
        let is_repeatable = channel.resend_unconfirmed || channel.folder.is_some();
        let is_cut = row.status == AlertStatus::Sending;
        if is_cut && !is_repeatable {
            row.error = Some("the run was killed while the message was sent".to_owned());
            mark(&mut row, AlertStatus::Unconfirmed, run_id, courier)?;
            delivery.unconfirmed.push(row);
        } else if is_cut
            || row.status == AlertStatus::Pending
            || (row.status == AlertStatus::Unconfirmed && is_repeatable)
        {
            due.entry(row.channel.clone()).or_default().push(row);
        } else if row.status == AlertStatus::Unconfirmed {
            delivery.unconfirmed_before += 1;
        }
    }
    for mut rows in due.into_values() {
        // A message that always fails must not keep others back.
        rows.sort_by(|a, b| {
            (a.attempts, a.as_of_utc, a.change_number, &a.alert_id).cmp(&(
                b.attempts,
                b.as_of_utc,
                b.change_number,
                &b.alert_id,
            ))
        });
        deliver_channel(rows, run_id, courier, &mut delivery)?;
    }
    Ok(delivery)
}

fn deliver_channel<C: Courier>(
    rows: Vec<AlertRecord>,
    run_id: &str,
    courier: &mut C,
    delivery: &mut Delivery,
) -> Result<(), C::Error> {
    let (begun, mut failures) = (Instant::now(), 0);
    for mut row in rows {
        if failures == MAX_FAILURES || begun.elapsed() > MAX_CHANNEL_TIME || courier.is_stopped() {
            delivery.waiting += 1;
            continue;
        }
        row.attempts += 1;
        row.error = None;
        mark(&mut row, AlertStatus::Sending, run_id, courier)?;
        let (status, error) = match courier.send(&row) {
            Attempt::Sent => (AlertStatus::Sent, None),
            Attempt::NotSent(why) => (AlertStatus::Pending, Some(why)),
            Attempt::Unknown(why) => (AlertStatus::Unconfirmed, Some(why)),
        };
        failures = if error.is_some() { failures + 1 } else { 0 };
        row.error = error;
        mark(&mut row, status, run_id, courier)?;
        match status {
            AlertStatus::Sent => delivery.sent += 1,
            AlertStatus::Unconfirmed => delivery.unconfirmed.push(row),
            _ => delivery.failed.push(row),
        }
    }
    Ok(())
}

fn mark<C: Courier>(
    row: &mut AlertRecord,
    status: AlertStatus,
    run_id: &str,
    courier: &mut C,
) -> Result<(), C::Error> {
    row.status = status;
    run_id.clone_into(&mut row.run_id);
    row.recorded_utc = Timestamp::now();
    courier.write(row)
}
