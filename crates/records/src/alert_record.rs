//! Alert record: one change of state, and what became of its message in each channel.

use jiff::Timestamp;
use strum::{EnumString, IntoStaticStr};

use crate::row_schema::word_cell;
use crate::stored_row;

/// What became of an alert.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, IntoStaticStr, EnumString)]
#[strum(serialize_all = "snake_case")]
pub enum AlertStatus {
    /// The change itself: it needs no message, or its messages have rows of their own.
    #[default]
    Recorded,
    /// The message was not sent; the next run sends it.
    Pending,
    /// The message is being sent. A run that was killed here leaves this status.
    Sending,
    /// The receiver accepted the message.
    Sent,
    /// The message may or may not have been received: the run was killed, or the receiver did not answer in time.
    Unconfirmed,
    /// A person has taken the message back.
    Dropped,
}

impl AlertStatus {
    /// Whether the message has not been received, or perhaps not.
    pub fn is_unsent(self) -> bool {
        matches!(self, Self::Pending | Self::Sending | Self::Unconfirmed)
    }
}

word_cell!(AlertStatus);

stored_row! {
    /// One change of state, or its message in one channel.
    #[derive(Debug, Clone, Default, PartialEq)]
    pub struct AlertRecord {
        /// Identifier of the change. Of the rows with one `alert_id` and `channel`, the newest counts.
        pub alert_id: String,
        /// Channel of the message, as named under `[alerts]`; empty in the row of the change.
        pub channel: String,
        /// `change`, or `baseline` for the states that were known when alerts began.
        pub kind: String,
        /// Part number of the unit, or the part that changed.
        pub part_number: Option<String>,
        /// Serial number of the unit; empty for a tail, a part or a baseline.
        pub serial_number: Option<String>,
        /// The aircraft of its latest flight, or the one that changed.
        pub tail_number: Option<String>,
        /// Position on the aircraft.
        pub position: Option<String>,
        /// Quantity whose state changed; `gap` is the free play.
        pub quantity: String,
        /// Number of the change of this unit and quantity, from 0 for the baseline.
        pub change_number: i64,
        /// State before and after the change; empty when there is none.
        pub from_state: Option<String>,
        pub to_state: Option<String>,
        /// First flight of a change of a tail or part.
        pub since_utc: Option<Timestamp>,
        /// Date of the assessment; later data are ignored.
        pub as_of_utc: Timestamp,
        /// The message that is sent, JSON.
        pub message: Option<String>,
        /// `recorded`, `pending`, `sending`, `sent`, `unconfirmed` or `dropped`.
        pub status: AlertStatus,
        /// Attempts to send the message.
        pub attempts: i64,
        /// Why the last attempt failed.
        pub error: Option<String>,
        /// The run that wrote the row.
        pub run_id: String,
        /// When the row was written.
        pub recorded_utc: Timestamp,
    }
}
