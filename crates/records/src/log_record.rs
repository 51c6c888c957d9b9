//! Log record: the status of one log.

use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use strum::{EnumString, IntoStaticStr};

use crate::gap_record::RecordKey;
use crate::row_schema::word_cell;
use crate::stored_row;

/// How a log ended.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, IntoStaticStr, EnumString)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum LogOutcome {
    /// The records of its flight are stored, or belong to another log.
    #[default]
    Done,
    /// The log failed; `error_code` holds the reason.
    Error,
    /// The content of the log is known; only its name or its date is new.
    Known,
    /// The records are stored, but the run was killed before the log's status: the next run processes it again.
    Unaccounted,
    /// The log is planned, or was not started before the run was interrupted. Written when the run begins, so that a
    /// killed run has a status for it too.
    NotReached,
}

impl LogOutcome {
    /// Whether the log was processed without an error.
    pub fn is_success(self) -> bool {
        matches!(self, Self::Done | Self::Known)
    }
}

word_cell!(LogOutcome);

stored_row! {
    /// Status of one log: enough to know, without opening it, whether it must be processed again.
    #[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
    pub struct LogRecord {
        /// Path of the log. Of its rows that are neither *not reached* nor *unaccounted*, the newest counts.
        pub log_path: String,
        /// Size, bytes.
        pub size_bytes: i64,
        /// Time of the last modification, nanoseconds since 1970 UTC.
        pub modified_utc_ns: i64,
        /// Identifier of the file in its file system; empty where there is none.
        pub file_id: String,
        /// blake3 of the data that were read, if the log was readable.
        pub log_digest: Option<String>,
        /// blake3 of the settings that affect the log.
        pub config_digest: Option<String>,
        /// The aircraft, where the log identifies it.
        pub tail_number: Option<String>,
        /// The flight, where the log identifies it.
        pub flight_id: Option<String>,
        /// Departure, where the log identifies it.
        pub departure_utc: Option<Timestamp>,
        /// Positions with channels in the log.
        pub positions: Vec<String>,
        /// `done`, `error`, `known`, `unaccounted` or `not_reached`.
        pub outcome: LogOutcome,
        /// Records with a gap.
        pub estimated: i64,
        /// Records without a gap.
        pub refused: i64,
        /// Code of the error.
        pub error_code: Option<String>,
        /// Message of the error.
        pub error_detail: Option<String>,
        /// Processing time, s.
        pub duration_s: f64,
        /// The run that processed the log.
        pub run_id: String,
        /// Time of processing.
        pub processed_utc: Timestamp,
    }
}

impl LogRecord {
    /// Keys of the records that the log's flight may have, one per position; empty if the log was not identified.
    pub fn keys(&self) -> Vec<RecordKey> {
        let Some((tail, departure)) = self.tail_number.as_ref().zip(self.departure_utc) else {
            return Vec::new();
        };
        let key = |position: &String| RecordKey {
            departure_us: departure.as_microsecond(),
            tail_number: tail.clone(),
            position: position.clone(),
        };
        self.positions.iter().map(key).collect()
    }
}
