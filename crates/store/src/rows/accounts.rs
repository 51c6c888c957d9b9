//! Accounts: what became of a log, and what became of a run.

use jiff::Timestamp;

use crate::error::Error;
use crate::rows::row_schema::{CellReader, Column, Getter, RowSchema};
use records::RecordKey;

/// How a log ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LogOutcome {
    /// Its flight's records are stored, or belong to another log.
    Done,
    /// It has a fault, which `error_code` names.
    Error,
    /// Its content is known, and only its name or its date is new.
    Known,
    /// Its records are stored, and the run was killed before it could account for it: the next run does it
    /// again.
    Unaccounted,
    /// Planned by a run, or not started before the run was interrupted. Written when the run begins, so that
    /// a killed run has a status for it too.
    NotReached,
}

impl LogOutcome {
    const ALL: [Self; 5] = [Self::Done, Self::Error, Self::Known, Self::Unaccounted, Self::NotReached];

    /// Those that do not settle what is known of a log.
    pub(crate) const UNSETTLED: [Self; 2] = [Self::Unaccounted, Self::NotReached];

    /// Whether the log went well.
    pub fn is_success(self) -> bool {
        matches!(self, Self::Done | Self::Known)
    }

    /// The word in the `outcome` column.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Done => "done",
            Self::Error => "error",
            Self::Known => "known",
            Self::Unaccounted => "unaccounted",
            Self::NotReached => "not_reached",
        }
    }

    fn parse(text: &str) -> Result<Self, String> {
        let known = Self::ALL.into_iter().find(|outcome| outcome.as_str() == text);
        known.ok_or_else(|| format!("`{text}` is no outcome"))
    }
}

/// The account of one log: enough to know, without opening it, whether it must be done again.
#[derive(Debug, Clone, PartialEq)]
pub struct LogRecord {
    /// Its name; of its accounts that are neither *not reached* nor *unaccounted*, the newest counts.
    pub log_path: String,
    /// Bytes.
    pub size_bytes: i64,
    /// Nanoseconds since 1970 UTC.
    pub modified_utc_ns: i64,
    /// Identifier of the file in its file system; empty where there is none.
    pub file_id: String,
    /// blake3 of what was read of it, where it could be read.
    pub log_digest: Option<String>,
    /// blake3 of the settings that touch it.
    pub config_digest: Option<String>,
    /// The aircraft, where the log identifies it.
    pub tail_number: Option<String>,
    /// The flight, where the log identifies it.
    pub flight_id: Option<String>,
    /// The departure, where the log holds it.
    pub departure_utc: Option<Timestamp>,
    /// The positions it has channels of.
    pub positions: Vec<String>,
    /// How it ended.
    pub outcome: LogOutcome,
    /// Records with a gap.
    pub estimated: i64,
    /// Records without one.
    pub refused: i64,
    /// Stable code of its fault.
    pub error_code: Option<String>,
    /// The fault in full.
    pub error_detail: Option<String>,
    /// Seconds of work.
    pub duration_s: f64,
    /// The run that finished with it.
    pub run_id: String,
    /// When.
    pub processed_utc: Timestamp,
}

impl LogRecord {
    /// The records it speaks for: those of its flight, where it made any.
    pub fn record_keys(&self) -> Vec<RecordKey> {
        if self.estimated + self.refused > 0 { self.keys() } else { Vec::new() }
    }

    /// The records its flight may have, one per position; none where the log was not identified.
    pub fn keys(&self) -> Vec<RecordKey> {
        let (Some(tail), Some(flight), Some(departure)) =
            (&self.tail_number, &self.flight_id, self.departure_utc)
        else {
            return Vec::new();
        };
        let key = |position: &String| RecordKey {
            departure_us: departure.as_microsecond(),
            tail_number: tail.clone(),
            flight_id: flight.clone(),
            position: position.clone(),
        };
        self.positions.iter().map(key).collect()
    }
}

