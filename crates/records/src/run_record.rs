//! Run record: status and counts of one run.

use jiff::Timestamp;

use crate::stored_row;

stored_row! {
    /// Status of one run, written when it begins and again when it ends.
    #[derive(Debug, Clone, Default, PartialEq, serde::Serialize)]
    pub struct RunRecord {
        /// Identifier of the run; the newest row of an identifier counts.
        pub run_id: String,
        /// Start of the run.
        pub started_utc: Timestamp,
        /// End of the run; for a killed run the end of its last log, as the next run completes it.
        pub finished_utc: Option<Timestamp>,
        /// Version of Freeplay.
        pub program_version: String,
        /// Path of the configuration.
        pub config_path: String,
        /// Logs that match the patterns.
        pub found: i64,
        /// Logs that were processed before.
        pub known: i64,
        /// Logs processed in this run, failed ones included.
        pub done: i64,
        /// Records with a gap.
        pub estimated: i64,
        /// Records without a gap.
        pub refused: i64,
        /// Logs that failed.
        pub errors: i64,
        /// Logs not processed, because the run has not reached them or was stopped.
        pub not_reached: i64,
        /// Exit code by the logs alone, before `--fail-on` and alerts count; none for a run that was killed or is still active.
        pub exit_code: Option<i64>,
        /// blake3 of the tables whose bookkeeping is in all records; none until the run has ended.
        pub tables_digest: Option<String>,
    }
}

impl RunRecord {
    /// Whether its figures are final.
    pub fn has_ended(&self) -> bool {
        self.finished_utc.is_some()
    }
}
