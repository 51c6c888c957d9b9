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

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use jiff::Timestamp;
use job::config::AlertChannel;
use records::{AlertRecord, AlertStatus};

use crate::findings::alert_changes::Channels;
use crate::findings::summary::AlertSummary;

/// Failures in a row after which a channel is left until the next run.
const MAX_FAILURES: usize = 3;
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

/// Messages of a delivery that did not certainly arrive.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Delivery {
    /// Messages that were not accepted, and why: the next run sends them again.
    pub failed: Vec<AlertRecord>,
    /// Messages that may have been received, new in this run.
    pub unconfirmed: Vec<AlertRecord>,
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

/// Sends every message that is due in a configured channel, oldest attempt first, and counts the messages in `summary`.
///
/// # Errors
/// When the store cannot be written; what was not marked is `sending`.
pub fn deliver<C: Courier>(
    rows: Vec<AlertRecord>,
    channels: &Channels,
    run_id: &str,
    courier: &mut C,
    summary: &mut AlertSummary,
) -> Result<Delivery, C::Error> {
    let mut delivery = Delivery::default();
    let mut due = BTreeMap::<String, Vec<AlertRecord>>::new();
    for mut row in rows {
        let Some(channel) = channels.get(&row.channel) else {
            if !row.channel.is_empty() && row.status == AlertStatus::Pending {
                *summary.without_channel.entry(row.channel).or_default() += 1;
            }
            continue;
        };
        if !channel.enabled {
            continue;
        }
        match (row.status, is_repeatable(channel)) {
            (AlertStatus::Sending, false) => {
                row.error = Some("the run was killed while the message was sent".to_owned());
                mark(&mut row, AlertStatus::Unconfirmed, run_id);
                delivery.unconfirmed.push(row);
            }
            (AlertStatus::Unconfirmed, false) => summary.unconfirmed_before += 1,
            (AlertStatus::Pending | AlertStatus::Sending | AlertStatus::Unconfirmed, _) => {
                due.entry(row.channel.clone()).or_default().push(row);
            }
            _ => {}
        }
    }
    if !delivery.unconfirmed.is_empty() {
        courier.write(&delivery.unconfirmed)?;
    }
    for (name, channel) in channels {
        let Some(mut rows) = due.remove(name) else { continue };
        // A message that always fails must not keep others back.
        rows.sort_by_cached_key(|row| (row.attempts, row.as_of_utc, row.change_number, row.alert_id.clone()));
        let delivery = &mut delivery;
        ChannelDelivery { run_id, channel, courier, delivery, summary }.run(rows)?;
    }
    Ok(delivery)
}

/// Whether a message may be sent twice, so that it needs no claim: a file of one name is written once, and some receivers
/// drop doubles.
fn is_repeatable(channel: &AlertChannel) -> bool {
    channel.resend_unconfirmed || channel.folder.is_some()
}

/// Delivery of one channel.
struct ChannelDelivery<'a, C> {
    run_id: &'a str,
    channel: &'a AlertChannel,
    courier: &'a mut C,
    delivery: &'a mut Delivery,
    summary: &'a mut AlertSummary,
}

impl<C: Courier> ChannelDelivery<'_, C> {
    /// Sends messages in order. One commit marks a message and claims the next one; where no claim is needed, it
    /// marks many.
    fn run(mut self, rows: Vec<AlertRecord>) -> Result<(), C::Error> {
        let (begun, mut failures) = (Instant::now(), 0);
        let mut marked: Vec<AlertRecord> = Vec::new();
        let mut rows = rows.into_iter();
        while failures < MAX_FAILURES && begun.elapsed() < MAX_CHANNEL_TIME && !self.courier.is_stopped() {
            let Some(mut row) = rows.next() else { break };
            row.attempts += 1;
            row.error = None;
            if is_repeatable(self.channel) {
                if marked.len() == MAX_MARKED {
                    self.courier.write(&std::mem::take(&mut marked))?;
                }
            } else {
                mark(&mut row, AlertStatus::Sending, self.run_id);
                marked.push(row.clone());
                self.courier.write(&std::mem::take(&mut marked))?;
            }
            self.send(&mut row);
            failures = if row.error.is_some() { failures + 1 } else { 0 };
            marked.push(row);
        }
        self.summary.waiting += rows.len();
        if marked.is_empty() { Ok(()) } else { self.courier.write(&marked) }
    }

    /// Sends one message and counts it.
    fn send(&mut self, row: &mut AlertRecord) {
        let (status, error) = match self.courier.send(self.channel, row) {
            Attempt::Sent => (AlertStatus::Sent, None),
            Attempt::NotSent(why) => (AlertStatus::Pending, Some(why)),
            Attempt::Unknown(why) => (AlertStatus::Unconfirmed, Some(why)),
        };
        row.error = error;
        mark(row, status, self.run_id);
        match status {
            AlertStatus::Sent => self.summary.sent += 1,
            AlertStatus::Unconfirmed => self.delivery.unconfirmed.push(row.clone()),
            _ => self.delivery.failed.push(row.clone()),
        }
    }
}

fn mark(row: &mut AlertRecord, status: AlertStatus, run_id: &str) {
    row.status = status;
    run_id.clone_into(&mut row.run_id);
    row.recorded_utc = Timestamp::now();
}