impl RowSchema for LogRecord {
    const COLUMNS: &'static [Column<Self>] = &[
        Column::required("log_path", Getter::Text(|a| Some(&a.log_path))),
        Column::required("size_bytes", Getter::Count(|a| Some(a.size_bytes))),
        Column::required("modified_utc_ns", Getter::Count(|a| Some(a.modified_utc_ns))),
        Column::required("file_id", Getter::Text(|a| Some(&a.file_id))),
        Column::nullable("log_digest", Getter::Text(|a| a.log_digest.as_deref())),
        Column::nullable("config_digest", Getter::Text(|a| a.config_digest.as_deref())),
        Column::nullable("tail_number", Getter::Text(|a| a.tail_number.as_deref())),
        Column::nullable("flight_id", Getter::Text(|a| a.flight_id.as_deref())),
        Column::nullable("departure_utc", Getter::Time(|a| a.departure_utc)),
        Column::required("positions", Getter::Texts(|a| &a.positions)),
        Column::required("outcome", Getter::Text(|a| Some(a.outcome.as_str()))),
        Column::required("estimated", Getter::Count(|a| Some(a.estimated))),
        Column::required("refused", Getter::Count(|a| Some(a.refused))),
        Column::nullable("error_code", Getter::Text(|a| a.error_code.as_deref())),
        Column::nullable("error_detail", Getter::Text(|a| a.error_detail.as_deref())),
        Column::required("duration_s", Getter::Number(|a| Some(a.duration_s))),
        Column::required("run_id", Getter::Text(|a| Some(&a.run_id))),
        Column::required("processed_utc", Getter::Time(|a| Some(a.processed_utc))),
    ];

    fn from_cells(cells: &mut CellReader<'_>) -> Result<Self, Error> {
        Ok(Self {
            log_path: cells.owned()?,
            size_bytes: cells.count()?,
            modified_utc_ns: cells.count()?,
            file_id: cells.owned()?,
            log_digest: cells.owned_or_none(),
            config_digest: cells.owned_or_none(),
            tail_number: cells.owned_or_none(),
            flight_id: cells.owned_or_none(),
            departure_utc: cells.time_or_none()?,
            positions: cells.texts(),
            outcome: cells.parse(LogOutcome::parse)?,
            estimated: cells.count()?,
            refused: cells.count()?,
            error_code: cells.owned_or_none(),
            error_detail: cells.owned_or_none(),
            duration_s: cells.number().unwrap_or_default(),
            run_id: cells.owned()?,
            processed_utc: cells.time()?,
        })
    }
}

/// The account of one run, written when it begins and again when it ends.
#[derive(Debug, Clone, PartialEq)]
pub struct RunRecord {
    /// Its name; the newest account of a name counts.
    pub run_id: String,
    /// When it began.
    pub started_utc: Timestamp,
    /// When it ended; for a run that was killed, when its last log was finished, once the next run has seen
    /// to it.
    pub finished_utc: Option<Timestamp>,
    /// The version of Freeplay.
    pub program_version: String,
    /// Its configuration.
    pub config_path: String,
    /// Logs that fit the patterns.
    pub found: i64,
    /// Logs accounted for before.
    pub known: i64,
    /// Logs finished, those in error included.
    pub done: i64,
    /// Records with a gap.
    pub estimated: i64,
    /// Records without one.
    pub refused: i64,
    /// Logs in error.
    pub errors: i64,
    /// Logs it has not come to, or was stopped before.
    pub not_reached: i64,
    /// Exit code; none for a run that was killed or is still active.
    pub exit_code: Option<i64>,
}

impl RunRecord {
    /// Whether its figures are final.
    pub fn has_ended(&self) -> bool {
        self.finished_utc.is_some()
    }
}

impl RowSchema for RunRecord {
    const COLUMNS: &'static [Column<Self>] = &[
        Column::required("run_id", Getter::Text(|a| Some(&a.run_id))),
        Column::required("started_utc", Getter::Time(|a| Some(a.started_utc))),
        Column::nullable("finished_utc", Getter::Time(|a| a.finished_utc)),
        Column::required("program_version", Getter::Text(|a| Some(&a.program_version))),
        Column::required("config_path", Getter::Text(|a| Some(&a.config_path))),
        Column::required("found", Getter::Count(|a| Some(a.found))),
        Column::required("known", Getter::Count(|a| Some(a.known))),
        Column::required("done", Getter::Count(|a| Some(a.done))),
        Column::required("estimated", Getter::Count(|a| Some(a.estimated))),
        Column::required("refused", Getter::Count(|a| Some(a.refused))),
        Column::required("errors", Getter::Count(|a| Some(a.errors))),
        Column::required("not_reached", Getter::Count(|a| Some(a.not_reached))),
        Column::nullable("exit_code", Getter::Count(|a| a.exit_code)),
    ];

    fn from_cells(cells: &mut CellReader<'_>) -> Result<Self, Error> {
        Ok(Self {
            run_id: cells.owned()?,
            started_utc: cells.time()?,
            finished_utc: cells.time_or_none()?,
            program_version: cells.owned()?,
            config_path: cells.owned()?,
            found: cells.count()?,
            known: cells.count()?,
            done: cells.count()?,
            estimated: cells.count()?,
            refused: cells.count()?,
            errors: cells.count()?,
            not_reached: cells.count()?,
            exit_code: cells.count_or_none(),
        })
    }
}
